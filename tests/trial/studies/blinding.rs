//! Blinding within a study: emergency unblinding of one session, and what nobody may learn too early.

use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::verify;
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::correction::{FieldChange, NewCorrection};
use parfocal_trial::erasure::{Erasable, NewErasure};
use parfocal_trial::event::EventKind;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::role::Role;
use serde_json::Value;

use super::*;
use crate::exports::{failed, json, rows};
use crate::fixture::PARTICIPANT;

async fn emergency(trial: &Trial, session: SessionId, reason: &str) -> Result<(), ConductError> {
    let signature = Signature::new("Dr Ward", reason).unwrap();
    trial.conductor.unblind_in_emergency(Role::Researcher, session, signature, true).await
}

#[tokio::test]
async fn one_session_is_unblinded_only_in_an_emergency_that_somebody_signs() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, PARTICIPANT, "leeds").await;

    let unsigned = Action::Unblind { reason: "curious".to_owned(), despite_outstanding: true };
    let refused = trial.conductor.act(Role::Researcher, session, unsigned).await.unwrap_err().to_string();
    assert!(refused.contains("the session belongs to study scope-2026") && refused.contains("say who"), "{refused}");
    let naming = emergency(&trial, session, "was it mgm-hill-climber?").await.unwrap_err().to_string();
    assert!(naming.contains("the reason names the policy 'mgm-hill-climber'"), "{naming}");
    let signature = Signature::new("Dr Ward", "bleeding").unwrap();
    let by_operator = trial.conductor.unblind_in_emergency(Role::Operator, session, signature, true).await;
    assert!(matches!(by_operator, Err(ConductError::Forbidden(_))), "{by_operator:?}");
    assert_eq!(detail(&trial).await.log.len(), 2);

    emergency(&trial, session, "an adverse event").await.unwrap();
    let study = detail(&trial).await;
    let last = study.log.last().unwrap();
    assert_eq!(
        (last.text.as_str(), last.person.as_str(), last.reason.as_str()),
        ("Emergency unblinding of the session of S-01", "Dr Ward", "an adverse event")
    );
    assert!(study.study_sessions[0].unblinded);

    let events = trial.store.reader().events(session).await.unwrap();
    let (_, event) = events.last().unwrap();
    assert!(matches!(event.kind, EventKind::Unblinded { emergency: true, .. }), "{event:?}");
}

/// An aborted session and the one that took its place have the same order, drawn from the same seed.
#[tokio::test]
async fn the_export_of_a_session_in_the_place_of_an_aborted_one_tells_the_seed_of_a_shuffled_order() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = PROTOCOL.replace("\"balanced\"", "\"shuffled\"");
    std::fs::write(folder.path().join("pair.toml"), &protocol).unwrap();
    let trial = Trial::start_with(folder.path(), Some(folder.path()), 5).await;
    trial.conductor.add_participant(Role::Operator, "S-02").await.unwrap();
    trial.account("lead", AccountRole::Lead, "Dr Lead").await;

    let sha256 = |protocol: &Protocol| hex::encode(protocol.sha256());
    let shuffled = Protocol::parse(&protocol, "pair.toml", &crate::fixture::known()).unwrap();
    let definition = definition().replace("\"balanced\"", "\"shuffled\"");
    let definition = definition.replace("aborted = \"next-spare\"", "aborted = \"same-place\"");
    let definition = definition.replace(&sha256(&super::protocol()), &sha256(&shuffled));
    plan(&trial, definition).await.unwrap();
    change(&trial, Change::Open { despite_concerns: true }).await.unwrap();

    aborted(&trial, PARTICIPANT, "leeds").await;
    let session = aborted(&trial, "S-02", "leeds").await;
    assert_eq!(detail(&trial).await.study_sessions[1].place, 1);
    emergency(&trial, session, "an adverse event").await.unwrap();

    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, true).await.unwrap();
    assert!(json(&out, "allocation.json")["seed"].is_string());
    assert_eq!(failed(&verify(&out, None)), [""; 0], "{:?}", verify(&out, None));
}

#[tokio::test]
async fn nobody_who_knows_a_policy_names_it_where_every_export_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, PARTICIPANT, "leeds").await;
    emergency(&trial, session, "an adverse event").await.unwrap();

    let close = async |reason: &str| {
        let signature = signed(reason);
        trial.conductor.change_study(Role::Researcher, STUDY.to_owned(), Change::Close, signature).await
    };
    let naming = close("setting 2 was mgm-hill-climber").await.unwrap_err().to_string();
    assert!(naming.contains("the reason names the policy 'mgm-hill-climber'"), "{naming}");
    close("an adverse event").await.unwrap();
}

