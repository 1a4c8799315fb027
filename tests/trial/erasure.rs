//! Erasure: erased words are nowhere in the database's files, but records, hashes and order stay.

use std::path::{Path, PathBuf};

use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_records::store::backup::backup;
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::verify;
use parfocal_records::store::{Reader, StoreError, verify_database};
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::correction::{FieldChange, NewCorrection};
use parfocal_trial::erasure::{Erasable, NewErasure};
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::{CommentContent, NewComment};
use parfocal_trial::role::Role;
use parfocal_trial::study::signature::Signature;
use parfocal_trial::study::state::Change;

use crate::exports::{failed, rows};
use crate::fixture::{PARTICIPANT, Trial};
use crate::studies;

/// Words that occur nowhere else. They are long enough to fill pages of the database, so that SQLite splits them.
fn words(what: &str) -> String {
    format!("{what} Frau Mustermann, bed twelve; ").repeat(40)
}

/// The files in `folder` that contain `text`.
fn holding(folder: &Path, text: &str) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
    let holds = |path: &PathBuf| {
        let bytes = std::fs::read(path).unwrap();
        bytes.windows(text.len()).any(|window| window == text.as_bytes())
    };
    files.filter(holds).collect()
}

const NOWHERE: [PathBuf; 0] = [];

fn erasure(subject: Erasable, record: IdempotencyKey) -> NewErasure {
    NewErasure { subject, record: record.to_string(), reason: "names a patient".to_owned() }
}

/// Makes a session with comments, up to its end. Returns it with the comment to erase.
async fn session(trial: &mut Trial) -> (SessionId, NewComment) {
    let session = trial.begin("practice").await;
    for number in 0..30 {
        trial.say(&format!("comment {number} {}", "filler ".repeat(60))).await;
    }
    let comment = trial.comment(&words("the vessel of"));
    trial.conductor.comment(comment.clone()).await.unwrap();
    for number in 30..60 {
        trial.say(&format!("comment {number} {}", "filler ".repeat(60))).await;
    }

    let mut settings = 0;
    while settings < 2 {
        let segment = trial.view().segment.unwrap();
        trial.surgeon(Action::Acknowledge { segment }).await;
        trial.surgeon(Action::FinishSegment { segment }).await;
        trial.answer_all().await;
        trial.surgeon(Action::FinishQuestions { segment: Some(segment) }).await;
        settings += 1;
    }
    trial.answer("ready", AnswerValue::Text(words("ask again about"))).await.unwrap();
    trial.surgeon(Action::FinishQuestions { segment: None }).await;
    (session, comment)
}

#[tokio::test]
async fn erased_words_are_nowhere_in_the_files_nor_in_a_new_backup_and_the_chain_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut trial = Trial::start(&data).await;
    let (session, comment) = session(&mut trial).await;
    let note = FieldChange::Note { record: comment.key, old: String::new(), new: words("note on") };
    let note = NewCorrection { change: note, reason: "reason of Frau Mustermann".to_owned() };
    trial.conductor.correct(Role::Researcher, session, note).await.unwrap();
    assert!(!holding(&data, "Mustermann").is_empty(), "the test looks where the words are");
    let salted: i64 = count(&data, "SELECT count(*) FROM chain_salts").await;

    trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Comment, comment.key)).await.unwrap();
    assert_eq!(holding(&data, "the vessel of Frau Mustermann"), NOWHERE);
    assert_eq!(holding(&data, "note on Frau"), NOWHERE, "a note may repeat the words");
    assert_eq!(holding(&data, "reason of Frau"), NOWHERE);

    let answer = trial.store.reader().answers(session).await.unwrap().pop().unwrap().1;
    trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Answer, answer.key)).await.unwrap();
    assert_eq!(holding(&data, "Mustermann"), NOWHERE);
    assert_eq!(count(&data, "SELECT count(*) FROM chain_salts").await, salted - 3 + 3, "three gone, three erasures");

    let file = folder.path().join("backup.db");
    backup(&data, &file, trial.clock.clone()).await.unwrap();
    assert_eq!(holding(folder.path(), "Mustermann"), NOWHERE);
    for path in [&data, &file] {
        let checks = verify_database(path, None).await.unwrap();
        assert_eq!(failed(&checks), [""; 0], "{checks:?}");
        assert!(crate::chain::said(&checks, "chain").unwrap().contains("3 have erased words"), "{checks:?}");
    }

    // The records stay, with their times and authors.
    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    let erased: Vec<_> = timeline.comments.iter().filter(|comment| comment.erased.is_some()).collect();
    assert_eq!((timeline.comments.len(), erased.len(), erased[0].key), (61, 1, comment.key));
    let detail = trial.reports.session_detail(session).await.unwrap();
    assert!(detail.log.iter().any(|line| line.text == "Words of a comment erased: names a patient"));

    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    assert_eq!(failed(&verify(&out, None)), [""; 0], "{:?}", verify(&out, None));
    assert_eq!(holding(&out, "Mustermann"), NOWHERE);
    let row = rows(&out, "comments").into_iter().find(|row| row["key"] == comment.key.to_string()).unwrap();
    assert_eq!((row["text"].as_str(), row["erased"].as_str()), ("", rows(&out, "erasures")[0]["wall"].as_str()));
    let told: Vec<_> = rows(&out, "erasures")
        .iter()
        .map(|row| [row["subject"].clone(), row["role"].clone(), row["reason"].clone()].join(", "))
        .collect();
    let expected = ["comment", "correction", "answer"].map(|what| format!("{what}, researcher, names a patient"));
    assert_eq!(told, expected);

    // A tablet that got no confirmation sends its comment again. It gets one, but the words do not come back.
    trial.conductor.comment(comment).await.unwrap();
    assert_eq!(holding(&data, "Mustermann"), NOWHERE);
}

