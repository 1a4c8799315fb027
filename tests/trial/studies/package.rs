//! A study's package: its contents, as the intended programs read them, and what is refused.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use parfocal_results::package::{self, PackageSource, Sessions, exports_of};
use parfocal_results::study_export::{ExportProgress, StudyExportState, StudyExports, export_study};
use parfocal_trial::erasure::{Erasable, NewErasure};
use parfocal_trial::remark::NewComment;
use serde_json::Value;

use super::program::{command, done, parfocal, refused, text};
use super::*;
use crate::exports::{failed, is_its_owners_alone, json, rows};

/// A text longer than one segment of an SPSS string, with multi-byte characters where its segments meet.
fn long_text() -> String {
    "Gefäß ".repeat(120)
}

/// The surgeons' comments, one in each session: one that a spreadsheet would run, one that is long, one of several
/// lines.
fn said() -> [String; 3] {
    ["=1+1 looks sharp".to_owned(), long_text(), "first line\nsecond, with \"quotes\"".to_owned()]
}

/// Makes a data folder with the study at its end. Its sessions ran at these `sites`. The server's random source begins
/// with `seed`.
async fn data_of(folder: &Path, seed: u64, sites: &[&str]) {
    std::fs::create_dir_all(folder).unwrap();
    let mut trial = a_trial_from(folder, seed).await;
    plan(&trial, definition()).await.unwrap();
    change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
    for ((site, participant), said) in sites.iter().zip(["S-02", "S-03", "S-04"]).zip(said()) {
        let session = prepare(&trial, participant, site).await.unwrap();
        trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
        let segment = trial.view().segment.unwrap();
        trial.surgeon(Action::Acknowledge { segment }).await;
        // A faulty page may send any number as that of a frame.
        let comment = NewComment { frame: Some(u64::MAX), ..trial.comment(&said) };
        trial.conductor.comment(comment).await.unwrap();
        trial.conductor.act(Role::Operator, session, Action::Abort { reason: "time is up".to_owned() }).await.unwrap();
        trial.conductor.dismiss(Role::Operator, session).unwrap();
    }
    to_the_end(&trial).await;
    trial.store.close().await;
}

/// Exports the study from the data folder `data`. Standard error is not a terminal here, so the progress appears in
/// lines.
fn exported(data: &Path, out: &Path, more: &[&str]) {
    let arguments = ["export", "--study", STUDY, "--data-dir", text(data), "--out", text(out)];
    let output = parfocal(&[&arguments[..], more].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{told}");

    let (sessions, joining): (Vec<&str>, Vec<&str>) = told.lines().partition(|line| line.contains("sessions exported"));
    let last = sessions.last().and_then(|line| line.split_once(" of ")).unwrap();
    assert_eq!(last.1, format!("{} sessions exported", last.0));
    let last = joining.last().and_then(|line| line.split_once(" of ")).unwrap();
    assert_eq!(last.1, format!("{} steps of joining", last.0));
}

/// Makes the package of a study of three sessions at two sites.
async fn package(folder: &Path) -> PathBuf {
    let data = folder.join("data");
    data_of(&data, 5, &["leeds", "leeds", "london"]).await;
    let out = folder.join("package");
    exported(&data, &out, &["--unblinded"]);
    assert!(is_its_owners_alone(&out), "it has the policies");
    out
}

/// The contents of the package, as DuckDB, Polars and pyreadstat in Python read them.
fn python(package: &Path) -> Value {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["studies", "recordings"].map(|name| root.join("target").join(name));
    assert!(folders[0].join("installed").exists(), "Python's readers are missing; run `.ci/setup test` once");

    let mut python = Command::new("python3");
    python.arg("-s").arg(root.join("tests/trial/studies/read_package.py")).arg(package);
    let output = python.env("PYTHONPATH", std::env::join_paths(folders).unwrap()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn texts(rows: &Value) -> BTreeSet<String> {
    rows.as_array().unwrap().iter().map(|row| row["text"].as_str().unwrap().to_owned()).collect()
}

/// A spreadsheet would run such a name as a formula, so an apostrophe stands before it in the CSV files.
#[tokio::test]
async fn a_study_and_a_site_whose_names_begin_with_a_dash_are_exported_too() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let trial = a_trial(&data).await;
    let definition = definition().replace(STUDY, "-scope").replace("\"leeds\"", "\"-leeds\"");
    plan(&trial, definition).await.unwrap();
    let open = Change::Open { despite_concerns: true };
    trial.conductor.change_study(Role::Researcher, "-scope".to_owned(), open, signed("as planned")).await.unwrap();
    let place = StudyPlace { study: "-scope".to_owned(), site: "-leeds".to_owned() };
    let session = trial.conductor.create(Role::Operator, "S-02", "pair", Some(place)).await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "smoke".to_owned() }).await.unwrap();

    let out = folder.path().join("package");
    export_study(&trial.access_log(), "-scope", false, &out, Arc::new(|_| ())).await.unwrap();
    let checks = package::check(&out, None);
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert!(std::fs::read_to_string(out.join("sessions.csv")).unwrap().contains("\n'-leeds,"));
}

