//! Who may move the lens outside sessions, and when.

use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_pipeline::control::{Command, Drive};
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::{Action, Focus};
use parfocal_trial::role::Role;

use crate::fixture::{PARTICIPANT, Trial};

#[tokio::test]
async fn the_operator_moves_the_lens_before_a_session_is_made_and_after_it_is_closed() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let by_hand = Focus::FocalPower(0.25);
    let by_policy = Focus::Policy("fixed".to_owned());
    let moved = [
        Command::Drive { drive: Drive::Manual(FocalPower::new(0.25).unwrap()), segment: None },
        Command::Drive { drive: Drive::Policy { name: PolicyName::new("fixed"), start: None }, segment: None },
    ];

    trial.conductor.focus(Role::Operator, &by_hand).await.unwrap();
    trial.conductor.focus(Role::Operator, &by_policy).await.unwrap();
    assert_eq!(trial.commanded(), moved);

    let session = trial.begin("practice").await;
    trial.commanded();
    for focus in [&by_hand, &by_policy, &Focus::Policy("unknown".to_owned()), &Focus::FocalPower(2.0)] {
        let refused = trial.conductor.focus(Role::Operator, focus).await;
        assert!(matches!(refused, Err(ConductError::Conflict(_))), "{focus:?}");
    }
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "over".to_owned() }).await.unwrap();
    trial.commanded();
    let refused = trial.conductor.focus(Role::Operator, &by_policy).await;
    assert!(matches!(refused, Err(ConductError::Conflict(_))), "an ended session is still on the screens");
    assert_eq!(trial.commanded(), []);

    trial.conductor.dismiss(Role::Operator, session).unwrap();
    trial.conductor.focus(Role::Operator, &by_hand).await.unwrap();
    assert_eq!(trial.commanded(), moved[..1]);
}

#[tokio::test]
async fn nobody_but_the_operator_moves_the_lens_and_only_to_where_it_can_go() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    for role in [Role::Surgeon, Role::Researcher, Role::System] {
        let refused = trial.conductor.focus(role, &Focus::FocalPower(0.25)).await;
        assert!(matches!(refused, Err(ConductError::Forbidden(_))), "{role:?}");
    }

    let unknown = trial.conductor.focus(Role::Operator, &Focus::Policy("unknown".to_owned())).await;
    assert!(matches!(unknown, Err(ConductError::NotFound(_))));
    for value in [f64::NAN, -0.1, 1.1] {
        let invalid = trial.conductor.focus(Role::Operator, &Focus::FocalPower(value)).await;
        assert!(matches!(invalid, Err(ConductError::Invalid(_))), "{value}");
    }
    assert_eq!(trial.commanded(), []);
}

/// Two operators: one still moves the lens after an abort, and the other prepares the next session.
#[tokio::test]
async fn a_movement_by_hand_while_the_next_session_is_made_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let aborted = trial.begin("practice").await;
    trial.conductor.act(Role::Operator, aborted, Action::Abort { reason: "smoke".to_owned() }).await.unwrap();

    // Another program locks the database, so that the next session takes a while to reach the disk.
    let database = crate::storage::raw(folder.path()).await;
    let other_program = database.begin_with("BEGIN IMMEDIATE").await.unwrap();
    let conductor = trial.conductor.clone();
    let making = tokio::spawn(async move { conductor.create(Role::Operator, PARTICIPANT, "practice", None).await });
    while trial.store.writes().under_way_for().is_none() {
        tokio::task::yield_now().await;
    }
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(0.3)).await.unwrap();
    other_program.rollback().await.unwrap();
    let next = making.await.unwrap().unwrap();

    assert_eq!(trial.view().session, next);
    let events = trial.store.reader().events(aborted).await.unwrap();
    assert_eq!(events.last().unwrap().1.kind.focal_power(), Some(FocalPower::new(0.3).unwrap()));
}