#[tokio::test]
async fn notes_and_reasons_name_no_policy_while_a_session_alone_is_unblinded() {
    const NAMING: &str = "setting 2 was MGM-hill-climber";
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;

    let session = prepare(&trial, PARTICIPANT, "leeds").await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
    let mut spoken = trial.comment("");
    spoken.said = CommentContent::Voice;
    trial.conductor.comment(spoken.clone()).await.unwrap();
    for _ in 0..2 {
        trial.whole_setting().await;
    }
    trial.conductor.dismiss(Role::Operator, session).unwrap();

    let reader = trial.store.reader();
    let comments = reader.comments(session).await.unwrap();
    let written = comments.into_iter().map(|(_, comment)| comment.key).find(|key| *key != spoken.key).unwrap();
    let correct = async |record, old: &str, new: &str, reason: &str| {
        let change = FieldChange::Note { record, old: old.to_owned(), new: new.to_owned() };
        let correction = NewCorrection { change, reason: reason.to_owned() };
        trial.conductor.correct(Role::Researcher, session, correction).await
    };
    let erase = async |reason: &str| {
        let record = written.to_string();
        let erasure = NewErasure { subject: Erasable::Comment, record, reason: reason.to_owned() };
        trial.conductor.erase(Role::Researcher, session, erasure).await
    };
    correct(written, "", &format!("it seems that {NAMING}"), "a guess, nobody knows").await.unwrap();

    // It is another session's order that somebody knows now. It tells something of this one's.
    let other = prepare(&trial, "S-02", "leeds").await.unwrap();
    trial.conductor.act(Role::Operator, other, Action::Start).await.unwrap();
    trial.conductor.act(Role::Operator, other, Action::Pause { reason: String::new() }).await.unwrap();
    trial.conductor.act(Role::Operator, other, Action::Abort { reason: "bleeding".to_owned() }).await.unwrap();
    emergency(&trial, other, "an adverse event").await.unwrap();
    let event = trial.operator_view().reason_wanted.unwrap().event;
    let explain = async |reason: &str| {
        let action = Action::GiveReason { event, reason: reason.to_owned() };
        trial.conductor.act(Role::Operator, other, action).await
    };

    let old = format!("it seems that {NAMING}");
    let refused = [
        correct(written, &old, NAMING, "it is known").await,
        correct(written, &old, "known by now", NAMING).await,
        erase(NAMING).await,
        explain(NAMING).await,
    ];
    for refused in refused {
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("names the policy 'mgm-hill-climber', and every export shows"), "{refused}");
    }

    correct(spoken.key, "", &format!("I think that {NAMING}"), "transcribed").await.unwrap();
    correct(written, &old, "known by now", "it is known").await.unwrap();
    explain("bleeding").await.unwrap();
    trial.conductor.dismiss(Role::Operator, other).unwrap();
    erase("names a patient").await.unwrap();

    to_the_end(&trial).await;
    correct(spoken.key, &format!("I think that {NAMING}"), NAMING, NAMING).await.unwrap();
}

#[tokio::test]
async fn a_session_under_way_is_unblinded_in_an_emergency_and_continues() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = prepare(&trial, PARTICIPANT, "leeds").await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
    emergency(&trial, session, "an adverse event").await.unwrap();

    let shown = serde_json::to_string(&trial.operator_view()).unwrap();
    assert!(!shown.contains("climber") && !shown.contains("adverse"), "{shown}");
    for _ in 0..2 {
        trial.whole_setting().await;
    }
    assert_eq!(detail(&trial).await.log.len(), 3);
    let line = &trial.store.reader().sessions(false).await.unwrap()[0];
    assert!(line.unblinded && line.emergency);
}

#[tokio::test]
async fn every_export_tells_an_emergency_and_none_tells_an_order_ahead_of_time() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, PARTICIPANT, "leeds").await;
    emergency(&trial, session, "an adverse event").await.unwrap();

    for unblinded in [false, true] {
        let out = folder.path().join(format!("export-{unblinded}"));
        export(&trial.access_log(), session, &out, unblinded).await.unwrap();
        let checks = verify(&out, None);
        assert_eq!(failed(&checks), [""; 0], "{checks:?}");

        let events = rows(&out, "study_events");
        let last = events.last().unwrap();
        assert_eq!(
            (last["kind"].as_str(), last["person"].as_str(), last["reason"].as_str()),
            ("session-unblinded", "Dr Ward", "an adverse event")
        );
        assert_eq!(rows(&out, "sessions")[0]["unblinded"], "emergency-after-end");
        assert_eq!(json(&out, "datapackage.json")["parfocal"]["study"], STUDY);
        assert_eq!(rows(&out, "study_sessions")[0]["place"], "1");
    }

    // Its set has another place, which nobody has taken yet. The seed would reveal the order of that place.
    let allocation = json(&folder.path().join("export-true"), "allocation.json");
    assert_eq!((&allocation["seed"], &allocation["study_statement"]), (&Value::Null, &Value::Null));
    assert!(allocation["study_statement_withheld"].as_str().unwrap().contains("unblind all of it"), "{allocation}");
}

#[tokio::test]
async fn sessions_outside_a_study_never_share_the_seed_of_its_sets() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let inside = whole(&mut trial, PARTICIPANT, "leeds").await;
    let outside = trial.conductor.create(Role::Operator, "S-02", "pair", None).await.unwrap();
    let seed = async |session| trial.store.reader().session(session).await.unwrap().unwrap().made.seed;
    assert!(seed(inside).await != seed(outside).await);
    assert_eq!(trial.store.reader().enrolment(outside).await.unwrap(), None);
}
