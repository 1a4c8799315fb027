//! Balanced orders: the sets of sessions that share a seed.

use std::collections::BTreeSet;
use std::path::Path;

use parfocal_base::ids::SessionId;
use parfocal_records::store::NewSession;
use parfocal_trial::action::Action;
use parfocal_trial::role::Role;

use crate::fixture::Trial;

/// Writes the paper's protocol with balanced order into `folder`.
fn balanced(folder: &Path) {
    let paper = include_str!("../../trial-protocols/paper.toml");
    let text = paper.replace("name = \"paper\"", "name = \"balanced\"").replace("\"shuffled\"", "\"balanced\"");
    std::fs::write(folder.join("balanced.toml"), text).unwrap();
}

async fn made(trial: &Trial, session: SessionId) -> NewSession {
    trial.store.reader().session(session).await.unwrap().unwrap().made
}

async fn session_that_is_left(trial: &Trial) -> NewSession {
    let session = trial.begin("balanced").await;
    let made = made(trial, session).await;
    let abort = Action::Abort { reason: "to make room".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
    made
}

#[tokio::test]
async fn six_sessions_are_a_balanced_set_and_the_seventh_begins_another() {
    let folder = tempfile::tempdir().unwrap();
    balanced(folder.path());
    let mut trial = Trial::start_with(folder.path(), Some(folder.path()), 3).await;
    let mut sessions = Vec::new();
    for _ in 0..7 {
        let session = trial.whole_session("balanced").await;
        sessions.push(made(&trial, session).await);
    }

    let (set, next) = sessions.split_at(6);
    assert!(set.iter().all(|session| session.seed == set[0].seed));
    assert_eq!(set.iter().map(|session| session.set_index).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
    assert!(next[0].seed != set[0].seed && next[0].set_index == 0);
    for position in 0..6 {
        let policies: Vec<&str> = set.iter().map(|session| session.segments[position].1.as_str()).collect();
        for policy in ["mgm-hill-climber", "mgm-learned", "cnn-learned"] {
            assert_eq!(policies.iter().filter(|name| **name == policy).count(), 2, "position {position}");
        }
    }

    let segments: BTreeSet<_> = sessions.iter().flat_map(|session| &session.segments).map(|(id, _)| *id).collect();
    assert_eq!(segments.len(), 7 * 6);
}

#[tokio::test]
async fn an_aborted_session_gives_its_place_back() {
    let folder = tempfile::tempdir().unwrap();
    balanced(folder.path());
    let trial = Trial::start_with(folder.path(), Some(folder.path()), 3).await;
    let first = session_that_is_left(&trial).await;
    let second = session_that_is_left(&trial).await;
    assert!(second.seed == first.seed && second.set_index == 0);
    assert_ne!(first.commitment, second.commitment);
}

#[tokio::test]
async fn unblinding_closes_the_set_and_its_seed_is_revealed_when_all_are_unblinded() {
    let folder = tempfile::tempdir().unwrap();
    balanced(folder.path());
    let mut trial = Trial::start_with(folder.path(), Some(folder.path()), 3).await;
    let first = trial.whole_session("balanced").await;
    let second = trial.whole_session("balanced").await;
    trial.unblind(first).await;
    let seed = made(&trial, first).await.seed;
    assert!(!trial.store.reader().balanced_set(seed).await.unwrap().may_tell_seed());
    let third = trial.whole_session("balanced").await;
    assert!(made(&trial, third).await.seed != seed, "the order of the first tells those of its set apart");
    trial.unblind(second).await;
    assert!(trial.store.reader().balanced_set(seed).await.unwrap().may_tell_seed());
}

#[tokio::test]
async fn a_session_under_way_is_not_unblinded_by_another_of_its_set() {
    let folder = tempfile::tempdir().unwrap();
    balanced(folder.path());
    let trial = Trial::start_with(folder.path(), Some(folder.path()), 3).await;
    let left = session_that_is_left(&trial).await.session;
    // It takes the place that was freed, and so has the same order.
    let second = trial.begin("balanced").await;
    let unblind = || {
        trial.conductor.act(
            Role::Researcher,
            left,
            Action::Unblind { reason: "to see".to_owned(), despite_outstanding: true },
        )
    };

    let refused = unblind().await.unwrap_err();
    assert!(refused.to_string().contains("same balanced set"), "{refused}");
    trial.conductor.act(Role::Operator, second, Action::Abort { reason: "over".to_owned() }).await.unwrap();
    unblind().await.unwrap();
}

#[tokio::test]
async fn an_aborted_session_does_not_unblind_the_one_in_its_place() {
    let folder = tempfile::tempdir().unwrap();
    balanced(folder.path());
    let mut trial = Trial::start_with(folder.path(), Some(folder.path()), 3).await;
    let left = session_that_is_left(&trial).await.session;
    let second = trial.whole_session("balanced").await;
    let one = made(&trial, left).await;
    let other = made(&trial, second).await;
    assert!(one.segments.iter().zip(&other.segments).all(|(one, other)| one.1 == other.1), "both have the same order");
    let refused = trial
        .conductor
        .act(Role::Researcher, left, Action::Unblind { reason: "to see".to_owned(), despite_outstanding: true })
        .await
        .unwrap_err();

    assert!(refused.to_string().contains("unblind that one first"), "{refused}");
    trial.unblind(second).await;
    trial.unblind(left).await;
}

#[tokio::test]
async fn a_fixed_seed_makes_other_practice_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let first = trial.begin("practice").await;
    trial.conductor.act(Role::Operator, first, Action::Abort { reason: "restart".to_owned() }).await.unwrap();
    drop(trial);
    let trial = Trial::start(folder.path()).await;
    let second = trial.begin("practice").await;
    assert_ne!(first, second);
    assert!(made(&trial, first).await.seed != made(&trial, second).await.seed);
}
