//! The rules for unblinding a session.

use super::action::Action;
use super::balanced_set::BalancedSet;
use super::event::EventKind;
use super::grace::Outstanding;
use super::refusal::Refusal;
use super::role::Role;
use super::session::{SessionState, decide};
use super::study::definition::StudyName;
use super::study::state::check_names_no_policy;
use parfocal_base::PolicyName;
use parfocal_base::clock::Moment;
use parfocal_base::ids::SessionId;

/// Facts besides the session's own state that an action depends on. Only unblinding needs all of them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Circumstances {
    /// Sessions that share the session's seed, including the session itself; none if the action is not unblinding.
    pub set: Option<BalancedSet>,
    /// What may still arrive for the session and would not count after unblinding; none if there is nothing.
    pub outstanding: Option<Outstanding>,
    /// The session's study, if it belongs to one that is not unblinded yet; none if the action needs no circumstances.
    pub study: Option<BlindedStudy>,
}

/// A blinded study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BlindedStudy {
    /// Name of the study.
    pub name: StudyName,
    /// Policies that the study compares.
    pub policies: Vec<PolicyName>,
    /// Whether a person signed for the emergency in which a single session is to be unblinded.
    pub signed: bool,
    /// Whether one of its sessions was unblinded in an emergency, so that somebody knows an order.
    pub order_known: bool,
}

impl BlindedStudy {
    /// Checks that `words`, a "reason" or a "note" as `what` says, name no policy once somebody knows an order, because
    /// blinded exports show them.
    ///
    /// # Errors
    /// If they name a policy of the study, and one of its sessions was unblinded.
    pub fn check_words(&self, what: &str, words: &str) -> Result<(), Refusal> {
        if self.order_known { check_names_no_policy(what, words, &self.policies) } else { Ok(()) }
    }
}

impl Circumstances {
    /// The events that `action` by `by` on `session` causes at `now`. Empty if the action was done before.
    ///
    /// # Errors
    /// If `by` may not do this, or the action does not fit the state of the session or these circumstances.
    pub fn decide(
        &self,
        session: SessionId,
        state: &SessionState,
        by: Role,
        action: &Action,
        now: Moment,
    ) -> Result<Vec<EventKind>, Refusal> {
        // Checks the role first: a person who may not unblind learns nothing about other sessions.
        let mut events = decide(state, by, action, now)?;

        if let Action::Unblind { despite_outstanding, reason } = action
            && !events.is_empty()
        {
            self.check_study(reason)?;
            self.check_unblinding(session, *despite_outstanding)?;
        }

        if let Action::GiveReason { reason, .. } = action
            && let Some(study) = &self.study
        {
            study.check_words("reason", reason)?;
        }

        // In a study, unblinding a single session is always an emergency, even after the session's end.
        for event in &mut events {
            if let EventKind::Unblinded { emergency, .. } = event {
                *emergency |= self.study.is_some();
            }
        }
        Ok(events)
    }

    fn check_study(&self, reason: &str) -> Result<(), Refusal> {
        let Some(study) = &self.study else { return Ok(()) };
        if !study.signed {
            return Err(Refusal::Invalid(format!(
                "the session belongs to study {}; unblinding it alone is an emergency: say who does it (person)",
                study.name
            )));
        }
        check_names_no_policy("reason", reason, &study.policies)
    }

