//! The analysis of a package: that of one site's package is that of its database, digit by digit, and that of a joined
//! package has all surgeons and each site beside them.

use std::path::{Path, PathBuf};
use std::process::Command;

use parfocal_trial::correction::{FieldChange, NewCorrection};
use parfocal_trial::erasure::{Erasable, NewErasure};
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::voice::{Ending, NewPiece};
use serde_json::{Value, json};

use super::program::{command, done, refused, text};
use super::*;
use crate::exports::rows;

const RATED: &str = r#"
name = "rated"
title = "Comparison of focus settings"
researcher_title = "Three policies, rated"
policies = ["fixed", "mgm-hill-climber", "mlr-hill-climber"]
repeats = 2
order = "shuffled"
segment_seconds = 60
voice = true

[[after_segment]]
id = "sharp"
kind = "likert"
text = "How sharp was the picture?"
points = 7
low = "blurred"
high = "sharp"
optional = true

[[after_segment]]
id = "why"
kind = "text"
text = "Why?"
optional = true

[[closing]]
id = "preference"
kind = "ranking"
text = "Rank the settings."
optional = true

[[closing]]
id = "usability"
kind = "sus"
text = "Usability"
optional = true
"#;

fn rated() -> Protocol {
    Protocol::parse(RATED, "rated.toml", &crate::fixture::known()).unwrap()
}

fn definition_of_three_sites() -> String {
    let site = |name: &str| format!("[[sites]]\nname = \"{name}\"\ntitle = \"{name}\"\nsurgeons = 9\nspares = 9\n");
    format!(
        "name = \"{STUDY}\"\ntitle = \"Three policies at three sites\"\norder = \"shuffled\"\n\
         aborted = \"next-spare\"\nwithdrawn = \"next-spare\"\nrepeated = \"refuse\"\n\
         when_used_up = \"Call the trial office.\"\nmay_unblind = [\"{STATISTICIAN}\"]\n\
         analysis = \"Friedman on sharpness\"\n[[protocols]]\nname = \"rated\"\nsha256 = \"{}\"\n{}{}{}",
        hex::encode(rated().sha256()),
        site("leeds"),
        site("london"),
        site("york"),
    )
}

/// A study at one site, which is under way.
struct Site {
    trial: Trial,
    site: &'static str,
}

impl Site {
    async fn open(folder: &Path, seed: u64, site: &'static str) -> Self {
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join("rated.toml"), RATED).unwrap();
        let trial = Trial::start_with(folder, Some(folder), seed).await;
        for number in 2..=9 {
            trial.conductor.add_participant(Role::Operator, &format!("S-0{number}")).await.unwrap();
        }
        trial.account("lead", AccountRole::Lead, "Dr Lead").await;
        let sites = vec![site.to_owned()];
        let planned = trial.conductor.plan_study(Role::Researcher, definition_of_three_sites(), sites, signed("plan"));
        planned.await.unwrap();
        change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
        Self { trial, site }
    }

    /// Runs a session of `surgeon`, whose ratings of the settings depend on `taste`.
    async fn session(&mut self, surgeon: &str, taste: u8) -> SessionId {
        let place = StudyPlace { study: STUDY.to_owned(), site: self.site.to_owned() };
        let made = self.trial.conductor.create(Role::Operator, surgeon, "rated", Some(place));
        let session = made.await.unwrap();
        self.trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
        for setting in 0..6_u8 {
            let segment = self.trial.view().segment.unwrap();
            self.trial.surgeon(Action::Acknowledge { segment }).await;
            self.trial.say(&format!("{surgeon} sees setting {setting}, =1+1")).await;
            self.trial.surgeon(Action::FinishSegment { segment }).await;
            // One surgeon leaves one rating out.
            if (taste, setting) != (3, 4) {
                let point = AnswerValue::Point(1 + (taste * 5 + setting * 3) % 7);
                self.trial.answer("sharp", point).await.unwrap();
            }
            self.trial.answer("why", AnswerValue::Text("haze".to_owned())).await.unwrap();
            self.trial.surgeon(Action::FinishQuestions { segment: Some(segment) }).await;
        }
        self.trial.answer_all().await;
        self.trial.surgeon(Action::FinishQuestions { segment: None }).await;
        self.trial.conductor.dismiss(Role::Operator, session).unwrap();
        session
    }

    /// Makes what the report must tell apart: an aborted and a withdrawn session, a corrected code and a corrected
    /// rating, and erased words.
    async fn complicate(&mut self) {
        let place = StudyPlace { study: STUDY.to_owned(), site: self.site.to_owned() };
        let aborted = self.trial.conductor.create(Role::Operator, "S-07", "rated", Some(place)).await.unwrap();
        let abort = Action::Abort { reason: "the light failed".to_owned() };
        self.trial.conductor.act(Role::Operator, aborted, abort).await.unwrap();
        self.trial.conductor.dismiss(Role::Operator, aborted).unwrap();

        let withdrawn = self.session("S-08", 5).await;
        change(&self.trial, Change::Withdraw { session: withdrawn }).await.unwrap();

        let session = self.session("S-09", 6).await;
        let reader = self.trial.store.reader().clone();
        let answers = reader.answers(session).await.unwrap();
        let (_, answer) = answers.iter().find(|(_, answer)| answer.question == "sharp").unwrap();
        let new = AnswerValue::Point(if answer.value == AnswerValue::Point(1) { 2 } else { 1 });
        let value = FieldChange::Value { record: answer.key, old: answer.value.clone(), new };
        let code = FieldChange::Participant { old: "S-09".to_owned(), new: "S-06".to_owned() };
        for change in [value, code] {
            let correction = NewCorrection { change, reason: "typed wrongly".to_owned() };
            self.trial.conductor.correct(Role::Researcher, session, correction).await.unwrap();
        }

        let (_, comment) = reader.comments(session).await.unwrap().remove(2);
        let reason = "names a patient".to_owned();
        let erasure = NewErasure { subject: Erasable::Comment, record: comment.key.to_string(), reason };
        self.trial.conductor.erase(Role::Researcher, session, erasure).await.unwrap();
    }

    async fn unblinded(self) {
        to_the_end(&self.trial).await;
        self.trial.store.close().await;
    }
}

