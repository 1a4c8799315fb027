//! What each role may do and see outside the course of a session. For actions within it, see
//! [`session::decide`](super::session::decide).

use std::time::Duration;

use super::action::Action;
use super::phase::Phase;
use super::refusal::Refusal;
use super::role::Role;

/// A request that is not part of the course of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Make a session and draw its order.
    MakeSession,
    /// Close a session: remove it from the screens.
    CloseSession,
    /// Add a participant.
    AddParticipant,
    /// Move the lens, or let a policy control it.
    MoveLens,
    /// Choose what is to be in focus, outside sessions.
    PlacePatch,
    /// See spectra of the live picture.
    SeeSpectra,
}

/// The state of the current session, in as much detail as these rules need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurrentSession {
    /// There is no session, or it was closed.
    None,
    /// A session was made and has not ended. It may not have started yet.
    UnderWay,
    /// A session has ended, and nobody has closed it yet.
    Ended,
}

impl CurrentSession {
    /// The state for a session in `phase`; `None` means that there is no session.
    pub const fn of(phase: Option<Phase>) -> Self {
        match phase {
            None => Self::None,
            Some(phase) if phase.has_ended() => Self::Ended,
            Some(_) => Self::UnderWay,
        }
    }
}

/// Checks whether `by` may make `request` while the session is in the state `current`.
///
/// # Errors
/// If `by` may not make this request, or `current` does not allow it.
pub fn check(by: Role, request: Request, current: CurrentSession) -> Result<(), Refusal> {
    let (who, fits) = match request {
        Request::MakeSession | Request::CloseSession | Request::MoveLens | Request::SeeSpectra => {
            ("the operator", by == Role::Operator)
        }
        Request::PlacePatch => ("the surgeon or the operator", matches!(by, Role::Surgeon | Role::Operator)),
        Request::AddParticipant => ("the operator or a researcher", matches!(by, Role::Operator | Role::Researcher)),
    };
    if !fits {
        return Err(Refusal::only(who));
    }

    match (request, current) {
        (Request::MakeSession, CurrentSession::UnderWay) => {
            Err(Refusal::conflict("a session is under way; complete or abort it first"))
        }
        (Request::CloseSession, CurrentSession::UnderWay) => {
            Err(Refusal::conflict("the session is under way; abort it to end it"))
        }
        (Request::PlacePatch, CurrentSession::UnderWay | CurrentSession::Ended) => {
            Err(Refusal::not_now("refused-under-way"))
        }
        // This also holds after the end: the surgeon still sees the view, and may still be answering questions.
        (Request::MoveLens, CurrentSession::UnderWay | CurrentSession::Ended) => {
            Err(Refusal::conflict("a session is under way and controls the lens until it is closed"))
        }
        // Numbers of the picture could help to tell policies apart, as the focal power does. Hidden for as long.
        (Request::SeeSpectra, CurrentSession::UnderWay | CurrentSession::Ended) => Err(Refusal::conflict(
            "a session is under way; spectra of the live picture are shown again once it is closed",
        )),
        _ => Ok(()),
    }
}

/// Why the patch follows the tissue only outside sessions.
const OUTSIDE_SESSIONS: &str = "the patch follows the tissue only outside sessions: when it is lost depends on how sharp \
                                the picture is, which would tell the policies apart";

/// Checks whether `by` may decide that the patch follows the tissue, in a session if `in_session` is set.
///
/// # Errors
/// If `by` is not the operator, or it would happen in a session.
pub fn check_following(by: Role, in_session: bool) -> Result<(), Refusal> {
    if in_session {
        return Err(Refusal::Invalid(OUTSIDE_SESSIONS.to_owned()));
    }
    if by != Role::Operator {
        return Err(Refusal::Invalid("only the operator decides whether the patch follows the tissue".to_owned()));
    }
    Ok(())
}

/// Checks whether `action` is possible on a session that is closed.
///
/// # Errors
/// If the action must come before the session is closed.
pub fn check_while_on_screen(action: &Action) -> Result<(), Refusal> {
    match action {
        Action::GiveReason { .. } => Err(Refusal::conflict("the session is closed; a reason can be given until then")),
        _ => Ok(()),
    }
}

/// Whether `role` may see the focal power on the live view, and everything else there that distinguishes policies:
/// which policy runs, its focus metric, its belief, and how long its steps take. The surgeon never may. The others may
/// not until the session is closed, because they can talk to the surgeon. Where the session has left the lens stays
/// hidden even then; the control loop says for how long.
pub fn may_see_focal_power(role: Role, current: CurrentSession) -> bool {
    role != Role::Surgeon && current == CurrentSession::None
}

/// Whether `role` may see the focus metric of a session's steps afterwards. The metric's scale reveals the policy.
pub fn may_see_metric(role: Role, unblinded: bool) -> bool {
    role == Role::Researcher && unblinded
}

/// Checks whether `role` may play a session's recording. The moving picture shows how the policy searched, as the focal
/// path does. Unlike the path, nobody needs it before unblinding. The rule is the same for practice sessions, so that
/// one rule holds for all.
///
/// # Errors
/// If `role` is not the researcher, or the session is still blinded.
pub fn check_playing(role: Role, unblinded: bool) -> Result<(), Refusal> {
    match (role, unblinded) {
        (Role::Researcher, true) => Ok(()),
        (Role::Researcher, false) => Err(Refusal::conflict(
            "the picture shows how the policy focused, so a recording can be played only once its session is unblinded",
        )),
        _ => Err(Refusal::only("the researcher")),
    }
}

/// Checks whether a session's comments, answers and recordings may be read. They may not after its participant has
/// withdrawn. The audit trail stays readable: that the session took place, and what was done to it.
///
/// # Errors
/// If the participant withdrew.
pub fn check_reading(withdrawn: bool) -> Result<(), Refusal> {
    if withdrawn {
        return Err(Refusal::conflict(
            "the participant withdrew, so the comments, answers and recordings of this session are no longer shown; \
             its audit trail stays",
        ));
    }
    Ok(())
}

/// A hold that lasts this long is not a slow start but a fault. The operator must know about it.
const LASTING: Duration = Duration::from_secs(3);

/// How much about a hold of the lens may be shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HoldTold {
    /// The hold and its reason.
    Fully,
    /// That there is a hold, but not its reason.
    WithoutReason,
    /// Nothing.
    Not,
}

/// How much may be shown, while a session is under way, about a hold that has lasted for `held_for`. A hold that the
/// policy caused is shown only if it lasts, and then without its reason. Otherwise it could reveal the policy, because
/// only learned policies take time to start and to compute.
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

    const REQUESTS: [Request; 5] =
        [Request::MakeSession, Request::CloseSession, Request::AddParticipant, Request::MoveLens, Request::SeeSpectra];

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
                let adds = request == Request::AddParticipant;
                let may = role == Role::Operator || (role == Role::Researcher && adds);
                let who = if adds { "the operator or a researcher" } else { "the operator" };
                let checked = check(role, request, CurrentSession::None);
                let expected = if may { Ok(()) } else { Err(Refusal::only(who)) };
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
    fn spectra_of_the_live_picture_are_seen_whenever_the_focal_power_is() {
        let states = PHASES.map(Some).into_iter().chain([None]).map(CurrentSession::of);
        for current in states {
            let seen = check(Role::Operator, Request::SeeSpectra, current).is_ok();
            assert_eq!(seen, may_see_focal_power(Role::Operator, current), "{current:?}");
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
