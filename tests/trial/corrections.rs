//! Corrections: kept beside the original, in the chain and in exports, and refused if they make no sense.

use std::path::Path;

use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::verify;
use parfocal_records::store::verify_database;
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::correction::{FieldChange, NewCorrection};
use parfocal_trial::question::AnswerValue;
use parfocal_trial::role::Role;

use crate::exports::{failed, rows, with_session};
use crate::fixture::{PARTICIPANT, Trial};

async fn correct(trial: &Trial, session: SessionId, change: FieldChange) -> Result<(), ConductError> {
    let correction = NewCorrection { change, reason: "the surgeon said so on the phone".to_owned() };
    trial.conductor.correct(Role::Researcher, session, correction).await
}

/// The answer to `question` that counts, after setting 1 or at the end: its key and its value.
async fn answer(trial: &Trial, session: SessionId, question: &str) -> (IdempotencyKey, AnswerValue) {
    let detail = trial.reports.session_detail(session).await.unwrap();
    let line = detail.answers.into_iter().find(|line| line.question == question && line.setting.unwrap_or(1) == 1);
    let line = line.unwrap();
    (line.key, line.value)
}

fn participant(old: &str, new: &str) -> FieldChange {
    FieldChange::Participant { old: old.to_owned(), new: new.to_owned() }
}

fn note(record: IdempotencyKey, old: &str, new: &str) -> FieldChange {
    FieldChange::Note { record, old: old.to_owned(), new: new.to_owned() }
}

/// The records of a session that a correction must never change, as text.
async fn originals(trial: &Trial, session: SessionId) -> String {
    let reader = trial.store.reader();
    let stored = reader.session(session).await.unwrap().unwrap();
    let answers = reader.answers(session).await.unwrap();
    let comments = reader.comments(session).await.unwrap();
    format!("{stored:?} {answers:?} {comments:?}")
}

async fn export_of(trial: &Trial, session: SessionId, out: &Path) {
    export(&trial.access_log(), session, out, false).await.unwrap();
    let checks = verify(out, None);
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
}

#[tokio::test]
async fn a_correction_stands_beside_the_original_on_the_page_and_in_the_export() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(folder.path()).await;
    let before = originals(&trial, session).await;
    trial.conductor.add_participant(Role::Researcher, "S-02").await.unwrap();

    correct(&trial, session, participant(PARTICIPANT, "S-02")).await.unwrap();
    let (sharpness, value) = answer(&trial, session, "sharpness").await;
    assert_eq!(value, AnswerValue::Point(7));
    let three = FieldChange::Value { record: sharpness, old: value, new: AnswerValue::Point(3) };
    correct(&trial, session, three).await.unwrap();
    let again = FieldChange::Value { record: sharpness, old: AnswerValue::Point(3), new: AnswerValue::Point(4) };
    correct(&trial, session, again).await.unwrap();
    let (usability, value) = answer(&trial, session, "usability").await;
    let best = AnswerValue::Points(vec![5, 1, 5, 1, 5, 1, 5, 1, 5, 1]);
    correct(&trial, session, FieldChange::Value { record: usability, old: value, new: best }).await.unwrap();
    let comment = trial.store.reader().comments(session).await.unwrap()[1].1.key;
    correct(&trial, session, note(comment, "", "said of the monitor")).await.unwrap();

    assert_eq!(originals(&trial, session).await, before, "what was recorded stays");
    let detail = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(detail.line.participant, PARTICIPANT);
    assert_eq!(detail.line.corrected_participant.as_deref(), Some("S-02"));
    let told: Vec<_> = detail.corrections.iter().map(|line| (line.old.as_str(), line.new.as_str())).collect();
    assert_eq!(told[..3], [(PARTICIPANT, "S-02"), ("7", "3"), ("3", "4")]);
    assert_eq!(told[4], ("", "said of the monitor"));
    assert!(detail.corrections[1].about.starts_with("Answer on setting 1: With this setting"), "{detail:?}");
    let sus = detail.answers.iter().find(|line| line.key == usability).unwrap();
    assert_eq!((sus.sus_score, sus.scores[0].value), (Some(67.5), Some(100.0)), "as given, and as corrected");
    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    assert_eq!(timeline.comments[1].note.as_deref(), Some("said of the monitor"));
    assert!(detail.log.iter().any(|line| line.text == "Answer corrected: the surgeon said so on the phone"));

    let out = folder.path().join("export");
    export_of(&trial, session, &out).await;
    let corrections = rows(&out, "corrections");
    assert_eq!(corrections.len(), 5);
    let second = &corrections[2];
    assert_eq!((second["subject"].as_str(), second["record"].as_str()), ("answer", sharpness.to_string().as_str()));
    assert_eq!((second["old_value"].as_str(), second["new_value"].as_str()), ("3", "4"));
    assert_eq!(
        (second["role"].as_str(), second["reason"].as_str()),
        ("researcher", "the surgeon said so on the phone")
    );
    assert_eq!(rows(&out, "sessions")[0]["participant"], PARTICIPANT);
    let answers = rows(&out, "answers");
    let given = answers.iter().find(|row| row["key"] == sharpness.to_string()).unwrap();
    assert_eq!(given["value"], "7");
    let scores = rows(&out, "scores");
    let score = scores.iter().find(|row| row["question"] == "sharpness" && row["setting"] == "1").unwrap();
    assert_eq!((score["value"].as_str(), score["corrected"].as_str()), ("4.0", "true"));
    let score = scores.iter().find(|row| row["measure"] == "sus-score").unwrap();
    assert_eq!((score["value"].as_str(), score["corrected"].as_str()), ("100.0", "true"));
    let score = scores.iter().find(|row| row["question"] == "sharpness" && row["setting"] == "2").unwrap();
    assert_eq!((score["value"].as_str(), score["corrected"].as_str()), ("7.0", "false"));
}

