//! Answers that arrive late or out of order: which one counts, until when answers count, and how the others are shown.

use std::path::Path;
use std::time::Duration;

use parfocal_base::ids::{DeviceId, SessionId};
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::verify;
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::refusal::RefusalKind;
use parfocal_trial::remark::{Holding, NewAnswer, Origin, WaitClock};
use parfocal_trial::role::Role;
use uuid::Uuid;

use crate::exports::{failed, rows};
use crate::fixture::Trial;

const SECOND: Duration = Duration::from_secs(1);
const MINUTE: Duration = Duration::from_mins(1);

const TABLET_A: DeviceId = DeviceId(Uuid::from_u128(0xa));
const TABLET_B: DeviceId = DeviceId(Uuid::from_u128(0xb));

/// The origin that a page reports for a comment or answer that has waited on `device` for `waited`.
fn origin(device: DeviceId, sequence: i64, waited: Duration) -> Origin {
    Origin {
        device: Some(device),
        sequence: Some(sequence),
        client_millis: Some(1_772_355_600_000),
        waited_millis: Some(i64::try_from(waited.as_millis()).unwrap()),
        waited_by: Some(WaitClock::PageClock),
    }
}

/// An answer to the question about sharpness in the current setting.
fn sharpness(trial: &mut Trial, point: u8, origin: Origin) -> NewAnswer {
    let view = trial.view();
    let key = trial.key();
    let question = "sharpness".to_owned();
    NewAnswer { key, session: view.session, segment: view.segment, question, value: AnswerValue::Point(point), origin }
}

/// Runs a session with the paper's protocol up to the questions after its first setting.
async fn at_questions(folder: &Path) -> (Trial, SessionId) {
    let trial = Trial::start(folder).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.wait(10 * SECOND).await;
    trial.surgeon(Action::FinishSegment { segment }).await;
    (trial, session)
}

async fn abort(trial: &Trial, session: SessionId) {
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "fire alarm".to_owned() }).await.unwrap();
}

async fn unblind(trial: &Trial, session: SessionId, despite_outstanding: bool) -> Result<(), ConductError> {
    let reason = "analysis begins".to_owned();
    trial.conductor.act(Role::Researcher, session, Action::Unblind { reason, despite_outstanding }).await
}

#[tokio::test]
async fn the_latest_answer_counts_and_devices_that_disagree_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, session) = at_questions(folder.path()).await;
    trial.wait(60 * SECOND).await;

    // "5" is given on tablet B. Tablet A has no network, and holds a "3" that was given 50 s before.
    let five = sharpness(&mut trial, 5, origin(TABLET_B, 1, Duration::ZERO));
    trial.conductor.answer(five).await.unwrap();

    trial.wait(30 * SECOND).await;
    let three = sharpness(&mut trial, 3, origin(TABLET_A, 7, 80 * SECOND));
    trial.conductor.answer(three).await.unwrap();
    assert_eq!(trial.view().answers["sharpness"], AnswerValue::Point(5));
    drop(trial);

    let trial = Trial::start(folder.path()).await;
    assert_eq!(trial.view().answers["sharpness"], AnswerValue::Point(5), "over a restart too");

    let detail = trial.reports.session_detail(session).await.unwrap();
    assert_eq!((&detail.answers[0].value, detail.answers[0].devices_disagree), (&AnswerValue::Point(5), true));

    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    let aside = &timeline.set_aside[0];
    assert_eq!(
        (&aside.value, &aside.counted, aside.late),
        (&AnswerValue::Point(3), &Some(AnswerValue::Point(5)), false)
    );

    assert!((aside.seconds - 20.0).abs() < 1e-9, "it stands where it was given: {aside:?}");

    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let answers = rows(&out, "answers");
    let told: Vec<_> = answers
        .iter()
        .map(|row| ["value", "revision", "counts", "disagrees", "sequence", "late"].map(|column| row[column].as_str()))
        .collect();

    assert_eq!(told, [["5", "2", "true", "true", "1", "false"], ["3", "1", "false", "true", "7", "false"]]);
    assert_eq!(answers[1]["device"], TABLET_A.to_string());
    assert_eq!((answers[1]["waited_ms"].as_str(), answers[1]["waited_by"].as_str()), ("80000", "page-clock"));
    assert!(answers[1]["given"] < answers[0]["given"], "{answers:?}");
    assert_eq!(failed(&verify(&out, None)), [""; 0]);
}

