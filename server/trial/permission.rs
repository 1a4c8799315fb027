//! Who may do and see what outside the course of a session. Who may do what within it:
//! [`session::decide`](super::session::decide).

use std::time::Duration;

use super::phase::Phase;
use super::refusal::Refusal;
use super::role::Role;

/// Something that people ask for outside the course of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// To make a session and draw its order.
    MakeSession,
    /// To take a session off the screens.
    CloseSession,
    /// To add a participant.
    AddParticipant,
    /// To move the lens, or to put a policy in charge of it.
    MoveLens,
}

/// Whether there is a session now, as far as these rules ask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurrentSession {
    /// None, or it was closed.
    None,
    /// It was made and has not ended; it may not have started yet.
    UnderWay,
    /// It has ended, and nobody has closed it yet.
    Ended,
}

impl CurrentSession {
    /// For a session in `phase`, if there is one.
    #[must_use]
    pub const fn of(phase: Option<Phase>) -> Self {
        match phase {
            None => Self::None,
            Some(phase) if phase.has_ended() => Self::Ended,
            Some(_) => Self::UnderWay,
        }
    }
}

/// Whether `by` may do as `request` says, `current` being the session there is.
///
/// # Errors
/// When another role does this, or it does not fit `current`.
pub fn check(by: Role, request: Request, current: CurrentSession) -> Result<(), Refusal> {
    let is_theirs = match request {
        Request::MakeSession | Request::CloseSession | Request::MoveLens => by == Role::Operator,
        Request::AddParticipant => matches!(by, Role::Operator | Role::Researcher),
    };

    if !is_theirs {
        return Err(Refusal::only("the operator"));
    }

    match (request, current) {
        (Request::MakeSession, CurrentSession::UnderWay) => {
            Err(Refusal::conflict("a session is under way; complete or abort it first"))
        }
        (Request::CloseSession, CurrentSession::UnderWay) => {
            Err(Refusal::conflict("the session is under way; abort it to end it"))
        }
        // After the end as well: the surgeon still sees the view, and may still be answering.
        (Request::MoveLens, CurrentSession::UnderWay | CurrentSession::Ended) => {
            Err(Refusal::conflict("A session is under way: it decides who focuses until it is closed."))
        }
        _ => Ok(()),
    }
}

/// Whether `role` may see the focal power on the live view, and everything else there that tells
/// policies apart: which policy runs, its focus metric, its belief, and how long its steps take.
/// The surgeon never may. Nobody may until the session is closed, because operator and researcher
/// can talk to the surgeon.
#[must_use]
pub fn may_see_focal_power(role: Role, current: CurrentSession) -> bool {
    role != Role::Surgeon && current == CurrentSession::None
}

/// Whether `role` may see the focus metric of a session's steps afterwards: its scale names the policy.
#[must_use]
pub fn may_see_metric(role: Role, unblinded: bool) -> bool {
    role == Role::Researcher && unblinded
}

/// Whether `role` may play a session's recording. The moving picture shows how the policy searched, as the focal path
/// does; unlike the path, nobody needs it before the policies are told. Practice is no exception, so that one rule
/// holds for all sessions.
///
/// # Errors
/// When `role` is not the researcher, or the session is still blinded.
pub fn check_playing(role: Role, unblinded: bool) -> Result<(), Refusal> {
    match (role, unblinded) {
        (Role::Researcher, true) => Ok(()),
        (Role::Researcher, false) => Err(Refusal::conflict(
            "the picture shows how the policy focused, so a recording is played only once its session is unblinded",
        )),
        _ => Err(Refusal::only("the researcher")),
    }
}

/// Whether what was said, answered and recorded in a session may be read: not once its participant has withdrawn. That
/// the session took place, and what was done to it, stays readable in its audit trail.
///
/// # Errors
/// When the participant withdrew.
pub fn check_reading(withdrawn: bool) -> Result<(), Refusal> {
    if withdrawn {
        return Err(Refusal::conflict(
            "the participant withdrew, so what was said, answered and recorded in this session is shown no more; its \
             audit trail stays",
        ));
    }
    Ok(())
}

/// A hold that lasts this long is not a slow start, but a fault that the operator must know of.
const LASTING: Duration = Duration::from_secs(3);