#[tokio::test]
async fn a_note_that_was_changed_is_erased_in_all_its_versions() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let (session, comment) = session(&mut trial).await;
    let answers = trial.store.reader().answers(session).await.unwrap();
    let point = answers.iter().find(|(_, answer)| answer.question == "sharpness").unwrap().1.clone();

    let versions = [words("note on"), "note on a vessel".to_owned(), "a vessel".to_owned()];
    let mut old = String::new();
    for new in versions {
        let changes = [
            FieldChange::Note { record: comment.key, old: old.clone(), new: new.clone() },
            FieldChange::Note { record: point.key, old: old.clone(), new: new.clone() },
        ];
        for change in changes {
            let correction = NewCorrection { change, reason: "on second thoughts".to_owned() };
            trial.conductor.correct(Role::Researcher, session, correction).await.unwrap();
        }
        old = new;
    }
    let other = AnswerValue::Point(if point.value == AnswerValue::Point(1) { 2 } else { 1 });
    let change = FieldChange::Value { record: point.key, old: point.value, new: other };
    let correction = NewCorrection { change, reason: "slipped".to_owned() };
    trial.conductor.correct(Role::Researcher, session, correction).await.unwrap();

    let corrections = trial.store.reader().corrections(session).await.unwrap();
    for first in &corrections[..2] {
        let erasure = NewErasure {
            subject: Erasable::Correction,
            record: first.number.to_string(),
            reason: "names a patient".to_owned(),
        };
        trial.conductor.erase(Role::Researcher, session, erasure).await.unwrap();
    }
    assert_eq!(holding(folder.path(), "note on Frau"), NOWHERE);
    assert_eq!(holding(folder.path(), "note on a vessel"), NOWHERE);
    let erasures = trial.store.reader().erasures(session).await.unwrap();
    assert_eq!(erasures.len(), 6, "the corrected value stays: {erasures:?}");
    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
}

/// A researcher writes what a moment was marked for, or writes anew beside words that are erased.
#[tokio::test]
async fn a_note_is_erased_also_where_the_surgeon_left_no_words() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let (session, comment) = session(&mut trial).await;
    let mut mark = trial.comment("");
    mark.said = CommentContent::Mark;
    trial.conductor.comment(mark.clone()).await.unwrap();

    let erase = async |key| trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Comment, key)).await;
    let refused = erase(mark.key).await.unwrap_err().to_string();
    assert!(refused.contains("this comment has none"), "{refused}");
    erase(comment.key).await.unwrap();

    for record in [mark.key, comment.key] {
        let change = FieldChange::Note { record, old: String::new(), new: words("note on") };
        let correction = NewCorrection { change, reason: "on second thoughts".to_owned() };
        trial.conductor.correct(Role::Researcher, session, correction).await.unwrap();
        erase(record).await.unwrap();
    }
    for gone in ["the vessel of Frau", "note on Frau"] {
        assert_eq!(holding(folder.path(), gone), NOWHERE, "{gone}");
    }
    let shown = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap().comments;
    assert!(shown.iter().all(|comment| comment.note.is_none()), "{shown:?}");
    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
}