#[tokio::test]
async fn of_two_tabs_the_one_that_answered_last_counts_whatever_the_devices_clock_did() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, session) = at_questions(folder.path()).await;
    trial.wait(60 * SECOND).await;

    let five = sharpness(&mut trial, 5, origin(TABLET_A, 8, 30 * SECOND));
    trial.conductor.answer(five).await.unwrap();

    // The wait of the first tab's answer was measured across a clock that was set.
    let three = sharpness(&mut trial, 3, origin(TABLET_A, 7, Duration::ZERO));
    trial.conductor.answer(three).await.unwrap();

    assert_eq!(trial.view().answers["sharpness"], AnswerValue::Point(5));
    assert_eq!(trial.reports.timeline(Role::Researcher, session, 10).await.unwrap().set_aside, []);
    assert!(!trial.reports.session_detail(session).await.unwrap().answers[0].devices_disagree);
}

#[tokio::test]
async fn a_servers_clock_that_was_set_back_while_it_was_down_makes_no_later_answer_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, _) = at_questions(folder.path()).await;
    trial.wait(60 * MINUTE).await;

    let five = sharpness(&mut trial, 5, origin(TABLET_B, 1, Duration::ZERO));
    trial.conductor.answer(five).await.unwrap();
    drop(trial);

    // Both clocks of the server begin again where they were an hour before.
    let mut trial = Trial::start(folder.path()).await;
    let two = sharpness(&mut trial, 2, origin(TABLET_A, 1, Duration::ZERO));
    trial.wait(SECOND).await;
    trial.conductor.answer(two).await.unwrap();

    assert_eq!(trial.view().answers["sharpness"], AnswerValue::Point(2));
}

#[tokio::test]
async fn what_a_tablet_holds_counts_for_half_an_hour_after_the_end_and_later_arrivals_are_kept_and_marked() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, session) = at_questions(folder.path()).await;
    let held = [3, 5, 1].map(|point| sharpness(&mut trial, point, origin(TABLET_A, point.into(), Duration::ZERO)));
    let mut comments = ["in time", "too late"].map(|text| trial.comment(text));
    abort(&trial, session).await;
    trial.wait(29 * MINUTE).await;
    trial.conductor.answer(held[0].clone()).await.unwrap();
    trial.conductor.comment(comments[0].clone()).await.unwrap();
    drop(trial);

    // The server was restarted in the meantime, and another session is under way on it.
    let trial = Trial::start(folder.path()).await;
    trial.wait(MINUTE).await;
    trial.conductor.answer(held[1].clone()).await.unwrap();
    trial.begin("paper").await;
    trial.wait(SECOND).await;
    trial.conductor.answer(held[2].clone()).await.unwrap();
    comments[1].segment = None;
    trial.conductor.comment(comments[1].clone()).await.unwrap();

    let detail = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(detail.answers.iter().map(|line| &line.value).collect::<Vec<_>>(), [&AnswerValue::Point(5)]);
    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    let aside = &timeline.set_aside[0];
    assert_eq!((&aside.value, aside.late, timeline.set_aside.len()), (&AnswerValue::Point(1), true, 1));
    assert!(trial.store.reader().answers(session).await.unwrap().iter().any(|(_, answer)| answer.key == aside.key));
    assert_eq!(timeline.comments.iter().map(|comment| comment.late).collect::<Vec<_>>(), [false, true]);

    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let column = |table: &str, name: &str| rows(&out, table).iter().map(|row| row[name].clone()).collect::<Vec<_>>();
    assert_eq!(column("answers", "value"), ["3", "5", "1"]);
    assert_eq!(column("answers", "counts"), ["false", "true", "false"]);
    assert_eq!(column("answers", "late"), ["false", "false", "true"]);
    assert_eq!(column("comments", "late"), ["false", "true"]);
    assert_eq!(column("sessions", "counts_until"), [detail.counts_until.unwrap().to_string()]);
    assert_eq!(failed(&verify(&out, None)), [""; 0]);
}

