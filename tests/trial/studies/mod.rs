//! Studies: their definition, their places, their course, and their export and verification.

mod analysis;
mod blinding;
mod concerns;
mod course;
mod definition;
mod evidence;
mod package;
mod places;
#[path = "../../shared/program.rs"]
mod program;

use std::path::Path;

use parfocal_base::ids::SessionId;
use parfocal_session::conductor::{ConductError, StudyPlace};
use parfocal_session::reports::StudyDetail;
use parfocal_trial::account::AccountRole;
use parfocal_trial::action::Action;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::role::Role;
use parfocal_trial::study::signature::Signature;
use parfocal_trial::study::state::Change;

use crate::fixture::Trial;

pub const STUDY: &str = "scope-2026";

/// Who may unblind the study.
pub const STATISTICIAN: &str = "Trial statistician, Leeds";

/// A protocol with balanced order. It has two policies, so two sessions are a set.
pub const PROTOCOL: &str = r#"
name = "pair"
title = "Comparison of two focus settings"
researcher_title = "Two hill-climbers, once each"
policies = ["mgm-hill-climber", "mlr-hill-climber"]
repeats = 1
order = "balanced"
segment_seconds = 60
voice = true
"#;

/// The protocol, installed.
pub fn protocol() -> Protocol {
    Protocol::parse(PROTOCOL, "pair.toml", &crate::fixture::known()).unwrap()
}

/// The definition of a study with that protocol at two sites.
pub fn definition() -> String {
    format!(
        r#"name = "{STUDY}"
title = "Two hill-climbers in the eyes of five surgeons"
order = "balanced"
aborted = "next-spare"
withdrawn = "next-spare"
repeated = "refuse"
when_used_up = "Call the trial office."
may_unblind = ["{STATISTICIAN}"]
analysis = "Wilcoxon signed-rank test on sharpness"

[[protocols]]
name = "pair"
sha256 = "{}"

[[sites]]
name = "leeds"
title = "Leeds General Infirmary"
surgeons = 2
spares = 2

[[sites]]
name = "london"
title = "King's College Hospital"
surgeons = 3
spares = 0
"#,
        hex::encode(protocol().sha256())
    )
}

pub fn signed(reason: &str) -> Signature {
    Signature::new("Dr Lead", reason).unwrap()
}

/// Starts a server with the protocol in its library.
pub async fn a_trial(folder: &Path) -> Trial {
    a_trial_from(folder, 5).await
}

/// The same, with a random source that begins with `seed`.
pub async fn a_trial_from(folder: &Path, seed: u64) -> Trial {
    std::fs::write(folder.join("pair.toml"), PROTOCOL).unwrap();
    let trial = Trial::start_with(folder, Some(folder), seed).await;
    for code in ["S-02", "S-03", "S-04", "S-05"] {
        trial.conductor.add_participant(Role::Operator, code).await.unwrap();
    }
    if trial.accounts().all().await.unwrap().is_empty() {
        trial.account("lead", AccountRole::Lead, "Dr Lead").await;
    }
    trial
}

/// Plans the study.
pub async fn plan(trial: &Trial, definition: String) -> Result<String, ConductError> {
    let planned = trial.conductor.plan_study(Role::Researcher, definition, Vec::new(), signed("ethics approved it"));
    planned.await.map(|name| name.as_str().to_owned())
}

/// Changes the study, with the lead's signature.
pub async fn change(trial: &Trial, change: Change) -> Result<(), ConductError> {
    trial.conductor.change_study(Role::Researcher, STUDY.to_owned(), change, signed("as planned")).await
}

/// Starts a server with an open study.
pub async fn opened(folder: &Path) -> Trial {
    let trial = a_trial(folder).await;
    plan(&trial, definition()).await.unwrap();
    change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
    trial
}

pub async fn detail(trial: &Trial) -> StudyDetail {
    StudyDetail::read(trial.conductor.studies(), STUDY).await.unwrap()
}

/// Prepares a session of `participant` in the study at `site`.
pub async fn prepare(trial: &Trial, participant: &str, site: &str) -> Result<SessionId, ConductError> {
    let place = StudyPlace { study: STUDY.to_owned(), site: site.to_owned() };
    trial.conductor.create(Role::Operator, participant, "pair", Some(place)).await
}

/// Runs a session of `participant` in the study at `site` from its start to its end, and closes it.
pub async fn whole(trial: &mut Trial, participant: &str, site: &str) -> SessionId {
    let session = prepare(trial, participant, site).await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
    for _ in 0..2 {
        trial.whole_setting().await;
    }
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    session
}

/// Makes a session of `participant` in the study at `site`, aborts it, and closes it.
pub async fn aborted(trial: &Trial, participant: &str, site: &str) -> SessionId {
    let session = prepare(trial, participant, site).await.unwrap();
    let abort = Action::Abort { reason: "the light failed".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    session
}

/// Closes and locks the study, and unblinds all of it.
pub async fn to_the_end(trial: &Trial) {
    change(trial, Change::Close).await.unwrap();
    change(trial, Change::Lock { despite_outstanding: true }).await.unwrap();
    let signature = Signature::new(STATISTICIAN, "the database is locked").unwrap();
    trial.conductor.change_study(Role::Researcher, STUDY.to_owned(), Change::Unblind, signature).await.unwrap();
}