#[tokio::test]
async fn invalid_corrections_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(folder.path()).await;
    let (sharpness, seven) = answer(&trial, session, "sharpness").await;
    let (remarks, words) = answer(&trial, session, "remarks").await;
    let (usability, items) = answer(&trial, session, "usability").await;
    let nobody: IdempotencyKey = "00000000-0000-4000-8000-000000000000".parse().unwrap();
    let value = |record, old: &AnswerValue, new: AnswerValue| FieldChange::Value { record, old: old.clone(), new };
    let open = AnswerValue::Points(vec![0, 1, 1, 1, 1, 1, 1, 1, 1, 1]);

    let conflicts = [
        (value(sharpness, &AnswerValue::Point(6), AnswerValue::Point(5)), "in the meantime"),
        (value(sharpness, &seven, seven.clone()), "is the present one"),
        (value(remarks, &words, AnswerValue::Text("better".to_owned())), "words are never corrected"),
        (note(sharpness, "an earlier note", "a note"), "in the meantime"),
    ];
    for (change, said) in conflicts {
        let refused = correct(&trial, session, change).await.unwrap_err();
        assert!(matches!(&refused, ConductError::Conflict(text) if text.contains(said)), "{refused}");
    }

    let invalid = [
        (participant(PARTICIPANT, "S-99"), "no participant 'S-99'"),
        (value(sharpness, &seven, AnswerValue::Point(8)), "from 1 to 7"),
        (value(usability, &items, open), "must be complete"),
        (note(sharpness, "", &"x".repeat(20_000)), "16384"),
    ];
    for (change, said) in invalid {
        let refused = correct(&trial, session, change).await.unwrap_err();
        assert!(matches!(&refused, ConductError::Invalid(text) if text.contains(said)), "{refused}");
    }

    let unknown = correct(&trial, session, note(nobody, "", "a note")).await.unwrap_err();
    assert!(matches!(unknown, ConductError::NotFound(_)), "{unknown}");
    let by_operator = NewCorrection { change: note(sharpness, "", "a note"), reason: "why".to_owned() };
    let refused = trial.conductor.correct(Role::Operator, session, by_operator).await.unwrap_err();
    assert!(matches!(refused, ConductError::Forbidden(_)), "{refused}");
    let no_reason = NewCorrection { change: note(sharpness, "", "a note"), reason: "  ".to_owned() };
    let refused = trial.conductor.correct(Role::Researcher, session, no_reason).await.unwrap_err();
    assert!(matches!(refused, ConductError::Invalid(_)), "{refused}");
    assert_eq!(trial.store.reader().corrections(session).await.unwrap(), []);

    let under_way = trial.conductor.create(Role::Operator, PARTICIPANT, "practice", None).await.unwrap();
    trial.conductor.act(Role::Operator, under_way, Action::Start).await.unwrap();
    let refused = correct(&trial, under_way, participant(PARTICIPANT, "S-02")).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("once it has ended")), "{refused}");
}

#[tokio::test]
async fn a_changed_or_removed_correction_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(folder.path()).await;
    let (sharpness, seven) = answer(&trial, session, "sharpness").await;
    let change = FieldChange::Value { record: sharpness, old: seven, new: AnswerValue::Point(3) };
    correct(&trial, session, change).await.unwrap();
    trial.store.close().await;
    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");

    let pool = crate::storage::raw(folder.path()).await;
    for sql in ["UPDATE corrections SET new_value = '5'", "DELETE FROM corrections"] {
        let refused = sqlx::query(sql).execute(&pool).await.unwrap_err();
        assert!(refused.to_string().contains("append-only"), "{refused}");
    }
    pool.close().await;

    let database = folder.path().join("parfocal.db");
    for (sql, expected) in [
        ("UPDATE corrections SET new_value = '5'", "corrections: correction 1 was changed"),
        ("UPDATE corrections SET old_value = '5'", "corrections: correction 1 was changed"),
        ("UPDATE corrections SET reason = 'none'", "corrections: correction 1 was changed"),
        ("UPDATE corrections SET role = 'operator'", "corrections: correction 1 was changed"),
        ("DELETE FROM corrections", "corrections: correction 1 is missing"),
        (
            "INSERT INTO corrections SELECT 2, session, subject, record, field, new_value, '6', reason, role, run, wall,
             monotonic_ns FROM corrections",
            "correction 2 was inserted",
        ),
    ] {
        let checks = crate::chain::after(&database, sql, None).await;
        let wrong = crate::chain::said(&checks, "chain").expect_err(sql);
        assert!(wrong.contains(expected), "{sql}: {wrong}");
    }
}