/// A tablet sends what was typed each time that the surgeon leaves the field.
#[tokio::test]
async fn an_answer_in_words_is_erased_in_all_its_versions() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let (session, _) = session(&mut trial).await;
    let first = trial.store.reader().answers(session).await.unwrap().pop().unwrap().1;
    let note = FieldChange::Note { record: first.key, old: String::new(), new: words("note on") };
    let note = NewCorrection { change: note, reason: "on second thoughts".to_owned() };
    trial.conductor.correct(Role::Researcher, session, note).await.unwrap();
    trial.answer("ready", AnswerValue::Text("ask again".to_owned())).await.unwrap();

    let shown = trial.reports.session_detail(session).await.unwrap().answers;
    let counts = shown.iter().find(|answer| answer.question == "ready").unwrap();
    assert_eq!(counts.words, "ask again", "the page has the latest version alone");
    trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Answer, counts.key)).await.unwrap();
    for gone in ["ask again about Frau", "note on Frau"] {
        assert_eq!(holding(folder.path(), gone), NOWHERE, "{gone}");
    }
    let texts = trial.store.reader().answers(session).await.unwrap();
    let texts = texts.iter().filter(|(_, answer)| answer.question == "ready").map(|(_, answer)| &answer.value);
    assert!(texts.eq(&[AnswerValue::Text(String::new()), AnswerValue::Text(String::new())]));
    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
}

#[tokio::test]
async fn all_words_of_a_withdrawn_session_are_erased_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut trial = Trial::start(&data).await;
    let (session, comment) = session(&mut trial).await;
    let note = FieldChange::Note { record: comment.key, old: String::new(), new: words("note on") };
    let note = NewCorrection { change: note, reason: "reason of Frau Mustermann".to_owned() };
    trial.conductor.correct(Role::Researcher, session, note).await.unwrap();
    trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Comment, comment.key)).await.unwrap();

    let all = async |by: Role| trial.conductor.erase_all_words(by, session, "the participant asks".to_owned()).await;
    let refused = all(Role::Researcher).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("only for a withdrawn")), "{refused}");
    let withdraw = Action::Withdraw { reason: "wants no part in it".to_owned() };
    trial.conductor.act(Role::Researcher, session, withdraw).await.unwrap();
    assert!(matches!(all(Role::Operator).await, Err(ConductError::Forbidden(_))));

    let left = async || trial.reports.session_detail(session).await.unwrap().withdrawal.unwrap().words_left;
    assert_eq!(left().await, 60 + 1, "what was erased before is not counted again");
    all(Role::Researcher).await.unwrap();
    assert_eq!(left().await, 0);
    assert_eq!(holding(&data, "Mustermann"), NOWHERE);
    assert_eq!(holding(&data, "filler"), NOWHERE);
    let refused = all(Role::Researcher).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("no words")), "{refused}");

    let checks = verify_database(&data, None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert_eq!(trial.store.reader().comments(session).await.unwrap().len(), 61, "the records stay");

    // A comment that a tablet still held is kept, and can be erased as well.
    let late = NewComment { key: trial.key(), ..comment };
    trial.conductor.comment(late).await.unwrap();
    let detail = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(detail.withdrawal.unwrap().words_left, 1);
    trial.conductor.erase_all_words(Role::Researcher, session, "as before".to_owned()).await.unwrap();
    assert_eq!(holding(&data, "Mustermann"), NOWHERE);
}