fn exported(data: &Path, out: &Path) {
    done(&["export", "--study", STUDY, "--unblinded", "--data-dir", text(data), "--out", text(out)]);
}

fn of_database(data: &Path) -> Value {
    serde_json::from_str(&done(&["study", "analyse", STUDY, "--data-dir", text(data), "--json"])).unwrap()
}

fn of_package(package: &Path) -> Value {
    serde_json::from_str(&done(&["study", "analyse", text(package), "--json"])).unwrap()
}

/// Two sites with servers of their own, which both have a surgeon S-02, and their joined package.
async fn two_sites(folder: &Path) -> [PathBuf; 3] {
    let [leeds_data, london_data, joined] = ["leeds-data", "london-data", "joined"].map(|name| folder.join(name));
    let mut leeds = Site::open(&leeds_data, 5, "leeds").await;
    for (surgeon, taste) in [("S-02", 1), ("S-03", 2), ("S-04", 3)] {
        leeds.session(surgeon, taste).await;
    }
    leeds.complicate().await;
    leeds.unblinded().await;
    let mut london = Site::open(&london_data, 6, "london").await;
    for (surgeon, taste) in [("S-02", 4), ("S-05", 5)] {
        london.session(surgeon, taste).await;
    }
    london.unblinded().await;

    let [leeds, london] = ["leeds", "london"].map(|name| folder.join(name));
    exported(&leeds_data, &leeds);
    exported(&london_data, &london);
    done(&["study", "merge", text(&london), text(&leeds), "--out", text(&joined)]);
    [leeds, london, joined]
}

/// The analysis without the surgeons' names, as text.
fn without_names(value: &Value) -> String {
    value.to_string().replace("S-02 (leeds)", "S-02").replace("S-02 (london)", "S-02")
}

#[tokio::test]
async fn a_package_is_analysed_like_its_database_and_a_joined_one_has_all_surgeons_and_each_site() {
    let folder = tempfile::tempdir().unwrap();
    let [leeds, london, joined] = two_sites(folder.path()).await;

    // A site's package says the same as its database, digit by digit.
    let [of_leeds, of_london] = [&leeds, &london].map(|package| of_package(package));
    assert_eq!(of_leeds, of_database(&folder.path().join("leeds-data")));
    assert_eq!(of_london, of_database(&folder.path().join("london-data")));
    assert_eq!(of_leeds["missing_sites"], json!(["london", "york"]));
    let remarks: Vec<&Value> =
        of_leeds["protocols"][0]["sessions"].as_array().unwrap().iter().map(|line| &line["remark"]).collect();
    let none = Value::Null;
    assert_eq!(remarks, [&none, &none, &none, &json!("aborted"), &none, &json!("withdrawn")]);

    // The joined package has all of them.
    let all = of_package(&joined);
    let protocol = &all["protocols"][0];
    assert_eq!((&all["sites"], &all["missing_sites"]), (&json!(["leeds", "london"]), &json!(["york"])));
    assert_eq!(protocol["surgeons"], 6, "four of Leeds and two of London, of whom two have the same code");
    let notes = all["notes"].to_string();
    assert!(notes.contains("No session of 1 site is here: york.") && notes.contains("same codes"), "{notes}");
    assert!(protocol["words"].to_string().contains("S-02 (london)"));

    let values = |analysis: &Value| -> Vec<f64> {
        let values = analysis["protocols"][0]["values"].as_array().unwrap();
        let sharp = values.iter().filter(|value| value["outcome"] == "sharp/point" && value["policy"] == "fixed");
        sharp.filter_map(|value| value["value"].as_f64()).collect()
    };
    let both = [values(&of_leeds), values(&of_london)].concat();
    assert_eq!(values(&all), both);
    let fixed = &protocol["outcomes"][0]["policies"][0];
    assert_eq!(fixed["n"], both.len());
    assert!((fixed["mean"].as_f64().unwrap() - both.iter().sum::<f64>() / both.len() as f64).abs() < 1e-12);
    assert_eq!(protocol["outcomes"][0]["complete"], 5, "one surgeon has a missing value");

    // Beside them, each site has the figures that it has alone.
    let sites = protocol["by_site"].as_array().unwrap();
    for (site, alone) in sites.iter().zip([&of_leeds, &of_london]) {
        for part in ["outcomes", "whole_sessions"] {
            assert_eq!(without_names(&site[part]), without_names(&alone["protocols"][0][part]), "{}", site["site"]);
        }
    }
    assert_eq!((&sites[0]["site"], &sites[1]["site"]), (&json!("leeds"), &json!("london")));
}