/// What of a hold of the lens may be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HoldTold {
    /// The hold and its reason.
    Fully,
    /// That there is one, but not why.
    WithoutReason,
    /// Nothing.
    Not,
}

/// What may be told, while a session is under way, of a hold that has lasted for `held_for`. A hold
/// by the policy is told only when it lasts, and then without its reason: only learned policies take
/// time to start and to compute.
#[must_use]
pub fn hold_told(caused_by_policy: bool, held_for: Duration) -> HoldTold {
    if !caused_by_policy {
        HoldTold::Fully
    } else if held_for < LASTING {
        HoldTold::Not
    } else {
        HoldTold::WithoutReason
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROLES: [Role; 4] = [Role::Surgeon, Role::Operator, Role::Researcher, Role::System];

    const REQUESTS: [Request; 4] =
        [Request::MakeSession, Request::CloseSession, Request::AddParticipant, Request::MoveLens];

    const PHASES: [Phase; 7] = [
        Phase::Ready,
        Phase::Notice,
        Phase::Inspecting,
        Phase::Questions,
        Phase::Closing,
        Phase::Completed,
        Phase::Aborted,
    ];

    #[test]
    fn a_session_is_under_way_from_when_it_is_made_until_its_last_answer_or_an_abort() {
        assert_eq!(CurrentSession::of(None), CurrentSession::None);
        for phase in PHASES {
            let ended = matches!(phase, Phase::Completed | Phase::Aborted);
            let expected = if ended { CurrentSession::Ended } else { CurrentSession::UnderWay };
            assert_eq!(CurrentSession::of(Some(phase)), expected, "{phase:?}");
        }
    }

    #[test]
    fn only_the_operator_does_these_but_the_researcher_adds_participants_too() {
        for request in REQUESTS {
            for role in ROLES {
                let may = role == Role::Operator || (role == Role::Researcher && request == Request::AddParticipant);
                let checked = check(role, request, CurrentSession::None);
                let expected = if may { Ok(()) } else { Err(Refusal::only("the operator")) };
                assert_eq!(checked, expected, "{role:?} {request:?}");
            }
        }
    }

    #[test]
    fn the_operator_moves_the_lens_only_when_there_is_no_session_or_it_is_closed() {
        let moves = |current| check(Role::Operator, Request::MoveLens, current);
        assert_eq!(moves(CurrentSession::None), Ok(()));
        for phase in PHASES {
            let refused = moves(CurrentSession::of(Some(phase)));
            assert!(
                matches!(refused, Err(Refusal::Conflict(text)) if text.contains("until it is closed")),
                "{phase:?}"
            );
        }
    }

    #[test]
    fn nobody_sees_the_focal_power_during_a_session_and_the_surgeon_never_does() {
        for role in ROLES {
            assert_eq!(may_see_focal_power(role, CurrentSession::None), role != Role::Surgeon, "{role:?}");
            for phase in PHASES {
                assert!(!may_see_focal_power(role, CurrentSession::of(Some(phase))), "{role:?} {phase:?}");
            }
        }
    }

    #[test]
    fn only_the_researcher_plays_a_recording_or_sees_the_metric_and_only_after_unblinding() {
        for role in ROLES {
            assert_eq!(check_playing(role, true).is_ok(), role == Role::Researcher, "{role:?}");
            assert_eq!(may_see_metric(role, true), role == Role::Researcher, "{role:?}");
            assert!(check_playing(role, false).is_err() && !may_see_metric(role, false), "{role:?}");
        }
        let blinded = check_playing(Role::Researcher, false);
        assert!(matches!(blinded, Err(Refusal::Conflict(text)) if text.contains("once its session is unblinded")));
    }

    #[test]
    fn nobody_reads_what_was_said_in_a_withdrawn_session() {
        assert_eq!(check_reading(false), Ok(()));
        assert!(matches!(check_reading(true), Err(Refusal::Conflict(text)) if text.contains("withdrew")));
    }

    #[test]
    fn a_session_is_made_after_the_end_of_the_one_before_and_closed_after_its_own() {
        for request in [Request::MakeSession, Request::CloseSession] {
            let asked = |current| check(Role::Operator, request, current);
            assert!(matches!(asked(CurrentSession::UnderWay), Err(Refusal::Conflict(_))), "{request:?}");
            assert_eq!(asked(CurrentSession::Ended), Ok(()), "{request:?}");
        }
    }
}
