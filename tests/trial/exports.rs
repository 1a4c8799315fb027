//! Exports and their verification. The tests read exports with other code than the code that wrote them.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::Duration;

use futures_util::TryStreamExt;
use parfocal_base::clock::Clock;
use parfocal_base::ids::SessionId;
use parfocal_base::step::{Hold, StepRecord};
use parfocal_records::store::export::verify::{Check, Verdict, verify};
use parfocal_records::store::export::{Export, ExportError, ZipStream, export};
use parfocal_records::store::{AccessLog, DeviceEvent, Reader, telemetry};
use parfocal_trial::action::Action;
use parfocal_trial::role::Role;
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::fixture::Trial;
use crate::storage::step;

/// Starts a server with one complete session that has telemetry.
pub async fn with_session(folder: &Path) -> (Trial, SessionId) {
    let mut trial = Trial::start(folder).await;
    let session = trial.begin("paper").await;
    let (sender, receiver) = tokio::sync::mpsc::channel(1024);
    let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));
    for setting in 0..6 {
        let segment = trial.whole_setting().await;
        for frame in 1..=10 {
            sender.send(step(setting * 10 + frame, Some(segment))).await.unwrap();
        }
    }

    drop(sender);
    writer.await.unwrap();
    trial.answer_all().await;
    trial.surgeon(Action::FinishQuestions { segment: None }).await;
    (trial, session)
}

pub fn rows(folder: &Path, table: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(folder.join(format!("{table}.csv"))).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

pub fn json(folder: &Path, file: &str) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join(file)).unwrap()).unwrap()
}

fn files(folder: &Path) -> BTreeSet<String> {
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

/// Whether `file` differs between two exports of a session, because each export is recorded.
fn tells_of_the_export(file: &str) -> bool {
    ["SHA256SUMS", "datapackage.json", "accesses.csv", "chain.csv", "session.json"].contains(&file)
}

pub fn failed(checks: &[Check]) -> Vec<&str> {
    checks.iter().filter(|check| matches!(check.verdict, Verdict::Failed(_))).map(|check| check.name).collect()
}

pub fn is_its_owners_alone(folder: &Path) -> bool {
    folder.metadata().unwrap().permissions().mode() & 0o777 == 0o700
}

#[tokio::test]
async fn a_blinded_export_holds_everything_but_the_policies() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    let out = data.path().join("export");
    let summary = export(&trial.access_log(), session, &out, false).await.unwrap();
    assert_eq!(files(&out), summary.files.iter().cloned().collect());
    assert!(is_its_owners_alone(&out), "no other account of the machine may read what was said");

    // The blur rate of the optics that the policies were given.
    assert_eq!(rows(&out, "runs")[0]["blur"], "6.2");
    let comments = rows(&out, "comments");
    assert_eq!(comments.len(), 6);
    assert_eq!(comments[1]["text"], "setting 2 🔬 \"quoted\", and\na second line");
    assert_eq!((comments[1]["setting"].as_str(), comments[1]["frame"].as_str()), ("2", "1234"));
    let answers = rows(&out, "answers");
    assert_eq!(answers.len(), 27);
    let sus = answers.iter().find(|answer| answer["kind"] == "sus").unwrap();
    assert_eq!((sus["value"].as_str(), sus["sus_score"].as_str()), ("[4,2,3,1,4,3,2,2,4,2]", "67.5"));
    let telemetry = rows(&out, "telemetry");
    assert_eq!(telemetry.len(), 60);
    assert_eq!((telemetry[15]["asked"].as_str(), telemetry[15]["setting"].as_str()), ("0.35", "2"));
    assert_eq!(rows(&out, "segments")[5]["inspected_seconds"], "20.0");
    let kinds: Vec<String> = rows(&out, "events").into_iter().map(|event| event["kind"].clone()).collect();
    // Created, started, three for each of six settings, closing questions done, completed.
    assert_eq!(kinds.len(), 2 + 6 * 3 + 2);
    assert_eq!(json(&out, "session.json")["comments"][1]["text"], comments[1]["text"].as_str());

    // The protocol must name the compared policies. No other file names any.
    for file in files(&out).iter().filter(|file| *file != "protocol.toml") {
        let text = std::fs::read_to_string(out.join(file)).unwrap();
        for tell in ["mgm", "cnn", "hill-climber", "12.5"] {
            assert!(!text.contains(tell), "{file} has '{tell}'");
        }
    }
}