#[tokio::test]
async fn a_protocol_says_how_long_what_a_tablet_holds_counts() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = include_str!("../../trial-protocols/paper.toml")
        .replace("name = \"paper\"", "name = \"short-grace\"")
        .replace("repeats = 2", "repeats = 2\ngrace_minutes = 1");
    std::fs::write(folder.path().join("short-grace.toml"), protocol).unwrap();
    let mut trial = Trial::start_with(folder.path(), Some(folder.path()), 7).await;
    let session = trial.begin("short-grace").await;
    let early = trial.comment("in time");
    let late = trial.comment("too late");
    abort(&trial, session).await;
    trial.wait(MINUTE).await;
    trial.conductor.comment(early).await.unwrap();
    trial.wait(SECOND).await;
    trial.conductor.comment(late).await.unwrap();
    let kept = trial.store.reader().comments(session).await.unwrap();
    assert_eq!(kept.iter().map(|(_, comment)| comment.late).collect::<Vec<_>>(), [false, true]);
}

#[tokio::test]
async fn unblinding_asks_while_something_may_be_outstanding_and_then_nothing_counts_any_more() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, session) = at_questions(folder.path()).await;
    trial.answer("sharpness", AnswerValue::Point(6)).await.unwrap();
    let mut late = sharpness(&mut trial, 1, origin(TABLET_A, 1, Duration::ZERO));
    abort(&trial, session).await;
    let refused = unblind(&trial, session, false).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("counts until")), "{refused}");
    assert!(!trial.reports.session_detail(session).await.unwrap().line.unblinded);

    unblind(&trial, session, true).await.unwrap();
    trial.conductor.answer(late.clone()).await.unwrap();
    // The same after the session was closed.
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    late.key = trial.key();
    trial.conductor.answer(late).await.unwrap();
    let detail = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(detail.answers.iter().map(|line| &line.value).collect::<Vec<_>>(), [&AnswerValue::Point(6)]);
    let kept = trial.store.reader().answers(session).await.unwrap();
    assert_eq!(kept.iter().map(|(_, answer)| answer.late).collect::<Vec<_>>(), [false, true, true]);
}

#[tokio::test]
async fn unblinding_asks_until_each_tablet_has_said_since_the_end_that_it_holds_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, session) = at_questions(folder.path()).await;
    let told = |device, holding| Holding { session, device, holding };
    trial.conductor.holding(told(TABLET_A, 0)).await.unwrap();
    let answer = sharpness(&mut trial, 4, origin(TABLET_B, 1, Duration::ZERO));
    trial.conductor.answer(answer).await.unwrap();
    trial.wait(SECOND).await;
    abort(&trial, session).await;
    trial.wait(31 * MINUTE).await;

    let refused = unblind(&trial, session, false).await.unwrap_err().to_string();
    assert!(refused.contains("2 surgeon's devices have not reported"), "{refused}");
    trial.conductor.holding(told(TABLET_A, 0)).await.unwrap();
    trial.conductor.holding(told(TABLET_B, 1)).await.unwrap();
    let refused = unblind(&trial, session, false).await.unwrap_err().to_string();
    assert!(refused.contains("1 surgeon's device has not reported"), "{refused}");
    trial.conductor.holding(told(TABLET_B, 0)).await.unwrap();
    unblind(&trial, session, false).await.unwrap();

    let elsewhere = Holding { session: SessionId(Uuid::from_u128(1)), ..told(TABLET_A, 0) };
    let refused = trial.conductor.holding(elsewhere).await.unwrap_err();
    assert!(matches!(refused, ConductError::Said(RefusalKind::Unknown, _)), "{refused}");
}

#[tokio::test]
async fn an_emergency_unblinding_does_not_wait_and_answers_count_until_the_sessions_end() {
    let folder = tempfile::tempdir().unwrap();
    let (mut trial, session) = at_questions(folder.path()).await;
    unblind(&trial, session, false).await.unwrap();
    trial.answer("sharpness", AnswerValue::Point(6)).await.unwrap();
    assert_eq!(trial.view().answers["sharpness"], AnswerValue::Point(6));
    let after = sharpness(&mut trial, 1, Origin::default());
    abort(&trial, session).await;
    trial.conductor.answer(after).await.unwrap();
    let kept = trial.store.reader().answers(session).await.unwrap();
    assert_eq!(kept.iter().map(|(_, answer)| answer.late).collect::<Vec<_>>(), [false, true]);
}
