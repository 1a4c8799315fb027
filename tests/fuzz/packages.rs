//! The exports of a study's sessions, as one site gives them to another: verified and joined by `parfocal study merge`.
//! One file at a time is replaced, and the checksums of its export are made anew, as a forger would do. Without that,
//! nothing behind the checksums would ever be read.

use std::cell::LazyCell;
use std::fs;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use parfocal_results::package::{PackageSource, Sessions, check, exports_of, left_out, write};
use parfocal_results::study_export::export_study;
use parfocal_session::conductor::StudyPlace;
use parfocal_trial::account::AccountRole;
use parfocal_trial::action::Action;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::role::Role;
use parfocal_trial::study::signature::Signature;
use parfocal_trial::study::state::Change;
use parfocal_trial::voice::{Ending, NewPiece};
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use tokio::runtime::Builder;

use super::fixture::{Trial, known};
use super::folders::Folder;

const STUDY: &str = "scope-2026";
const SUMS: &str = "SHA256SUMS";

const PROTOCOL: &str = r#"
name = "pair"
title = "Comparison of two focus settings"
researcher_title = "Two hill-climbers, once each"
policies = ["mgm-hill-climber", "mlr-hill-climber"]
repeats = 1
order = "balanced"
segment_seconds = 60
voice = true
"#;

/// The parts of a package that `study merge` reads: the exports, and the package's own description. Made once, because
/// ending a study takes a while.
static MADE: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let runtime = Builder::new_current_thread().enable_all().build().unwrap();
    let package = folder.path().join("package");
    runtime.block_on(make(&folder.path().join("data"), &package));

    for entry in fs::read_dir(&package).unwrap() {
        let path = entry.unwrap().path();
        let is_read = ["sessions", "datapackage.json", SUMS].iter().any(|name| path.ends_with(name));
        if !is_read && path.is_dir() {
            fs::remove_dir_all(path).unwrap();
        } else if !is_read {
            fs::remove_file(path).unwrap();
        }
    }
    folder
});

thread_local! {
    static PACKAGE: LazyCell<Folder> = LazyCell::new(|| Folder::made_by(|folder| {
        copy(&MADE.path().join("package"), folder);
    }));
}

/// A package with one of its files replaced is joined again, or refused.
pub fn package(bytes: &[u8]) {
    let Some(which) = bytes.first() else { return };
    PACKAGE.with(|package| {
        let replaced = package.file(*which);
        package.with(bytes, |folder| {
            let resealed = reseal(replaced);
            // Each input takes only one of the two, because either takes as long as all other targets together.
            if bytes.len().is_multiple_of(2) {
                assert_eq!(check(folder, None).len(), 3);
            } else {
                let _ = joined(folder);
            }
            if let Some((sums, before)) = resealed {
                fs::write(sums, before).unwrap();
            }
        });
    });
}

/// The files of a package.
pub fn packages() -> Vec<Vec<u8>> {
    PACKAGE.with(|package| package.seeds())
}

/// Joins the package in `folder`, as `study merge` does.
fn joined(folder: &Path) -> Result<(), parfocal_results::package::PackageError> {
    let left_out = left_out(folder)?;
    let sources =
        exports_of(folder)?.iter().map(|export| PackageSource::open(export)).collect::<Result<Vec<_>, _>>()?;
    let out = tempfile::tempdir().unwrap();
    write(&sources, Sessions::Copied, &left_out, &out.path().join("joined"), &mut |_, _| ())?;
    Ok(())
}

/// Writes the checksum of `file` into the checksums of its export. Returns the file of those and its previous content.
fn reseal(file: &Path) -> Option<(std::path::PathBuf, String)> {
    let sums = file.ancestors().skip(1).map(|folder| folder.join(SUMS)).find(|sums| sums.exists())?;
    if sums == file {
        return None;
    }

    let before = fs::read_to_string(&sums).unwrap();
    let name = file.strip_prefix(sums.parent()?).unwrap().display().to_string();
    let sum = hex::encode(Sha256::digest(fs::read(file).unwrap()));
    let after = before.lines().map(|line| match line.split_once("  ") {
        Some((_, listed)) if listed == name => format!("{sum}  {name}\n"),
        _ => format!("{line}\n"),
    });
    fs::write(&sums, after.collect::<String>()).unwrap();
    Some((sums, before))
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let there = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &there);
        } else {
            fs::copy(&path, &there).unwrap();
        }
    }
}

/// Runs a study of two sessions on the folder `data`, and exports it unblinded into `out`.
async fn make(data: &Path, out: &Path) {
    let protocols = data.join("protocols");
    fs::create_dir_all(&protocols).unwrap();
    fs::write(protocols.join("pair.toml"), PROTOCOL).unwrap();
    let mut trial = Trial::start_with(data, Some(&protocols), 5).await;
    trial.account("lead", AccountRole::Lead, "Dr Lead").await;
    plan(&trial).await;

    for participant in ["S-02", "S-03"] {
        trial.conductor.add_participant(Role::Operator, participant).await.unwrap();
        session(&mut trial, participant).await;
    }

    change(&trial, Change::Close).await;
    change(&trial, Change::Lock { despite_outstanding: true }).await;
    change(&trial, Change::Unblind).await;
    export_study(&trial.access_log(), STUDY, true, out, Arc::new(|_| ())).await.unwrap();
    trial.store.close().await;
}

async fn plan(trial: &Trial) {
    let protocol = Protocol::parse(PROTOCOL, "pair.toml", &known()).unwrap();
    let definition = format!(
        r#"name = "{STUDY}"
title = "Two hill-climbers in the eyes of two surgeons"
order = "balanced"
aborted = "next-spare"
withdrawn = "next-spare"
repeated = "refuse"
when_used_up = "Call the trial office."
may_unblind = ["Dr Lead"]
analysis = "Wilcoxon signed-rank test on sharpness"

[[protocols]]
name = "pair"
sha256 = "{}"

[[sites]]
name = "leeds"
title = "Leeds General Infirmary"
surgeons = 2
spares = 2
"#,
        hex::encode(protocol.sha256())
    );
    trial.conductor.plan_study(Role::Researcher, definition, Vec::new(), signature()).await.unwrap();
    change(trial, Change::Open { despite_concerns: true }).await;
}

fn signature() -> Signature {
    Signature::new("Dr Lead", "as planned").unwrap()
}

async fn change(trial: &Trial, change: Change) {
    trial.conductor.change_study(Role::Researcher, STUDY.to_owned(), change, signature()).await.unwrap();
}

/// A session of `participant`, with a written comment and a spoken one.
async fn session(trial: &mut Trial, participant: &str) {
    let place = StudyPlace { study: STUDY.to_owned(), site: "leeds".to_owned() };
    let session = trial.conductor.create(Role::Operator, participant, "pair", Some(place)).await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();

    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.say("=1+1 looks \"sharp\",\nin the middle").await;
    let mut aloud = trial.comment("");
    aloud.said = CommentContent::Voice;
    trial.conductor.comment(aloud.clone()).await.unwrap();
    for (piece, ended, audio) in
        [(1, None, b"\x1a\x45\xdf\xa3 sound".to_vec()), (2, Some(Ending::Released), Vec::new())]
    {
        let media_type = "audio/webm;codecs=opus".to_owned();
        let new = NewPiece { comment: aloud.key, session, piece, media_type, through_ms: 900, ended, audio };
        trial.conductor.voice_piece(new).await.unwrap();
    }

    let abort = Action::Abort { reason: "time is up".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
    trial.conductor.dismiss(Role::Operator, session).unwrap();
}
