//! Consent before a session, and withdrawal after it.

use std::time::Duration;

use jiff::civil::date;
use parfocal_records::store::export::verify::verify;
use parfocal_records::store::export::{ExportError, export};
use parfocal_records::store::verify_database;
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::consent::{Consent, NewConsent};
use parfocal_trial::correction::{FieldChange, NewCorrection};
use parfocal_trial::phase::Phase;
use parfocal_trial::role::Role;

use crate::exports::{failed, rows, with_session};
use crate::fixture::{PARTICIPANT, Trial};
use crate::instruments::{begin, consent, with_instruments};

fn withdraw() -> Action {
    Action::Withdraw { reason: "wants no part in it any more".to_owned() }
}

#[tokio::test]
async fn a_session_starts_only_with_the_consent_that_its_protocol_requires() {
    let folder = tempfile::tempdir().unwrap();
    let trial = with_instruments(folder.path()).await;
    let session = trial.conductor.create(Role::Operator, PARTICIPANT, "instruments", None).await.unwrap();
    let refused = trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("version '2.1'")), "{refused}");
    assert_eq!(trial.view().phase, Phase::Ready);
    assert_eq!(trial.operator_view().consent_required.as_deref(), Some("2.1"));

    let record =
        async |by: Role, consent: Consent| trial.conductor.record_consent(by, NewConsent { session, consent }).await;
    let other = record(Role::Operator, Consent { text_version: "1.0".to_owned(), ..consent() }).await.unwrap_err();
    assert!(matches!(&other, ConductError::Invalid(text) if text.contains("requires version '2.1'")), "{other}");
    let future = record(Role::Operator, Consent { given_on: date(2026, 4, 1), ..consent() }).await.unwrap_err();
    assert!(matches!(&future, ConductError::Invalid(text) if text.contains("in the future")), "{future}");
    let surgeon = record(Role::Surgeon, consent()).await.unwrap_err();
    assert!(matches!(surgeon, ConductError::Forbidden(_)), "{surgeon}");

    record(Role::Operator, consent()).await.unwrap();
    record(Role::Operator, consent()).await.unwrap();
    assert_eq!(trial.store.reader().consents(session).await.unwrap().len(), 1, "the same again is the same");
    assert_eq!(trial.operator_view().consent, Some(consent()));

    // The consent is still known after a restart.
    drop(trial);
    let trial = with_instruments(folder.path()).await;
    trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
    assert_eq!(trial.view().phase, Phase::Notice);

    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    assert_eq!(failed(&verify(&out, None)), [""; 0], "{:?}", verify(&out, None));
    let told = rows(&out, "consents");
    let [row] = told.as_slice() else { panic!("{told:?}") };
    let cells = ["text_version", "given_on", "obtained_by", "medium", "role"].map(|column| row[column].as_str());
    assert_eq!(cells, ["2.1", "2026-03-01", "KM", "paper", "operator"]);
    trial.store.close().await;

    let database = folder.path().join("parfocal.db");
    for sql in ["UPDATE consents SET text_version = '2.0'", "UPDATE consents SET obtained_by = 'XX'"] {
        let checks = crate::chain::after(&database, sql, None).await;
        assert!(crate::chain::said(&checks, "chain").unwrap_err().contains("consents: consent 1 was changed"), "{sql}");
    }
}

#[tokio::test]
async fn a_consent_of_today_is_taken_however_far_the_theatre_is_ahead_of_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let trial = with_instruments(folder.path()).await;
    let session = trial.conductor.create(Role::Operator, PARTICIPANT, "instruments", None).await.unwrap();
    // 1 March, 11:00 UTC: 2 March has begun where days begin first, 14 hours ahead.
    trial.clock.advance(Duration::from_hours(2));

    let record = async |day: i8| {
        let consent = Consent { given_on: date(2026, 3, day), ..consent() };
        trial.conductor.record_consent(Role::Operator, NewConsent { session, consent }).await
    };
    assert!(record(3).await.unwrap_err().to_string().contains("in the future"));
    record(2).await.unwrap();
}