#[tokio::test]
async fn other_programs_read_what_was_said_with_its_types_and_labels() {
    let folder = tempfile::tempdir().unwrap();
    let package = package(folder.path()).await;
    let found = python(&package);

    let expected: BTreeSet<String> = said().into_iter().collect();
    assert_eq!(texts(&found["comments"]), expected, "Parquet");
    let frames: BTreeSet<String> = rows(&package, "comments").into_iter().map(|row| row["frame"].clone()).collect();
    assert_eq!(frames, BTreeSet::from([u64::MAX.to_string()]), "CSV");
    // SPSS pads texts with spaces, so readers remove spaces at the end.
    let trimmed: BTreeSet<String> = expected.iter().map(|text| text.trim_end().to_owned()).collect();
    assert_eq!(texts(&found["spss_comments"]), trimmed, "SPSS");
    let redcap: BTreeSet<String> =
        found["redcap"]["comments"].as_array().unwrap().iter().map(|text| text.as_str().unwrap().to_owned()).collect();
    assert_eq!(redcap, expected, "REDCap");

    for reader in ["polars", "spss"] {
        let counts = &found[reader];
        assert_eq!((&counts["sessions"], &counts["segments"]), (&3.into(), &6.into()), "{reader}");
        assert_eq!((&counts["comments"], &counts["allocation"]), (&3.into(), &6.into()), "{reader}");
        assert_eq!(counts["studies"], 2, "{reader}: one study, at two sites");
    }
    assert!(found["polars"]["telemetry"].is_number() && found["spss"]["telemetry"].is_null());

    let types = found["parquet"]["sessions"].as_array().unwrap();
    let columns: Vec<String> = header(&package, "sessions.csv");
    let kind = |name: &str| types[columns.iter().position(|column| column == name).unwrap()].as_str().unwrap();
    assert_eq!(kind("wall"), "TIMESTAMP WITH TIME ZONE");
    assert_eq!((kind("settings"), kind("practice"), kind("participant")), ("BIGINT", "BOOLEAN", "VARCHAR"));

    // A day, a time and milliseconds, "01-MAR-2026 09:00:00.000", have 24 characters. SPSS shows a number where the
    // format is narrower.
    let format = found["formats"]["sessions"]["wall"].as_str().unwrap();
    let (width, decimals) = format.strip_prefix("DATETIME").unwrap().split_once('.').unwrap();
    assert_eq!(decimals, "3");
    assert!(width.parse::<usize>().unwrap() >= "01-MAR-2026 09:00:00.000".len(), "{format}");

    let label = found["labels"]["sessions"]["practice"].as_str().unwrap();
    assert_eq!(label, "Whether the session is practice, which must not be mixed with trial data");
    assert_eq!(found["values"]["sessions"]["practice"]["1.0"], "yes");

    let sessions = rows(&package, "sessions");
    let mut records: Vec<String> = sessions.iter().map(|row| row["session"].clone()).collect();
    records.sort();
    assert_eq!(found["redcap"]["records"], Value::from(records));
    let wall: jiff::Timestamp = sessions[0]["wall"].parse().unwrap();
    assert_eq!(found["redcap"]["times"][0], wall.strftime("%Y-%m-%d %H:%M:%S").to_string());
}

