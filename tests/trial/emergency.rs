//! An emergency in a session: it is paused at once, the lens is focused by hand, and the reason is given afterwards.

use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_pipeline::control::{Command, Drive};
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::{Action, Focus};
use parfocal_trial::event::EventKind;
use parfocal_trial::phase::Phase;
use parfocal_trial::role::Role;

use crate::fixture::Trial;

const PAUSE: Action = Action::Pause { reason: String::new() };

fn power(value: f64) -> FocalPower {
    FocalPower::new(value).unwrap()
}

fn by_hand(value: f64) -> Command {
    Command::Drive { drive: Drive::Manual(power(value)), segment: None }
}

/// A session of the paper's protocol in its first setting.
async fn inspecting(trial: &mut Trial) -> parfocal_base::ids::SessionId {
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.wait(Duration::from_secs(5)).await;
    trial.commanded();
    session
}

async fn kinds(trial: &Trial, session: parfocal_base::ids::SessionId) -> Vec<EventKind> {
    let events = trial.store.reader().events(session).await.unwrap();
    events.into_iter().map(|(_, event)| event.kind).collect()
}

#[tokio::test]
async fn two_acts_lead_from_a_trial_to_focus_by_hand_and_the_policy_goes_on_from_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial).await;
    let segment = trial.view().segment;

    trial.conductor.act(Role::Operator, session, PAUSE).await.unwrap();
    assert_eq!(trial.commanded(), [Command::Drive { drive: Drive::Hold { at: None }, segment }]);
    assert!(trial.operator_view().may_focus_by_hand);
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.8)).await.unwrap();
    assert_eq!(trial.commanded(), [by_hand(0.8)], "outside the segment: it is not the policy's path");
    assert_eq!(trial.operator_view().by_hand, Some(0.8));

    let policy = trial.conductor.focus(Role::Operator, &Focus::Policy("fixed".to_owned())).await;
    assert!(matches!(policy, Err(ConductError::Conflict(_))), "a policy that is chosen would be no secret");
    trial.conductor.act(Role::Operator, session, Action::Resume).await.unwrap();
    let resumed = trial.commanded();
    // The fake loop says that the lens was in the middle.
    assert!(
        matches!(&resumed[..], [Command::Drive { drive: Drive::Policy { start: Some(start), .. }, segment: s }]
            if *start == FocalPower::MIDDLE && *s == segment),
        "{resumed:?}"
    );
    assert_eq!(trial.operator_view().by_hand, None);
    let refused = trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.8)).await;
    assert!(matches!(refused, Err(ConductError::Conflict(_))));
}

#[tokio::test]
async fn a_movement_by_hand_is_recorded_where_it_begins_and_where_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial).await;
    trial.conductor.act(Role::Operator, session, PAUSE).await.unwrap();
    for value in [0.6, 0.7, 0.8, 0.9] {
        trial.conductor.focus(Role::Operator, &Focus::FocalPower(value)).await.unwrap();
        trial.wait(Duration::from_millis(100)).await;
    }
    trial.wait(Duration::from_secs(1)).await;
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.3)).await.unwrap();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.4)).await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Resume).await.unwrap();

    let moved: Vec<(f64, bool)> = kinds(&trial, session)
        .await
        .iter()
        .filter_map(|kind| match kind {
            EventKind::FocusedByHand { focal_power, left_at } => Some((focal_power.get(), left_at.is_some())),
            _ => None,
        })
        .collect();
    assert_eq!(moved, [(0.6, true), (0.9, false), (0.3, false), (0.4, false)]);
}

#[tokio::test]
async fn the_end_of_a_movement_is_recorded_though_the_next_session_is_made_or_the_server_ends_meanwhile() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let first = inspecting(&mut trial).await;
    trial.conductor.act(Role::Operator, first, Action::Abort { reason: "bleeding".to_owned() }).await.unwrap();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.3)).await.unwrap();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.4)).await.unwrap();
    let second = inspecting(&mut trial).await;
    trial.conductor.act(Role::Operator, second, PAUSE).await.unwrap();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.6)).await.unwrap();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.7)).await.unwrap();
    trial.conductor.record_the_rest().await;

    for (session, end) in [(first, 0.4), (second, 0.7)] {
        let last = kinds(&trial, session).await.pop();
        assert!(
            matches!(&last, Some(EventKind::FocusedByHand { focal_power, .. }) if *focal_power == power(end)),
            "{last:?}"
        );
    }
}

#[tokio::test]
async fn after_an_abort_the_lens_is_focused_by_hand_until_the_session_is_closed() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial).await;
    let abort = Action::Abort { reason: "bleeding".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
    assert_eq!(trial.view().phase, Phase::Aborted);
    trial.commanded();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.3)).await.unwrap();
    assert_eq!(trial.commanded(), [by_hand(0.3)]);
    let last = kinds(&trial, session).await.pop();
    assert!(matches!(last, Some(EventKind::FocusedByHand { .. })), "{last:?}");
}

#[tokio::test]
async fn the_reason_for_a_pause_is_asked_afterwards_until_the_session_is_closed() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial).await;
    trial.conductor.act(Role::Surgeon, session, PAUSE).await.unwrap();
    assert!(trial.view().may_resume && !trial.view().may_pause);
    trial.surgeon(Action::Resume).await;
    assert!(trial.view().may_pause);
    trial.conductor.act(Role::Operator, session, PAUSE).await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "over".to_owned() }).await.unwrap();

    let wanted = trial.operator_view().reason_wanted.unwrap();
    assert_eq!(wanted.by, Role::Operator);
    let reason = |event: u32| Action::GiveReason { event, reason: "bleeding".to_owned() };
    trial.conductor.act(Role::Operator, session, reason(wanted.event)).await.unwrap();
    let wanted = trial.operator_view().reason_wanted.unwrap();
    assert_eq!(wanted.by, Role::Surgeon);
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    let late = trial.conductor.act(Role::Operator, session, reason(wanted.event)).await;
    assert!(matches!(late, Err(ConductError::Conflict(text)) if text.contains("closed")));
}

#[tokio::test]
async fn after_a_restart_the_lens_stays_where_the_hand_put_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial).await;
    trial.conductor.act(Role::Operator, session, PAUSE).await.unwrap();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.8)).await.unwrap();
    drop(trial);

    let mut trial = Trial::start(folder.path()).await;
    assert_eq!(trial.commanded(), [by_hand(0.8)]);
    trial.conductor.act(Role::Operator, session, Action::Resume).await.unwrap();
    let resumed = trial.commanded();
    assert!(
        matches!(&resumed[..], [Command::Drive { drive: Drive::Policy { start: Some(start), .. }, .. }]
            if *start != power(0.8)),
        "{resumed:?}"
    );
}