#[tokio::test]
async fn a_withdrawn_session_is_in_no_export_but_its_place_is_listed_and_the_chain_stays_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, session) = with_session(folder.path()).await;
    trial.unblind(session).await;
    let before = folder.path().join("before");
    export(&trial.access_log(), session, &before, true).await.unwrap();

    trial.conductor.act(Role::Researcher, session, withdraw()).await.unwrap();
    trial.conductor.act(Role::Researcher, session, withdraw()).await.unwrap();
    for unblinded in [false, true] {
        let out = folder.path().join("after");
        let refused = export(&trial.access_log(), session, &out, unblinded).await.unwrap_err();
        assert!(matches!(&refused, ExportError::Withdrawn { by: "researcher", .. }), "{refused}");
        assert!(!out.exists());
    }

    let detail = trial.reports.session_detail(session).await.unwrap();
    assert!(detail.line.withdrawn);
    assert_eq!(detail.withdrawal.unwrap().reason, "wants no part in it any more");
    let withdrawals = detail.log.iter().filter(|line| line.text.starts_with("Withdrawn: ")).count();
    assert_eq!(withdrawals, 1, "the second time changes nothing");

    // The export of a later session with the same protocol mentions the withdrawal. With another protocol it does not.
    let later = trial.whole_session("paper").await;
    let out = folder.path().join("later");
    export(&trial.access_log(), later, &out, false).await.unwrap();
    assert_eq!(failed(&verify(&out, None)), [""; 0], "{:?}", verify(&out, None));
    let told = rows(&out, "withdrawals");
    let [row] = told.as_slice() else { panic!("{told:?}") };
    assert_eq!((row["session"].clone(), row["place"].as_str()), (session.to_string(), "1"));
    assert_eq!(row["role"], "researcher");
    for file in std::fs::read_dir(&out).unwrap() {
        let path = file.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(!text.contains("wants no part"), "{}", path.display());
    }
    let practice = trial.whole_session("practice").await;
    let out = folder.path().join("practice");
    export(&trial.access_log(), practice, &out, false).await.unwrap();
    assert_eq!(rows(&out, "withdrawals").len(), 0);

    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert_eq!(failed(&verify(&before, None)), [""; 0], "an export made before still verifies");
}

#[tokio::test]
async fn what_was_said_in_a_withdrawn_session_is_shown_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(folder.path()).await;
    trial.unblind(session).await;
    trial.conductor.add_participant(Role::Researcher, "S-02").await.unwrap();
    let before = trial.reports.session_detail(session).await.unwrap();
    let answer = before.answers.iter().find(|answer| answer.question == "sharpness").unwrap();
    let note = |text: &str| FieldChange::Note { record: answer.key, old: String::new(), new: text.to_owned() };
    let correct = async |change: FieldChange| {
        let correction = NewCorrection { change, reason: "for the analysis".to_owned() };
        trial.conductor.correct(Role::Researcher, session, correction).await
    };
    correct(note("a sharp word")).await.unwrap();
    let participant = FieldChange::Participant { old: PARTICIPANT.to_owned(), new: "S-02".to_owned() };
    correct(participant).await.unwrap();

    trial.conductor.act(Role::Researcher, session, withdraw()).await.unwrap();
    let after = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(after.answers, []);
    let told: Vec<&str> = after.corrections.iter().map(|correction| correction.about.as_str()).collect();
    assert_eq!(told, ["Participant"], "whose session it was, and no note");
    let withdrawal = after.withdrawal.as_ref().unwrap();
    assert_eq!(
        (withdrawal.by, withdrawal.words_left),
        (Role::Researcher, 6 + 7 + 1),
        "comments, answers in words, a note"
    );

    // The detail contains nothing that the surgeon said, but everything that was done to the session.
    let [before_json, json] = [&before, &after].map(|detail| serde_json::to_string(detail).unwrap());
    assert!(before_json.contains("fine 👍"));
    for text in ["a sharp word", "sharpness", "fine 👍"] {
        assert!(!json.contains(text), "{text} in {json}");
    }
    assert_eq!(after.log.len(), before.log.len() + 3, "a note, a correction, the withdrawal");

    let refused = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("the participant withdrew")), "{refused}");
    let refused = trial.reports.to_play(Role::Researcher, session).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("the participant withdrew")), "{refused}");
    let refused = correct(note("another")).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("the participant withdrew")), "{refused}");

    // A withdrawal belongs to a participant, so the participant can still be corrected.
    let back = FieldChange::Participant { old: "S-02".to_owned(), new: PARTICIPANT.to_owned() };
    correct(back).await.unwrap();
}

#[tokio::test]
async fn a_session_under_way_is_aborted_before_it_is_withdrawn_and_no_surgeon_withdraws() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = with_instruments(folder.path()).await;
    let session = begin(&trial).await;
    let refused = trial.conductor.act(Role::Operator, session, withdraw()).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("abort it first")), "{refused}");
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "left".to_owned() }).await.unwrap();
    let refused = trial.conductor.act(Role::Surgeon, session, withdraw()).await.unwrap_err();
    assert!(matches!(refused, ConductError::Forbidden(_)), "{refused}");
    let no_reason = Action::Withdraw { reason: " ".to_owned() };
    let refused = trial.conductor.act(Role::Operator, session, no_reason).await.unwrap_err();
    assert!(matches!(refused, ConductError::Invalid(_)), "{refused}");

    trial.say("hard to judge").await;
    assert_eq!(trial.operator_view().latest_comments.len(), 1);
    trial.conductor.act(Role::Operator, session, withdraw()).await.unwrap();
    assert!(trial.operator_view().withdrawn);
    assert_eq!(trial.operator_view().latest_comments, [], "nor does the operator's page go on showing what was said");
}

#[tokio::test]
async fn what_a_tablet_still_holds_after_a_withdrawal_is_acknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("practice").await;
    let held = trial.comment("said before the withdrawal");
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "left".to_owned() }).await.unwrap();
    trial.conductor.act(Role::Operator, session, withdraw()).await.unwrap();
    trial.conductor.comment(held).await.unwrap();
    assert_eq!(trial.store.reader().comments(session).await.unwrap().len(), 1);
}