/// The column names of a CSV file.
fn header(folder: &Path, file: &str) -> Vec<String> {
    let mut reader = csv::Reader::from_path(folder.join(file)).unwrap();
    reader.headers().unwrap().iter().map(str::to_owned).collect()
}

#[tokio::test]
async fn the_script_loads_the_tables_into_r() {
    let folder = tempfile::tempdir().unwrap();
    let package = package(folder.path()).await;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/trial/studies/read_package.R");
    let output = Command::new("Rscript").arg(script).current_dir(&package).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let printed = String::from_utf8(output.stdout).unwrap();
    let mut lines = printed.lines();
    assert_eq!(lines.next().unwrap().trim(), "3 6 3");
    assert_eq!(lines.next().unwrap().trim(), "POSIXct POSIXt character logical");
    assert_eq!(
        lines.next().unwrap().trim(),
        "Text of the comment, word for word; for a withdrawal the key of the comment taken back; empty for a mark and \
         for voice, and if the text was erased"
    );
    for said in said() {
        assert!(printed.contains(said.trim_end()), "{printed}");
    }
    let wall: jiff::Timestamp = rows(&package, "sessions")[0]["wall"].parse().unwrap();
    assert_eq!(printed.lines().last().unwrap().trim(), wall.strftime("%Y-%m-%d %H:%M:%S").to_string());
}

#[tokio::test]
async fn a_package_proves_itself_and_tells_what_was_changed() {
    let folder = tempfile::tempdir().unwrap();
    let package = package(folder.path()).await;
    let verified = done(&["verify", text(&package)]);
    for check in ["checksums", "sessions", "tables"] {
        assert!(verified.lines().any(|line| line.starts_with(check) && line.contains(" passed ")), "{verified}");
    }
    assert!(verified.contains("3 exports are as they were exported"), "{verified}");

    // A noted head of the second last row of an export, and then a head that no export has.
    let session = std::fs::read_dir(package.join("sessions")).unwrap().next().unwrap().unwrap().path();
    let rows: Vec<_> =
        rows(&session, "chain").into_iter().map(|row| (row["number"].clone(), row["hash"].clone())).collect();
    let [.., (number, hash), _] = rows.as_slice() else { panic!("{rows:?}") };
    let noted = done(&["verify", text(&package), "--head", &format!("{number}:{}", &hash[..32])]);
    assert!(noted.lines().any(|line| line.starts_with("head") && line.contains("the history of site")), "{noted}");
    let output = parfocal(&["verify", text(&package), "--head", &format!("{number}:{}", "0".repeat(32))]);
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.code() == Some(1) && told.contains("no export in it has the row"), "{told}");

    // A forger who changes a table and its checksum cannot change the evidence in the exports.
    let changed = package.join("comments.csv");
    let before = std::fs::read_to_string(&changed).unwrap();
    std::fs::write(&changed, before.replace("looks sharp", "looks blurred")).unwrap();
    let sums = package.join("SHA256SUMS");
    let listed = Command::new("sh").current_dir(&package).args(["-c", "sha256sum comments.csv"]).output().unwrap();
    let line = String::from_utf8(listed.stdout).unwrap();
    let old = std::fs::read_to_string(&sums).unwrap();
    let new: Vec<&str> = old.lines().map(|l| if l.ends_with("  comments.csv") { line.trim_end() } else { l }).collect();
    std::fs::write(&sums, new.join("\n") + "\n").unwrap();

    let output = parfocal(&["verify", text(&package)]);
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(told.lines().any(|line| line.contains("checksums") && line.contains("passed")), "{told}");
    assert!(told.lines().any(|line| line.starts_with("tables") && line.contains("comments.csv was changed")), "{told}");
}

