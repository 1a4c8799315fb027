//! Instruments in a session: asked by a protocol, answered in parts, and scored in the export and on the researcher's
//! page.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use jiff::civil::date;
use parfocal_base::ids::SessionId;
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::verify;
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::consent::{Consent, Medium, NewConsent};
use parfocal_trial::protocol::Protocol;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::role::Role;

use crate::exports::{failed, rows};
use crate::fixture::{PARTICIPANT, Trial, known};

pub const PROTOCOL: &str = include_str!("../system/browser/instruments.toml");

/// Starts a server on `folder` that has the protocol with every instrument.
pub async fn with_instruments(folder: &Path) -> Trial {
    std::fs::write(folder.join("instruments.toml"), PROTOCOL).unwrap();
    Trial::start_with(folder, Some(folder), 7).await
}

pub fn consent() -> Consent {
    Consent {
        text_version: "2.1".to_owned(),
        given_on: date(2026, 3, 1),
        obtained_by: "KM".to_owned(),
        medium: Medium::Paper,
    }
}

/// Makes a session, records the consent, and starts it.
pub async fn begin(trial: &Trial) -> SessionId {
    let session = trial.conductor.create(Role::Operator, PARTICIPANT, "instruments", None).await.unwrap();
    trial.conductor.record_consent(Role::Operator, NewConsent { session, consent: consent() }).await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
    session
}

/// Inspects the current setting up to its questions.
async fn inspect(trial: &mut Trial) {
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.wait(Duration::from_secs(5)).await;
    trial.surgeon(Action::FinishSegment { segment }).await;
}

fn points(points: &[u8]) -> AnswerValue {
    AnswerValue::Points(points.to_vec())
}

/// The scores of an export, by question, setting and measure.
fn scores(out: &Path) -> BTreeMap<(String, String, String), String> {
    let key =
        |row: &BTreeMap<String, String>| (row["question"].clone(), row["setting"].clone(), row["measure"].clone());
    rows(out, "scores").iter().map(|row| (key(row), row["value"].clone())).collect()
}

#[tokio::test]
async fn every_instrument_is_answered_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = with_instruments(folder.path()).await;
    let session = begin(&trial).await;

    inspect(&mut trial).await;
    trial.answer("effort", AnswerValue::Point(0)).await.unwrap();
    trial.answer("how-often", AnswerValue::Point(3)).await.unwrap();
    // One scale after the other, as the page sends them: ratings of 30, 15, 60, 40, 30 and 40.
    for (place, gradation) in [(0, 7), (1, 4), (2, 13), (3, 9), (4, 7), (5, 9)] {
        let mut items = [0; 6];
        items[place] = gradation;
        trial.answer("workload", points(&items)).await.unwrap();
    }
    let segment = trial.view().segment;
    trial.surgeon(Action::FinishQuestions { segment }).await;

    inspect(&mut trial).await;
    trial.answer("effort", AnswerValue::Point(100)).await.unwrap();
    trial.answer("how-often", AnswerValue::Point(5)).await.unwrap();
    trial.answer("workload", points(&[0, 21, 21, 21, 21, 21])).await.unwrap();
    let segment = trial.view().segment;
    let refused = trial.conductor.act(Role::Surgeon, session, Action::FinishQuestions { segment }).await.unwrap_err();
    assert!(refused.to_string().contains("still to be answered"), "a scale is open: {refused}");

    // A half-filled questionnaire survives a restart of the server.
    drop(trial);
    let mut trial = with_instruments(folder.path()).await;
    trial.conductor.act(Role::Surgeon, session, Action::Resume).await.unwrap();
    assert_eq!(trial.view().answers["workload"], points(&[0, 21, 21, 21, 21, 21]));
    let half = folder.path().join("half");
    export(&trial.access_log(), session, &half, false).await.unwrap();
    let told = scores(&half);
    let of =
        |setting: &str, measure: &str| told[&("workload".to_owned(), setting.to_owned(), measure.to_owned())].clone();
    assert_eq!((of("1", "mental-demand"), of("1", "temporal-demand")), ("30.0".to_owned(), "60.0".to_owned()));
    // 215 / 6.
    assert_eq!(of("1", "raw-tlx"), "35.833333333333336");
    assert_eq!((of("2", "mental-demand"), of("2", "effort")), (String::new(), "100.0".to_owned()));
    assert_eq!(of("2", "raw-tlx"), "", "missing stays missing");

    trial.answer("workload", points(&[21, 0, 0, 0, 0, 0])).await.unwrap();
    trial.answer("seen-before", AnswerValue::Point(3)).await.unwrap();
    let why = trial.view().questions.into_iter().find(|question| question.id == "seen-before-why").unwrap();
    assert_eq!((why.only_if_yes.as_deref(), why.optional), (Some("seen-before"), true));
    trial.answer("seen-before-why", AnswerValue::Text("it never moves".to_owned())).await.unwrap();
    trial.surgeon(Action::FinishQuestions { segment }).await;
    let earlier = [7, 4, 13, 9, 7, 9, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1];
    trial.answer("surgical-workload", points(&earlier)).await.unwrap();
    trial.answer("preference", points(&[1, 1])).await.unwrap();
    trial.surgeon(Action::FinishQuestions { segment: None }).await;

    let out = folder.path().join("out");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    assert_eq!(failed(&verify(&out, None)), [""; 0], "{:?}", verify(&out, None));
    let told = scores(&out);
    let of = |question: &str, setting: &str, measure: &str| {
        told[&(question.to_owned(), setting.to_owned(), measure.to_owned())].clone()
    };
    assert_eq!((of("effort", "1", "position"), of("effort", "2", "position")), ("0.0".to_owned(), "100.0".to_owned()));
    assert_eq!(of("how-often", "1", "point"), "3.0");
    assert_eq!(of("workload", "2", "raw-tlx"), "100.0");
    assert_eq!(of("seen-before", "2", "recognised"), "3.0");
    assert!(!told.keys().any(|(question, setting, _)| question == "seen-before" && setting == "1"), "not answered");
    // (5*30 + 4*15 + 3*60 + 2*40 + 1*30 + 0*40) / 15.
    assert_eq!(of("surgical-workload", "", "weighted-surg-tlx"), "33.333333333333336");
    assert_eq!(of("surgical-workload", "", "weight-of-mental-demands"), "5.0");
    assert_eq!(
        (of("preference", "", "rank-of-setting-1"), of("preference", "", "rank-of-setting-2")),
        ("1.5".to_owned(), "1.5".to_owned())
    );

    let detail = trial.reports.session_detail(session).await.unwrap();
    let words = |question: &str, setting: Option<usize>| {
        let line = detail.answers.iter().find(|line| line.question == question && line.setting == setting).unwrap();
        line.words.clone()
    };
    assert_eq!(words("how-often", Some(1)), "3 (Sometimes)");
    assert_eq!(words("seen-before", Some(2)), "Yes");
    assert_eq!(words("seen-before-why", Some(2)), "it never moves");
    assert!(words("workload", Some(1)).starts_with("Mental demand 30, Physical demand 15"), "{detail:?}");
}

