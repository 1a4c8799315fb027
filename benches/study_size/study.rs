//! A study of many sessions, made by the server's own code on clocks that are moved by hand: its sessions, the comments
//! in them, and telemetry chained as often as in theatre.

#[path = "../../tests/trial/fixture.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod fixture;

use std::path::Path;
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_base::step::StepRecord;
use parfocal_records::store::telemetry::run_writer;
use parfocal_session::conductor::StudyPlace;
use parfocal_trial::account::AccountRole;
use parfocal_trial::action::Action;
use parfocal_trial::phase::Phase;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::role::Role;
use parfocal_trial::study::signature::Signature;
use parfocal_trial::study::state::Change;
use sqlx::{Connection, SqliteConnection};
use tokio::sync::mpsc;

use fixture::{Trial, known};

/// The study's name.
pub const STUDY: &str = "size";

const SITE: &str = "leeds";
const PERSON: &str = "Dr Lead";

/// Number of settings in a session.
const SETTINGS: usize = 6;

/// Steps that are chained together: 16 s at 50 a second, as a server does.
const CHAINED: usize = 800;

const FRAME: Duration = Duration::from_millis(20);

const PROTOCOL: &str = r#"
name = "size"
title = "Comparison of focus settings"
researcher_title = "Three policies, twice each"
policies = ["fixed", "mgm-hill-climber", "mlr-hill-climber"]
repeats = 2
order = "balanced"
segment_seconds = 3600

[[after_segment]]
id = "sharpness"
text = "How sharp was the picture?"
kind = "likert"
points = 7
low = "blurred"
high = "sharp"
"#;

/// A study that was made, and unblinded.
pub struct Made {
    /// The server that made it.
    pub trial: Trial,
    /// Its sessions, in order.
    pub sessions: Vec<SessionId>,
}

/// Makes an unblinded study of this many sessions with about this many steps of telemetry each in the folder `data`.
pub async fn make(data: &Path, sessions: usize, steps: usize) -> Made {
    std::fs::write(data.join("size.toml"), PROTOCOL).expect("the folder can be written");
    let mut trial = Trial::start_with(data, Some(data), 5).await;
    trial.account("lead", AccountRole::Lead, PERSON).await;

    let plan = trial.conductor.plan_study(Role::Researcher, definition(sessions), Vec::new(), signature());
    plan.await.expect("the plan is sound");
    change(&trial, Change::Open { despite_concerns: true }).await;

    let mut made = Vec::new();
    for number in 1..=sessions {
        made.push(session(&mut trial, number, steps).await);
        fold_log(data).await;
    }

    change(&trial, Change::Close).await;
    change(&trial, Change::Lock { despite_outstanding: true }).await;
    change(&trial, Change::Unblind).await;
    Made { trial, sessions: made }
}

fn definition(sessions: usize) -> String {
    let protocol = Protocol::parse(PROTOCOL, "size.toml", &known()).expect("the protocol is sound");
    let sha256 = hex::encode(protocol.sha256());
    format!(
        "name = \"{STUDY}\"\ntitle = \"A study of many sessions\"\norder = \"balanced\"\naborted = \"next-spare\"\n\
         withdrawn = \"next-spare\"\nrepeated = \"refuse\"\nwhen_used_up = \"Call the trial office.\"\n\
         may_unblind = [\"{PERSON}\"]\nanalysis = \"Friedman over policies\"\n\
         [[protocols]]\nname = \"size\"\nsha256 = \"{sha256}\"\n\
         [[sites]]\nname = \"{SITE}\"\ntitle = \"Leeds\"\nsurgeons = {sessions}\nspares = 0\n"
    )
}

fn signature() -> Signature {
    Signature::new(PERSON, "as planned").expect("both are given")
}

async fn change(trial: &Trial, change: Change) {
    let changed = trial.conductor.change_study(Role::Researcher, STUDY.to_owned(), change, signature());
    changed.await.expect("the study allows it");
}

async fn session(trial: &mut Trial, number: usize, steps: usize) -> SessionId {
    let code = format!("S-{number:03}");
    trial.conductor.add_participant(Role::Operator, &code).await.expect("the code is sound");
    let site = StudyPlace { study: STUDY.to_owned(), site: SITE.to_owned() };
    let session = trial.conductor.create(Role::Operator, &code, "size", Some(site)).await;
    let session = session.expect("there is a place");
    trial.conductor.act(Role::Operator, session, Action::Start).await.expect("it was prepared");

    let mut begun = trial.clock.now();
    while trial.view().phase == Phase::Notice {
        let segment = trial.whole_setting().await;
        telemetry(trial, segment, begun, steps.div_ceil(SETTINGS)).await;
        begun = trial.clock.now();
    }
    assert_eq!(trial.view().phase, Phase::Completed);
    trial.conductor.dismiss(Role::Operator, session).expect("it is on the screens");
    session
}

/// Writes `steps` steps of `segment` as the server does, but faster than they would come.
async fn telemetry(trial: &Trial, segment: SegmentId, begun: Moment, steps: usize) {
    let policy = known().into_iter().next();
    let mut frames = (0_u64..).take(steps).peekable();

    while frames.peek().is_some() {
        let (sender, records) = mpsc::channel(CHAINED);
        for frame in frames.by_ref().take(CHAINED) {
            // Like a hand that drifts and a policy that follows: no two numbers are alike.
            let optimum = 0.5 + 0.3 * (frame as f64 / 300.0).sin() + 0.01 * (frame as f64 / 7.0).cos();
            let asked = optimum + 0.05 * (frame as f64 / 11.0).sin();
            let record = StepRecord {
                frame,
                exposed_at: begun + FRAME * frame as u32,
                segment: Some(segment),
                policy: policy.clone(),
                asked: FocalPower::nearest(asked),
                measured: Some(FocalPower::nearest(asked - 0.001)),
                metric: Some(20.0 + 10.0 * (asked - optimum).cos()),
                policy_micros: 70 + (frame % 13) as u32,
                latency_micros: 900 + (frame % 101) as u32,
                held: None,
                optimal: Some(FocalPower::nearest(optimum)),
                patch: (240, 120),
            };
            sender.try_send(record).expect("there is room for them");
        }
        // The writer ends after the last record, and chains them.
        drop(sender);
        run_writer(trial.store.clone(), records).await;
    }
}

/// Folds the database's write-ahead log into it, as a server does every 16 s.
async fn fold_log(data: &Path) {
    let file = format!("sqlite://{}", data.join("parfocal.db").display());
    let mut connection = SqliteConnection::connect(&file).await.expect("the database is there");
    sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").execute(&mut connection).await.expect("nobody holds it");
    connection.close().await.expect("nobody uses it");
}