#[tokio::test]
async fn files_of_operating_systems_are_passed_over_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let package = package(folder.path()).await;
    let session = std::fs::read_dir(package.join("sessions")).unwrap().next().unwrap().unwrap().path();
    std::fs::create_dir_all(session.join("voice")).unwrap();
    let session_name = session.file_name().unwrap().to_str().unwrap();
    let own = [".DS_Store", "sessions/.DS_Store", "spss/Thumbs.db"].map(|name| package.join(name));
    let in_session = [".DS_Store", "._comments.csv", "desktop.ini", "voice/._a.webm"].map(|name| session.join(name));
    for file in own.iter().chain(&in_session) {
        std::fs::write(file, "an operating system's own").unwrap();
    }

    let verified = done(&["verify", text(&package)]);
    for name in [".DS_Store", "spss/Thumbs.db", &format!("sessions/{session_name}/._comments.csv")] {
        assert!(verified.contains(name) && verified.contains("not part of it, and not checked: "), "{verified}");
    }
    let verified = done(&["verify", text(&session)]);
    assert!(verified.contains(".DS_Store, ._comments.csv, desktop.ini, voice/._a.webm"), "{verified}");

    let joined = folder.path().join("joined");
    // A file manager looked into the new folder, and `*` names what it leaves among the sites.
    std::fs::create_dir(&joined).unwrap();
    std::fs::write(joined.join(".DS_Store"), "another").unwrap();
    let beside = folder.path().join("Thumbs.db");
    std::fs::write(&beside, "").unwrap();
    done(&["study", "merge", text(&beside), text(&package), "--out", text(&joined)]);
    assert_eq!(std::fs::read_to_string(joined.join(".DS_Store")).unwrap(), "another");
    std::fs::remove_file(joined.join(".DS_Store")).unwrap();
    let copied = joined.join("sessions").join(session_name);
    assert!(!copied.join(".DS_Store").exists() && !joined.join("sessions/.DS_Store").exists());

    // A file that is a person's is still found.
    std::fs::write(session.join("notes.txt"), "").unwrap();
    let output = parfocal(&["verify", text(&session)]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("notes.txt was added"));
}

#[tokio::test]
async fn two_sites_are_joined_and_what_does_not_belong_together_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    data_of(&path("leeds-data"), 5, &["leeds", "leeds"]).await;
    data_of(&path("london-data"), 6, &["london"]).await;
    for site in ["leeds", "london"] {
        exported(&path(&format!("{site}-data")), &path(site), &["--unblinded"]);
    }

    let out = path("joined");
    let merge = |sites: &[&str], out: &Path| -> Vec<String> {
        let mut arguments = vec!["study".to_owned(), "merge".to_owned()];
        arguments.extend(sites.iter().map(|site| text(&path(site)).to_owned()));
        arguments.extend(["--out".to_owned(), text(out).to_owned()]);
        arguments
    };
    let run = |sites: &[&str], out: &Path| {
        let arguments = merge(sites, out);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        parfocal(&arguments)
    };
    let refusal = |sites: &[&str]| {
        let out = path("refused");
        let output = run(sites, &out);
        assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
        assert!(!out.exists(), "nothing is written");
        String::from_utf8(output.stderr).unwrap()
    };

    let output = run(&["leeds", "london"], &out);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let sites: Vec<String> = rows(&out, "sessions").into_iter().map(|mut row| row.remove("site").unwrap()).collect();
    assert_eq!(sites, ["leeds", "leeds", "london"]);
    assert_eq!(json(&out, "datapackage.json")["parfocal"]["sites"], serde_json::json!(["leeds", "london"]));
    done(&["verify", text(&out)]);

    // One site twice.
    assert!(refusal(&["leeds", "leeds"]).contains("give each site once"), "one site twice");
    // A blinded export beside one that contains the policies.
    exported(&path("london-data"), &path("london-blinded"), &[]);
    assert!(refusal(&["leeds", "london-blinded"]).contains("one contains the policies, the other does not"));
    // Another database that claims to be the same site.
    data_of(&path("impostor-data"), 7, &["leeds"]).await;
    exported(&path("impostor-data"), &path("impostor"), &["--unblinded"]);
    assert!(refusal(&["leeds", "impostor"]).contains("their chains of records differ"));
    // A folder that is not an export.
    assert!(
        refusal(&["leeds", "leeds-data"]).contains("is neither the export of a session nor the package of a study")
    );

    // A changed export, and an export of another version.
    let session = std::fs::read_dir(path("london").join("sessions")).unwrap().next().unwrap().unwrap().path();
    let said = session.join("comments.csv");
    let before = std::fs::read_to_string(&said).unwrap();
    std::fs::write(&said, before.replace("sharp", "blurred")).unwrap();
    assert!(refusal(&["leeds", "london"]).contains("comments.csv was changed since it was exported"));
    std::fs::write(&said, before).unwrap();
    let description = session.join("datapackage.json");
    let before = std::fs::read_to_string(&description).unwrap();
    std::fs::write(&description, before.replace("\"format\": 1", "\"format\": 5")).unwrap();
    assert!(refusal(&["leeds", "london"]).contains("has format 5"), "two versions");
}