    fn check_unblinding(&self, session: SessionId, despite_outstanding: bool) -> Result<(), Refusal> {
        if let Some(set) = &self.set {
            set.check_unblinding(session)?;
        }

        match &self.outstanding {
            Some(outstanding) if !despite_outstanding => Err(Refusal::Conflict(format!(
                "{outstanding}; to unblind all the same, confirm it (despite_outstanding)"
            ))),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use jiff::Timestamp;
    use uuid::Uuid;

    use super::*;
    use crate::allocation::Seed;
    use crate::balanced_set::Member;
    use crate::event::Event;
    use crate::phase::SessionStatus;
    use crate::protocol::Protocol;

    const SESSION: SessionId = SessionId(Uuid::from_u128(1));
    const OTHER: SessionId = SessionId(Uuid::from_u128(2));

    fn now() -> Moment {
        Moment::from_nanos(1)
    }

    /// The state of a session after the events `kinds`.
    fn state(kinds: impl IntoIterator<Item = EventKind>) -> SessionState {
        let paper = Protocol::parse_kept(include_str!("../../../trial-protocols/paper.toml"), "paper.toml").unwrap();
        let mut state = SessionState::new(Arc::new(paper), Vec::new());
        for (kind, number) in kinds.into_iter().zip(1..) {
            state.apply(&Event {
                number,
                by: Role::System,
                account: None,
                at: now(),
                wall: Timestamp::UNIX_EPOCH,
                kind,
            });
        }
        state
    }

    fn completed() -> SessionState {
        state([EventKind::Created, EventKind::Started, EventKind::Completed])
    }

    fn unblind(despite_outstanding: bool) -> Action {
        Action::Unblind { reason: "the study is over".to_owned(), despite_outstanding }
    }

    fn member(session: SessionId, place: usize, status: SessionStatus) -> Member {
        let made = Timestamp::UNIX_EPOCH;
        Member { session, participant: "S-01".to_owned(), made, place, status, unblinded: false, withdrawn: false }
    }

    /// Circumstances in which another session of the set is under way.
    fn other_under_way() -> Circumstances {
        let members = vec![member(SESSION, 0, SessionStatus::Completed), member(OTHER, 1, SessionStatus::UnderWay)];
        Circumstances { set: Some(BalancedSet { seed: Seed([7; 32]), members }), outstanding: None, study: None }
    }

    /// Circumstances in which a surgeon's device has not reported that it holds nothing more.
    fn device_silent() -> Circumstances {
        Circumstances { outstanding: Some(Outstanding { counts_until: None, devices: 1 }), ..Circumstances::default() }
    }

    fn decided(
        circumstances: &Circumstances,
        state: &SessionState,
        by: Role,
        action: &Action,
    ) -> Result<usize, Refusal> {
        circumstances.decide(SESSION, state, by, action, now()).map(|events| events.len())
    }

    #[test]
    fn a_session_is_unblinded_where_nothing_stands_against_it() {
        assert_eq!(decided(&Circumstances::default(), &completed(), Role::Researcher, &unblind(false)), Ok(1));
    }

    #[test]
    fn a_session_is_not_unblinded_where_its_order_would_tell_another() {
        for despite_outstanding in [false, true] {
            let refused =
                decided(&other_under_way(), &completed(), Role::Researcher, &unblind(despite_outstanding)).unwrap_err();
            assert!(refused.to_string().contains("same balanced set"), "{refused}");
        }
    }

    #[test]
    fn what_is_outstanding_refuses_unblinding_until_it_is_confirmed() {
        let refused = decided(&device_silent(), &completed(), Role::Researcher, &unblind(false)).unwrap_err();
        assert!(refused.to_string().contains("despite_outstanding"), "{refused}");
        assert_eq!(decided(&device_silent(), &completed(), Role::Researcher, &unblind(true)), Ok(1));
    }

    #[test]
    fn who_may_not_unblind_learns_nothing_of_other_sessions() {
        for by in [Role::Surgeon, Role::Operator, Role::System] {
            let refused = decided(&other_under_way(), &completed(), by, &unblind(false)).unwrap_err();
            assert_eq!(refused, Refusal::only("the researcher"), "{by:?}");
        }
    }

    #[test]
    fn what_was_unblinded_before_and_other_actions_ask_for_no_circumstances() {
        let emergency = false;
        let unblinded = EventKind::Unblinded { reason: "over".to_owned(), emergency };
        let done = state([EventKind::Created, EventKind::Started, EventKind::Completed, unblinded]);
        assert_eq!(decided(&other_under_way(), &done, Role::Researcher, &unblind(false)), Ok(0));

        let ready = state([EventKind::Created]);
        assert_eq!(decided(&other_under_way(), &ready, Role::Operator, &Action::Start), Ok(1));
    }
}