#[tokio::test]
async fn answers_that_no_instrument_takes_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = with_instruments(folder.path()).await;
    begin(&trial).await;
    inspect(&mut trial).await;
    for (question, wrong, said) in [
        ("effort", AnswerValue::Point(101), "from 0 to 100"),
        ("effort", points(&[50]), "from 0 to 100"),
        ("how-often", AnswerValue::Point(6), "from 1 to 5"),
        ("workload", points(&[22, 1, 1, 1, 1, 1]), "6 gradations from 1 to 21"),
        ("workload", points(&[1; 5]), "6 gradations"),
        ("workload", points(&[0; 6]), "6 gradations"),
        ("seen-before", AnswerValue::Point(4), "3 for yes"),
        ("seen-before", AnswerValue::Text("yes".to_owned()), "3 for yes"),
    ] {
        let refused = trial.answer(question, wrong.clone()).await.unwrap_err();
        assert!(matches!(&refused, ConductError::Invalid(text) if text.contains(said)), "{wrong:?}: {refused}");
    }
}

/// The error from parsing the protocol with `from` replaced by `to`.
fn fault(from: &str, to: &str) -> String {
    assert!(PROTOCOL.contains(from), "{from}");
    Protocol::parse(&PROTOCOL.replace(from, to), "trial.toml", &known()).unwrap_err().to_string()
}

#[test]
fn a_protocol_with_a_wrong_instrument_is_refused_with_line_and_key() {
    for (from, to, said) in [
        ("ties = true", "ties = 2", "key 'ties'"),
        ("weighted = true", "ties = true", "key 'ties': this kind of question does not have this key"),
        ("low = \"Not at all\"\n", "", "key 'low': a 'visual-analogue' question needs it"),
        ("kind = \"nasa-tlx\"", "kind = \"nasa-tlx\"\nweighted = true", "key 'weighted'"),
        ("kind = \"nasa-tlx\"", "kind = \"ranking\"", "in [[closing]] only"),
        ("\"Never\", ", "\"Never\", \"mgm-learned\", ", "surgeons must not know"),
        ("[\"Never\", \"Rarely\", \"Sometimes\", \"Often\", \"Always\"]", "[\"Never\"]", "2 to 9 labels, not 1"),
        ("kind = \"likert\"", "kind = \"likert\"\npoints = 5", "not allowed together with 'labels'"),
        ("consent_version = \"2.1\"", "consent_version = \" \"", "key 'consent_version'"),
        ("kind = \"recognition\"", "kind = \"recognise\"", "key 'kind'"),
        ("id = \"remarks\"", "id = \"seen-before-why\"", "'seen-before-why' is used twice"),
    ] {
        let fault = fault(from, to);
        assert!(fault.starts_with("trial.toml, line ") && fault.contains(said), "{to}: {fault}");
    }
}