#[tokio::test]
async fn a_withdrawn_session_is_left_out_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    std::fs::create_dir_all(&data).unwrap();
    let mut trial = opened(&data).await;
    let first = whole(&mut trial, "S-02", "leeds").await;
    let withdrawn = whole(&mut trial, "S-03", "leeds").await;
    change(&trial, Change::Withdraw { session: withdrawn }).await.unwrap();
    let second = whole(&mut trial, "S-04", "leeds").await;
    trial.store.close().await;

    let out = folder.path().join("package");
    exported(&data, &out, &[]);
    let package = json(&out, "datapackage.json");
    assert_eq!(package["parfocal"]["left_out"][0]["session"], withdrawn.to_string());
    assert_eq!(package["parfocal"]["left_out"][0]["reason"], "the participant withdrew");
    let sessions = |table: &str| -> Vec<String> {
        rows(&out, table).into_iter().map(|mut row| row.remove("session").unwrap()).collect()
    };
    let kept = BTreeSet::from([first.to_string(), second.to_string()]);
    assert_eq!(sessions("sessions").into_iter().collect::<BTreeSet<_>>(), kept);
    assert_eq!(sessions("withdrawals"), [withdrawn.to_string()], "both exports tell of it, and the package once");
    assert!(!out.join("allocation.csv").exists(), "a blinded package tells no policy");
    assert!(
        refused(&["export", "--study", "nothing", "--data-dir", text(&data), "--out", text(&out)])
            .contains("there is no study 'nothing'")
    );

    // An export for which there is no place is refused at once, and not recorded.
    let recorded = async || {
        let pool = crate::storage::raw(&data).await;
        let exports = sqlx::query_scalar("SELECT count(*) FROM accesses WHERE kind = 'exported'");
        let exports: i64 = exports.fetch_one(&pool).await.unwrap();
        pool.close().await;
        exports
    };
    assert_eq!(recorded().await, 2);
    let said = refused(&["export", "--study", STUDY, "--data-dir", text(&data), "--out", text(&out)]);
    assert!(said.contains("package exists and is not empty"), "{said}");
    assert_eq!(recorded().await, 2);
}

#[tokio::test]
async fn a_second_wish_for_a_studys_export_waits_for_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, "S-02", "leeds").await;
    let left = folder.path().join("study-exports/export-of-a-server-that-was-killed");
    std::fs::create_dir_all(&left).unwrap();

    let exports = StudyExports::new(folder.path());
    assert!(!left.exists());
    let reader = trial.store.reader().clone();
    assert_eq!(exports.state(&reader, STUDY).await.unwrap(), StudyExportState::None);

    // The export makes no progress between the two calls, because the test has not awaited anything yet.
    let first = exports.start(trial.access_log(), STUDY, false);
    let begun = StudyExportState::Running { unblinded: false, progress: ExportProgress::default() };
    assert_eq!(first, begun);
    assert_eq!(exports.start(trial.access_log(), STUDY, true), begun);

    let mut told = Vec::new();
    let ready = loop {
        match exports.state(&reader, STUDY).await.unwrap() {
            StudyExportState::Running { progress, .. } => told.push(progress),
            ended => break ended,
        }
        tokio::time::sleep(std::time::Duration::from_millis(1)).await;
    };
    assert_eq!(ready, StudyExportState::Ready { unblinded: false, sessions: 1 });
    assert!(told.is_sorted_by_key(|progress| (progress.exported, progress.joined)), "{told:?}");

    let made = exports.made(&reader, STUDY).await.unwrap().unwrap();
    let export = made.folder().join("sessions").join(session.to_string());
    let accesses = rows(&export, "accesses");
    assert_eq!(accesses.len(), 1, "one export: {accesses:?}");

    // The next export replaces it. Its files stay as long as somebody downloads them.
    let _ = exports.start(trial.access_log(), STUDY, false);
    assert!(exports.made(&reader, STUDY).await.unwrap().is_none());
    assert!(made.folder().is_dir(), "it is being downloaded");
}