#[tokio::test]
async fn a_package_names_a_protocol_of_which_every_session_was_withdrawn() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    std::fs::create_dir_all(&data).unwrap();
    let second = PROTOCOL.replace("name = \"pair\"", "name = \"second\"");
    std::fs::write(data.join("second.toml"), &second).unwrap();
    let hash = hex::encode(Protocol::parse(&second, "second.toml", &crate::fixture::known()).unwrap().sha256());

    let mut trial = a_trial(&data).await;
    let listed = format!("[[protocols]]\nname = \"second\"\nsha256 = \"{hash}\"\n\n[[sites]]\nname = \"leeds\"");
    plan(&trial, definition().replace("[[sites]]\nname = \"leeds\"", &listed)).await.unwrap();
    change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
    whole(&mut trial, "S-02", "leeds").await;

    let place = StudyPlace { study: STUDY.to_owned(), site: "leeds".to_owned() };
    let session = trial.conductor.create(Role::Operator, "S-03", "second", Some(place)).await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "tired".to_owned() }).await.unwrap();
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    change(&trial, Change::Withdraw { session }).await.unwrap();
    to_the_end(&trial).await;
    trial.store.close().await;

    let package = folder.path().join("package");
    exported(&data, &package);
    let notes = of_package(&package)["notes"].to_string();
    assert!(notes.contains("Every session of these protocols was withdrawn: second."), "{notes}");
    assert!(!notes.contains("No session of these protocols"), "{notes}");
}

#[tokio::test]
async fn the_report_and_the_folder_of_a_package_have_each_site_and_need_no_database() {
    let folder = tempfile::tempdir().unwrap();
    let [_, _, joined] = two_sites(folder.path()).await;
    for data in ["leeds-data", "london-data"] {
        std::fs::remove_dir_all(folder.path().join(data)).unwrap();
    }

    let out = folder.path().join("analysis");
    let printed = done(&["study", "analyse", text(&joined), "--out", text(&out)]);
    for said in [
        "sites: leeds, london",
        "  at leeds: 4 surgeons, 4 sessions",
        "  at london: 2 surgeons, 2 sessions",
        "): aborted.\nSession at leeds (",
    ] {
        assert!(printed.contains(said), "{said} is not in {printed}");
    }

    let by_site = rows(&out, "analysis_sites");
    let sharp: Vec<_> = by_site.iter().filter(|row| row["outcome"] == "sharp/point").collect();
    assert_eq!(sharp.len(), 6, "three policies at two sites");
    assert!(
        sharp.iter().all(|row| row["n"] == if row["site"] == "leeds" { "8" } else { "4" } || row["missing"] == "1")
    );
    let whole: Value = serde_json::from_slice(&std::fs::read(out.join("analysis.json")).unwrap()).unwrap();
    assert_eq!(whole, of_package(&joined));
    for name in ["figure-rated-sharp-point.svg", "figure-rated-sharp-point-at-leeds.svg"] {
        assert!(out.join(name).is_file(), "{name}");
    }
}

/// A recording that does not state its duration, as browsers make it; `None` without ffmpeg.
fn recorded(folder: &Path) -> Option<Vec<u8>> {
    let file = folder.join("live.webm");
    let sound = ["-v", "error", "-f", "lavfi", "-i", "sine=frequency=440:duration=3.5"];
    let form = ["-c:a", "libopus", "-b:a", "24k", "-f", "webm", "-live", "1"];
    let made = Command::new("ffmpeg").args(sound).args(form).arg(&file).status();
    made.is_ok_and(|status| status.success()).then(|| std::fs::read(file).unwrap())
}