#[tokio::test]
async fn a_blinded_export_tells_no_hold_for_the_policys_sake() {
    let data = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(data.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.whole_setting().await;
    let (sender, receiver) = tokio::sync::mpsc::channel(16);
    let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));
    let holds = [
        None,
        Some(Hold::PolicySlow),
        Some(Hold::PolicyPanicked),
        Some(Hold::PolicyNonsense),
        Some(Hold::PolicyUnavailable),
        Some(Hold::Paused),
        Some(Hold::LensFailed),
        Some(Hold::CameraFailed),
    ];

    for (held, frame) in holds.into_iter().zip(1..) {
        sender.send(StepRecord { held, ..step(frame, Some(segment)) }).await.unwrap();
    }
    drop(sender);
    writer.await.unwrap();
    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let held: Vec<_> = rows(&out, "telemetry").iter().map(|row| row["held"] == "true").collect();
    assert_eq!(held, [false, false, false, false, false, true, true, true]);
}

#[tokio::test]
async fn every_file_has_its_checksum_and_every_column_its_description() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    trial.unblind(session).await;
    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, true).await.unwrap();

    let sums = std::fs::read_to_string(out.join("SHA256SUMS")).unwrap();
    let listed: BTreeMap<&str, &str> =
        sums.lines().map(|line| line.split_once("  ").unwrap()).map(|(s, f)| (f, s)).collect();
    assert_eq!(listed.len() + 1, files(&out).len());
    for (file, sum) in &listed {
        assert_eq!(&hex::encode(Sha256::digest(std::fs::read(out.join(file)).unwrap())), sum, "{file}");
    }

    let package = json(&out, "datapackage.json");
    let mut described = BTreeSet::new();
    for resource in package["resources"].as_array().unwrap() {
        let path = resource["path"].as_str().unwrap();
        assert_eq!(resource["hash"], format!("sha256:{}", listed[path]));
        let fields = resource["schema"]["fields"].as_array().unwrap();
        let mut reader = csv::Reader::from_path(out.join(path)).unwrap();
        let names: Vec<&str> = fields.iter().map(|field| field["name"].as_str().unwrap()).collect();
        assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), names, "{path}");
        assert!(fields.iter().all(|field| field["description"].as_str().is_some_and(|text| text.len() > 3)), "{path}");
        described.insert(path.to_owned());
    }

    let csvs: BTreeSet<String> = files(&out).into_iter().filter(|file| file.contains(".csv")).collect();
    assert_eq!(described, csvs);
}