#[tokio::test]
async fn a_package_that_was_made_before_something_was_taken_back_is_handed_out_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let kept = whole(&mut trial, "S-02", "leeds").await;
    let withdrawn = whole(&mut trial, "S-03", "leeds").await;
    let reader = trial.store.reader().clone();
    let exports = StudyExports::new(folder.path());
    let make = async || {
        let _ = exports.start(trial.access_log(), STUDY, false);
        loop {
            match exports.state(&reader, STUDY).await.unwrap() {
                StudyExportState::Running { .. } => tokio::time::sleep(std::time::Duration::from_millis(1)).await,
                ended => break ended,
            }
        }
    };
    let given_up = async || {
        assert!(exports.made(&reader, STUDY).await.unwrap().is_none());
        let state = exports.state(&reader, STUDY).await.unwrap();
        let StudyExportState::Failed { reason, .. } = state else { panic!("{state:?}") };
        assert!(reason.contains("a surgeon has withdrawn or words were erased"), "{reason}");
    };

    assert_eq!(make().await, StudyExportState::Ready { unblinded: false, sessions: 2 });
    change(&trial, Change::Withdraw { session: withdrawn }).await.unwrap();
    given_up().await;

    assert_eq!(make().await, StudyExportState::Ready { unblinded: false, sessions: 1 });
    let (_, comment) = reader.comments(kept).await.unwrap().remove(0);
    let reason = "names a patient".to_owned();
    let erasure = NewErasure { subject: Erasable::Comment, record: comment.key.to_string(), reason };
    trial.conductor.erase(Role::Researcher, kept, erasure).await.unwrap();
    given_up().await;
    assert_eq!(make().await, StudyExportState::Ready { unblinded: false, sessions: 1 });
}

#[tokio::test]
async fn a_package_whose_place_is_taken_meanwhile_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let made = package(folder.path()).await;
    let open = |export: &PathBuf| PackageSource::open(export).unwrap();
    let sources: Vec<PackageSource> = exports_of(&made).unwrap().iter().map(open).collect();

    let joined = folder.path().join("joined");
    let out = joined.join("package");
    let mut taken_meanwhile = |_, _| {
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(out.join("notes.txt"), "somebody else's").unwrap();
    };
    let refused = package::write(&sources, Sessions::Copied, &[], &out, &mut taken_meanwhile).unwrap_err();
    assert!(refused.to_string().starts_with("cannot write "), "{refused}");

    let left: Vec<_> = joined.read_dir().unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["package"]);
    assert_eq!(out.read_dir().unwrap().count(), 1, "what was there stays");
}

#[tokio::test]
async fn nothing_is_written_into_a_package_because_it_would_not_verify_any_more() {
    let folder = tempfile::tempdir().unwrap();
    let made = package(folder.path()).await;
    let within = made.join("more/analysis");
    for command in ["merge", "analyse"] {
        let told = refused(&["study", command, text(&made), "--out", text(&within)]);
        assert!(told.contains("lies within") && told.contains("name another folder"), "{told}");
    }
    done(&["verify", text(&made)]);
}

#[test]
fn a_file_that_is_no_package_is_named_with_what_to_give_instead() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("joined.zip"), b"PK\x03\x04").unwrap();
    let refused = |arguments: &[&str]| {
        let output = command(arguments).current_dir(folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };

    let told = refused(&["study", "analyse", "joined.zip"]);
    assert!(told.contains("joined.zip is not a package of a study") && told.contains("unpack a ZIP file"), "{told}");
    let told = refused(&["study", "merge", "joined.zip", "--out", "x"]);
    assert!(told.contains("joined.zip is neither the export") && told.contains("unpack a ZIP file"), "{told}");
    let told = refused(&["study", "analyse", "joint"]);
    assert!(told.contains("there is no package 'joint' here") && told.contains("--data-dir"), "{told}");
}