/// Erases reasons that name a patient: of an abort, and of an unblinding, whose reason the study's audit trail repeats.
#[tokio::test]
async fn an_erased_reason_is_nowhere_and_the_event_stays() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let trial = studies::opened(&data).await;
    let session = studies::prepare(&trial, PARTICIPANT, "leeds").await.unwrap();
    let abort = Action::Abort { reason: "Frau Mustermann bled".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
    let signature = Signature::new("Dr Ward", "Frau Mustermann needs to know").unwrap();
    trial.conductor.unblind_in_emergency(Role::Researcher, session, signature, true).await.unwrap();

    let reasons = async || -> Vec<u32> {
        let detail = trial.reports.session_detail(session).await.unwrap();
        detail.log.iter().filter_map(|line| line.erasable_event).collect()
    };
    let told = reasons().await;
    assert_eq!(told.len(), 2, "{told:?}");
    for event in told {
        let erasure = |number: &str| NewErasure {
            subject: Erasable::Event,
            record: number.to_owned(),
            reason: "names a patient".to_owned(),
        };
        trial.conductor.erase(Role::Researcher, session, erasure(&event.to_string())).await.unwrap();
        let none = trial.conductor.erase(Role::Researcher, session, erasure("1")).await.unwrap_err();
        assert!(matches!(&none, ConductError::Conflict(text) if text.contains("this event has none")), "{none}");
        let unknown = trial.conductor.erase(Role::Researcher, session, erasure("99")).await.unwrap_err();
        assert!(matches!(unknown, ConductError::NotFound(_)), "{unknown}");
    }
    assert_eq!(holding(&data, "Mustermann"), NOWHERE);
    assert_eq!(reasons().await, [0; 0]);
    let log = trial.reports.session_detail(session).await.unwrap().log;
    assert!(log.iter().any(|line| line.text == "Session aborted"), "{log:?}");
    assert!(log.iter().any(|line| line.text == "Reason of an event erased: names a patient"), "{log:?}");
    let log = studies::detail(&trial).await.log;
    assert_eq!(log.last().unwrap().in_words(), format!("Emergency unblinding of the session of {PARTICIPANT}"));

    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, true).await.unwrap();
    assert_eq!(failed(&verify(&out, None)), [""; 0], "{:?}", verify(&out, None));
    let erased: Vec<String> =
        rows(&out, "erasures").into_iter().map(|mut row| row.remove("subject").unwrap()).collect();
    assert_eq!(erased, ["event", "event", "study-event"]);
    trial.store.close().await;
    drop(trial);

    // After a restart, the server rebuilds the session from its events.
    let trial = Trial::start_with(&data, Some(&data), 5).await;
    let checks = verify_database(&data, None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert!(trial.reports.session_detail(session).await.unwrap().unblinding.is_some());
    trial.store.close().await;

    let pool = crate::storage::raw(&data).await;
    for sql in [
        "UPDATE events SET payload = json_set(payload, '$.reason', 'other') WHERE kind = 'aborted'",
        "UPDATE events SET payload = json_set(payload, '$.inspected_ms', 1) WHERE kind = 'aborted'",
        "UPDATE events SET payload = '{}' WHERE kind = 'created'",
        "UPDATE study_events SET reason = 'other'",
        "UPDATE study_events SET reason = ''",
    ] {
        let refused = sqlx::raw_sql(sql).execute(&pool).await.unwrap_err();
        assert!(refused.to_string().contains("append-only"), "{sql}: {refused}");
    }
    pool.close().await;
}

/// All sessions of the study have that reason, and so does the study.
#[tokio::test]
async fn the_reason_for_unblinding_a_whole_study_is_not_erased_in_one_of_its_sessions() {
    let folder = tempfile::tempdir().unwrap();
    let trial = studies::opened(folder.path()).await;
    let session = studies::prepare(&trial, PARTICIPANT, "leeds").await.unwrap();
    let abort = Action::Abort { reason: "smoke".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    studies::change(&trial, Change::Close).await.unwrap();
    studies::change(&trial, Change::Lock { despite_outstanding: true }).await.unwrap();
    let signature = Signature::new(studies::STATISTICIAN, "the last surgeon was there").unwrap();
    let study = studies::STUDY.to_owned();
    trial.conductor.change_study(Role::Researcher, study, Change::Unblind, signature).await.unwrap();

    let log = trial.reports.session_detail(session).await.unwrap().log;
    let erasable: Vec<u32> = log.iter().filter_map(|line| line.erasable_event).collect();
    assert_eq!(erasable, [2], "that of the abort: {log:?}");
    let erasure = NewErasure { subject: Erasable::Event, record: "3".to_owned(), reason: "names a patient".to_owned() };
    let refused = trial.conductor.erase(Role::Researcher, session, erasure).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("the whole study")), "{refused}");
}

async fn count(data: &Path, sql: &'static str) -> i64 {
    let pool = crate::storage::raw(data).await;
    let count = sqlx::query_scalar(sql).fetch_one(&pool).await.unwrap();
    pool.close().await;
    count
}