/// What a player says of how long a recording is, in seconds.
fn duration(file: &Path) -> Option<f64> {
    let asked = ["-v", "error", "-show_entries", "format=duration", "-of", "default=nw=1:nk=1"];
    let output = Command::new("ffprobe").args(asked).arg(file).output().unwrap();
    String::from_utf8(output.stdout).unwrap().trim().parse().ok()
}

#[tokio::test]
async fn a_packages_recordings_state_their_duration_and_the_exports_keep_theirs_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let Some(sound) = recorded(folder.path()) else {
        println!("skipped: no ffmpeg to make a recording with");
        return;
    };

    let data = folder.path().join("data");
    let mut site = Site::open(&data, 5, "leeds").await;
    let session = site.session("S-02", 1).await;
    let place = StudyPlace { study: STUDY.to_owned(), site: "leeds".to_owned() };
    let spoken = site.trial.conductor.create(Role::Operator, "S-03", "rated", Some(place)).await.unwrap();
    site.trial.conductor.act(Role::Operator, spoken, Action::Start).await.unwrap();
    let mut comment = site.trial.comment("");
    comment.said = CommentContent::Voice;
    site.trial.conductor.comment(comment.clone()).await.unwrap();
    let piece = NewPiece {
        comment: comment.key,
        session: spoken,
        piece: 1,
        media_type: "audio/webm;codecs=opus".to_owned(),
        through_ms: 3500,
        ended: Some(Ending::Released),
        audio: sound.clone(),
    };
    site.trial.conductor.voice_piece(piece).await.unwrap();
    let abort = Action::Abort { reason: "enough".to_owned() };
    site.trial.conductor.act(Role::Operator, spoken, abort).await.unwrap();
    site.trial.conductor.dismiss(Role::Operator, spoken).unwrap();
    site.unblinded().await;

    let package = folder.path().join("package");
    exported(&data, &package);
    assert!(package.join("sessions").join(session.to_string()).is_dir());
    let file = format!("voice/{}.webm", comment.key);
    let original = package.join("sessions").join(spoken.to_string()).join(&file);
    assert!(std::fs::read(&original).unwrap() == sound);
    assert_eq!(duration(&original), None);
    let stated = duration(&package.join(&file)).unwrap();
    assert!((stated - 3.5).abs() < 0.05, "{stated}");
    assert!(done(&["verify", text(&package)]).contains("joining the exports again makes the same tables"));
}

#[tokio::test]
async fn a_package_that_is_changed_blinded_or_none_is_not_analysed() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut site = Site::open(&data, 5, "leeds").await;
    let session = site.session("S-02", 1).await;

    // Unblinded alone, before the study: its export has policies, and the study is still blinded.
    let signature = Signature::new("Dr Ward", "an emergency").unwrap();
    site.trial.conductor.unblind_in_emergency(Role::Researcher, session, signature, true).await.unwrap();
    let before = folder.path().join("before");
    exported(&data, &before);
    let said = refused(&["study", "analyse", text(&before)]);
    assert!(said.contains("was exported while the study was open at site 'leeds'"), "{said}");

    site.unblinded().await;
    let blinded = folder.path().join("blinded");
    done(&["export", "--study", STUDY, "--data-dir", text(&data), "--out", text(&blinded)]);
    let said = refused(&["study", "analyse", text(&blinded)]);
    assert!(said.contains("does not contain the policies"), "{said}");

    let package = folder.path().join(STUDY);
    exported(&data, &package);
    // A name that is both a package here and a study of the database is refused.
    let analyse = |arguments: &[&str]| {
        let mut command = command(&["study", "analyse"]);
        let output = command.args(arguments).current_dir(folder.path()).output().unwrap();
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (succeeded, said) = analyse(&[STUDY]);
    assert!(!succeeded && said.contains("is a package here, and also a study"), "{said}");
    for arguments in [&[&*format!("./{STUDY}")][..], &[STUDY, "--data-dir", "data"]] {
        let (succeeded, said) = analyse(arguments);
        assert!(succeeded, "{arguments:?}: {said}");
    }
    let (succeeded, said) = analyse(&["./data"]);
    assert!(!succeeded && said.contains("is not a package of a study"), "{said}");

    let comments = package.join("sessions").join(session.to_string()).join("comments.csv");
    let kept = std::fs::read_to_string(&comments).unwrap();
    std::fs::write(&comments, kept.replace("sees setting 3", "sees setting 4")).unwrap();
    let said = refused(&["study", "analyse", text(&package)]);
    assert!(said.contains("it does not verify") && said.contains("comments.csv was changed"), "{said}");
}