#[tokio::test]
async fn an_unblinded_export_adds_the_policies_and_changes_nothing_else() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    let refused = export(&trial.access_log(), session, &data.path().join("early"), true).await.unwrap_err();
    assert!(matches!(refused, ExportError::StillBlinded(_)), "{refused}");
    assert!(!data.path().join("early").exists());

    trial.unblind(session).await;
    let blinded = data.path().join("blinded");
    let unblinded = data.path().join("unblinded");
    export(&trial.access_log(), session, &blinded, false).await.unwrap();
    export(&trial.access_log(), session, &unblinded, true).await.unwrap();
    let more: Vec<String> = files(&unblinded).difference(&files(&blinded)).cloned().collect();
    assert_eq!(more, ["allocation.csv", "allocation.json", "chain_salts.csv", "policy_steps.csv", "weights.csv"]);
    for file in files(&blinded).iter().filter(|file| !tells_of_the_export(file)) {
        let read = |folder: &Path| std::fs::read(folder.join(file)).unwrap();
        assert!(read(&blinded) == read(&unblinded), "{file}");
        // The reason for unblinding names a policy, so only the unblinded export has it.
        assert!(!String::from_utf8(read(&blinded)).unwrap().contains("CNN"), "{file}");
    }

    let steps = rows(&unblinded, "policy_steps");
    assert_eq!((steps.len(), steps[0]["metric"].as_str(), steps[0]["policy_micros"].as_str()), (60, "12.5", "17"));
    assert_eq!(json(&unblinded, "allocation.json")["unblinding_reason"], "the study is over; CNN won");
    assert_eq!(rows(&unblinded, "sessions")[0]["unblinded"], "after-end");
    // The weights of the two learned policies in the session, with the checksums of the shipped files.
    let sum = |name: &str| hex::encode(Sha256::digest(std::fs::read(format!("policies/{name}.safetensors")).unwrap()));
    let weights: Vec<_> =
        rows(&unblinded, "weights").into_iter().map(|row| (row["policy"].clone(), row["sha256"].clone())).collect();
    assert_eq!(weights, ["cnn-learned", "mgm-learned"].map(|name| (name.to_owned(), sum(name))));
}

#[tokio::test]
async fn an_export_never_overwrites_and_a_session_that_is_not_there_is_named() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    // As the command exports while the server runs.
    let access_log = AccessLog::open(data.path(), trial.clock.clone()).await.unwrap();
    let out = data.path().join("a/new/export");
    export(&access_log, session, &out, false).await.unwrap();
    let again = export(&access_log, session, &out, false).await.unwrap_err();
    assert!(matches!(again, ExportError::Exists(_)), "{again}");
    assert_eq!(files(&data.path().join("a/new")).len(), 1, "nothing half-written is left beside it");
    let nobody = "00000000-0000-4000-8000-000000000000".parse().unwrap();
    let unknown = export(&access_log, nobody, &data.path().join("x"), false).await.unwrap_err().to_string();
    assert!(unknown.contains(&session.to_string()), "{unknown}");
    drop(trial);
}

#[tokio::test]
async fn an_export_of_a_session_under_way_is_of_one_moment() {
    let data = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(data.path()).await;
    let session = trial.begin("paper").await;
    trial.whole_setting().await;
    let snapshot = Reader::open(data.path()).await.unwrap().snapshot().await.unwrap();
    trial.say("said while it is being exported").await;
    trial.whole_setting().await;
    let now = Reader::open(data.path()).await.unwrap();
    assert_eq!(snapshot.comments(session).await.unwrap().len(), 1);
    assert_eq!(now.comments(session).await.unwrap().len(), 3);
    assert_eq!(snapshot.events(session).await.unwrap().len(), 5, "created, started, three of the first setting");
    let one = data.path().join("one");
    let other = data.path().join("other");
    export(&trial.access_log(), session, &one, false).await.unwrap();
    assert_eq!(rows(&one, "comments").len(), 3, "each export takes a moment of its own");
    export(&trial.access_log(), session, &other, false).await.unwrap();
    assert_eq!(failed(&verify(&other, None)), [""; 0]);
}

#[tokio::test]
async fn the_pages_zip_is_the_commands_folder() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let (zip, bytes) = ZipStream::new(format!("parfocal-{session}"));
    let prepared = Export::prepare(&trial.access_log(), session, false).await.unwrap();
    let (written, bytes) = tokio::join!(prepared.into_zip(zip), bytes.try_collect::<Vec<_>>());
    written.unwrap();
    let archive = bytes.unwrap().concat();
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(archive)).unwrap();
    assert_eq!(archive.len(), files(&out).len());
    for file in files(&out).into_iter().filter(|file| !tells_of_the_export(file)) {
        let mut content = Vec::new();
        archive.by_name(&format!("parfocal-{session}/{file}")).unwrap().read_to_end(&mut content).unwrap();
        assert!(content == std::fs::read(out.join(&file)).unwrap(), "{file}");
    }
}