#[tokio::test]
async fn what_a_reader_kept_from_being_erased_is_erased_within_the_hour() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let (session, comment) = session(&mut trial).await;
    let reader = Reader::open(folder.path()).await.unwrap();
    let snapshot = reader.snapshot().await.unwrap();
    trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Comment, comment.key)).await.unwrap_err();

    drop(snapshot);
    drop(reader);
    assert_eq!(trial.conductor.erase_expired_voice().await.unwrap(), 0, "no voice was kept too long");
    assert_eq!(holding(folder.path(), "the vessel of Frau"), NOWHERE);
    trial.store.close().await;
}

#[tokio::test]
async fn what_a_killed_server_did_not_come_to_erase_is_erased_at_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let (session, comment) = session(&mut trial).await;

    // Somebody is reading the database, so its write-ahead log cannot be removed.
    let reader = Reader::open(folder.path()).await.unwrap();
    let snapshot = reader.snapshot().await.unwrap();
    let unfinished =
        trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Comment, comment.key)).await.unwrap_err();
    assert!(matches!(&unfinished, ConductError::Storage(text) if text.contains("erase again")), "{unfinished}");
    assert_eq!(StoreError::ErasureUnfinished.to_string(), unfinished.to_string().replace("could not be saved: ", ""));
    let said = &trial.store.reader().comments(session).await.unwrap()[30].1.said;
    assert_eq!(format!("{said:?}"), "Text(\"\")", "from its record it is gone");

    drop(snapshot);
    drop(reader);
    trial.store.close().await;
    drop(trial);
    let trial = Trial::start(folder.path()).await;
    assert_eq!(holding(folder.path(), "the vessel of Frau"), NOWHERE);
    trial.store.close().await;
}

#[tokio::test]
async fn only_words_are_erased_and_only_by_an_erasure() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let (session, comment) = session(&mut trial).await;
    let answers = trial.store.reader().answers(session).await.unwrap();
    let point = answers.iter().find(|(_, answer)| answer.question == "sharpness").unwrap().1.key;
    let refused = trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Answer, point)).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("only words")), "{refused}");
    let unknown =
        trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Comment, point)).await.unwrap_err();
    assert!(matches!(unknown, ConductError::NotFound(_)), "{unknown}");
    let operator =
        trial.conductor.erase(Role::Operator, session, erasure(Erasable::Comment, comment.key)).await.unwrap_err();
    assert!(matches!(operator, ConductError::Forbidden(_)), "{operator}");

    trial.begin("practice").await;
    let under_way =
        trial.conductor.erase(Role::Researcher, session, erasure(Erasable::Comment, comment.key)).await.unwrap_err();
    assert!(matches!(&under_way, ConductError::Conflict(text) if text.contains("under way")), "{under_way}");
    trial.store.close().await;

    // Texts cannot be emptied by mistake.
    let pool = crate::storage::raw(folder.path()).await;
    for sql in [
        "UPDATE comments SET text = '' WHERE number = 31",
        "UPDATE answers SET value = '\"\"'",
        "DELETE FROM chain_salts",
        "INSERT INTO erasures (session, subject, record, reason, role, run, wall, monotonic_ns)
             SELECT session, 'comment', key, 'r', 'researcher', run, wall, 1 FROM comments WHERE number = 31;
         UPDATE comments SET text = 'other' WHERE number = 31",
        "UPDATE comments SET text = '', late = 1 WHERE number = 31",
    ] {
        let refused = sqlx::raw_sql(sql).execute(&pool).await.unwrap_err();
        assert!(refused.to_string().contains("append-only"), "{sql}: {refused}");
    }
    pool.close().await;

    // The owner of the file can empty a text and claim that it was erased, but has no row in the chain for the erasure.
    let emptied = "DELETE FROM chain_salts WHERE number = (
            SELECT number FROM chain WHERE kind = 'comment' AND key = (SELECT key FROM comments WHERE number = 1));
        UPDATE comments SET text = '' WHERE number = 1; DELETE FROM erasures;";
    let claimed = "INSERT INTO erasures (session, subject, record, reason, role, run, wall, monotonic_ns)
        SELECT session, 'comment', key, 'r', 'researcher', run, wall, 1 FROM comments WHERE number = 1";
    let database = folder.path().join("parfocal.db");
    for (sql, expected) in [(emptied.to_owned(), "its salt is missing"), (format!("{emptied}{claimed}"), "erasure")] {
        let checks = crate::chain::after(&database, &sql, None).await;
        let wrong = crate::chain::said(&checks, "chain").unwrap_err();
        assert!(wrong.contains(expected), "{wrong}");
    }
}