#[tokio::test]
async fn no_text_of_an_export_runs_as_a_formula_and_none_is_lost() {
    let data = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(data.path()).await;
    let session = trial.begin("paper").await;
    let said = ["=1+1", "-3 dioptres too far", "@once", "\t=tab", "'=quoted", "sharp = good", "'quoted'"];
    for text in said {
        trial.say(text).await;
    }
    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();

    let cells: Vec<_> = rows(&out, "comments").into_iter().map(|row| row["text"].clone()).collect();
    let expected = ["'=1+1", "'-3 dioptres too far", "'@once", "'\t=tab", "''=quoted", "sharp = good", "'quoted'"];
    assert_eq!(cells, expected);
    let told = json(&out, "session.json");
    let told: Vec<_> = told["comments"].as_array().unwrap().iter().map(|comment| &comment["text"]).collect();
    assert_eq!(told, said, "JSON has it as it was said");
    assert!(json(&out, "datapackage.json")["description"].as_str().unwrap().contains("apostrophe"));
    assert_eq!(failed(&verify(&out, None)), [""; 0]);

    // Text without its apostrophe is not what JSON and CSV say together.
    let comments = std::fs::read_to_string(out.join("comments.csv")).unwrap();
    std::fs::write(out.join("comments.csv"), comments.replace("'=1+1", "=1+1")).unwrap();
    assert_eq!(failed(&verify(&out, None)), ["checksums", "copies"]);
    std::fs::write(out.join("comments.csv"), comments.replace("'=1+1", "1+1")).unwrap();
    assert_eq!(failed(&verify(&out, None)), ["checksums", "copies", "chain"]);
}

#[tokio::test]
async fn an_emergency_unblinding_is_flagged_in_the_export() {
    let data = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(data.path()).await;
    let session = trial.begin("paper").await;
    trial.whole_setting().await;
    trial.unblind(session).await;
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "adverse event".to_owned() }).await.unwrap();
    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let row = &rows(&out, "sessions")[0];
    assert_eq!((row["unblinded"].as_str(), row["status"].as_str()), ("while-under-way", "aborted"));
    assert_eq!(json(&out, "datapackage.json")["parfocal"]["unblinded"], "while-under-way");
}

#[tokio::test]
async fn what_befalls_the_devices_stands_in_the_log_and_in_the_export() {
    let data = tempfile::tempdir().unwrap();
    let trial = Trial::start(data.path()).await;
    let befalls = async |working: bool, message: &str| {
        trial.clock.advance(Duration::from_secs(2));
        let wall = trial.clock.wall();
        let at = trial.clock.now();
        let device = "lens".to_owned();
        let event = DeviceEvent { wall, at, device, working, message: message.to_owned() };
        trial.store.device_event(&event).await.unwrap();
    };

    befalls(true, "follows commands").await;
    trial.wait(Duration::from_secs(1)).await;
    let session = trial.begin("paper").await;
    befalls(false, "the lens does not answer; trying again").await;
    befalls(true, "follows commands again").await;
    trial.wait(Duration::from_secs(1)).await;
    let abort = Action::Abort { reason: "the lens broke".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
    befalls(false, "unplugged when all was over").await;

    let log = trial.reports.session_detail(session).await.unwrap().log;
    let log: Vec<&str> = log.iter().map(|line| line.text.as_str()).collect();
    let expected = [
        "Session made",
        "Session started",
        "The lens: the lens does not answer; trying again",
        "The lens: follows commands again",
        "Session aborted: the lens broke",
    ];
    assert_eq!(log, expected);

    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let devices = rows(&out, "devices");
    let devices: Vec<_> = devices.iter().map(|row| (row["working"].as_str(), row["message"].as_str())).collect();
    let expected = [
        ("true", "follows commands"),
        ("false", "the lens does not answer; trying again"),
        ("true", "follows commands again"),
    ];

    assert_eq!(devices, expected, "with the state in which the session began, and nothing after its end");
    assert_eq!(failed(&verify(&out, None)), [""; 0]);
}
