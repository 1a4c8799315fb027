//! Decides what an action causes: the events to record, no events if it was done before, or a refusal. This includes
//! the decision which role may do what.

use std::time::Duration;

use super::{PauseCause, SessionState};
use crate::action::Action;
use crate::answers::is_whole;
use crate::event::EventKind;
use crate::phase::Phase;
use crate::pointing::{Choice, Touch};
use crate::question::Question;
use crate::reason;
use crate::refusal::{Refusal, RefusalKind};
use crate::role::Role;
use crate::tablet::{Presence, WhenAway};
use parfocal_base::clock::Moment;
use parfocal_base::ids::SegmentId;
use parfocal_base::{FocalPower, PatchPlace};
use parfocal_language::Message;

/// The events that `action` by `by` causes at `now`. Empty if the action was done before (a double click, a stale tab).
///
/// # Errors
/// If `by` may not do this, or the action does not fit the state of the session.
pub fn decide(state: &SessionState, by: Role, action: &Action, now: Moment) -> Result<Vec<EventKind>, Refusal> {
    allowed(state, by, action)?;
    match action {
        Action::Start => start(state),
        Action::Acknowledge { segment } => acknowledge(state, *segment),
        Action::FinishSegment { segment } => finish_segment(state, *segment, now),
        Action::FinishQuestions { segment: Some(segment) } => finish_questions(state, *segment),
        Action::FinishQuestions { segment: None } => finish_closing(state),
        Action::Pause { reason } => pause(state, by, reason, now),
        Action::GiveReason { event, reason } => give_reason(state, *event, reason),
        Action::HoldFocus { segment } => hold_focus(state, *segment),
        Action::ReleaseFocus { segment } => release_focus(state, *segment),
        Action::Resume => Ok(if state.paused.is_some() { vec![EventKind::Resumed] } else { Vec::new() }),
        Action::Abort { reason } => abort(state, reason, now),
        Action::Withdraw { reason } => withdraw(state, reason),
        Action::Unblind { reason, .. } => unblind(state, reason),
    }
}

/// The events that the passing of time causes: the end of a segment at its time limit.
pub fn decide_time(state: &SessionState, now: Moment) -> Vec<EventKind> {
    if !state.running() || state.inspected(now) < state.protocol.segment_limit {
        return Vec::new();
    }
    state.segment().map_or_else(Vec::new, |segment| finish(state, segment, state.protocol.segment_limit))
}

/// The events that are caused when `by` moves the lens to `focal_power` by hand. `left_at` is where the lens is, if
/// nobody has moved it by hand since the session was stopped.
///
/// # Errors
/// If `by` may not do this, or the session is neither paused nor aborted.
pub fn decide_by_hand(
    state: &SessionState,
    by: Role,
    focal_power: FocalPower,
    left_at: Option<FocalPower>,
) -> Result<Vec<EventKind>, Refusal> {
    if by != Role::Operator {
        return Err(Refusal::only("the operator"));
    }
    if !state.may_be_focused_by_hand() {
        return Err(Refusal::conflict(
            "a session is under way and controls the lens until it is closed; pause it to focus by hand",
        ));
    }
    Ok(vec![EventKind::FocusedByHand { focal_power, left_at }])
}

/// The events that are caused when `by` chooses what is to be in focus.
///
/// # Errors
/// If `by` may not do this, the protocol does not allow it, or no setting is being inspected.
pub fn decide_choice(state: &SessionState, by: Role, choice: &Choice) -> Result<Vec<EventKind>, Refusal> {
    if !matches!(by, Role::Surgeon | Role::Operator) {
        return Err(Refusal::only("the surgeon or the operator"));
    }
    if !state.protocol.patch.is_free() {
        return Err(Refusal::not_now("refused-centre"));
    }

    let segment = state.segment().filter(|_| state.running());
    let segment = segment.ok_or_else(|| not_inspecting(state, "refused-point-not-looking"))?;
    Ok(match choice.at {
        Some(Touch { x, y }) => {
            vec![EventKind::PatchPlaced { segment, frame: choice.frame, x, y, place: choice.place }]
        }
        None if state.pointed.patch == PatchPlace::CENTRE => Vec::new(),
        None => vec![EventKind::PatchCentred { segment, frame: choice.frame }],
    })
}

/// The refusal of something that is done only while a setting is inspected. `said` names its message.
fn not_inspecting(state: &SessionState, said: &'static str) -> Refusal {
    if state.paused.is_some() { Refusal::not_now("refused-paused") } else { Refusal::not_now(said) }
}

/// The events that are caused by what the surgeon's tablets report: that none shows the page any longer, or one does
/// again. If none ever did, nothing follows, as nobody can go away who was never there.
pub fn decide_tablet(state: &SessionState, presence: Presence, now: Moment) -> Vec<EventKind> {
    if state.ended() || state.phase == Phase::Ready {
        return Vec::new();
    }

    let hidden = match presence {
        Presence::Present if state.tablet_away => return vec![EventKind::TabletBack],
        Presence::NeverSeen | Presence::Present => return Vec::new(),
        Presence::Hidden => true,
        Presence::Silent => false,
    };
    if state.tablet_away {
        return Vec::new();
    }

    let mut events = vec![EventKind::TabletAway { hidden }];
    if state.running() && state.protocol.when_tablet_away == WhenAway::Pause {
        events.push(paused_by_system(state, reason::TABLET_AWAY, now));
    }
    events
}

/// The events that are caused by a picture on the surgeon's page that is smaller than the protocol allows.
pub fn decide_small_picture(state: &SessionState, now: Moment) -> Vec<EventKind> {
    if state.running() { vec![paused_by_system(state, reason::SMALL_PICTURE, now)] } else { Vec::new() }
}

fn paused_by_system(state: &SessionState, reason: &str, now: Moment) -> EventKind {
    EventKind::Paused { reason: reason.to_owned(), inspected_ms: milliseconds(state.inspected(now)) }
}

/// The events that a restart of the server causes. `inspected` is the known time inspected in the segment.
pub fn decide_restart(state: &SessionState, inspected: Duration) -> Vec<EventKind> {
    if state.ended() || state.phase == Phase::Ready {
        return Vec::new();
    }
    let inspected = inspected.clamp(state.inspected.min(state.protocol.segment_limit), state.protocol.segment_limit);
    vec![EventKind::ServerRestarted { inspected_ms: milliseconds(inspected) }]
}

fn allowed(state: &SessionState, by: Role, action: &Action) -> Result<(), Refusal> {
    let (who, fits): (&str, bool) = match action {
        Action::Start | Action::GiveReason { .. } | Action::Abort { .. } => ("the operator", by == Role::Operator),
        Action::Pause { .. } => ("the operator or the surgeon", matches!(by, Role::Operator | Role::Surgeon)),
        Action::Acknowledge { .. } | Action::FinishQuestions { .. } => ("the surgeon", by == Role::Surgeon),
        Action::FinishSegment { .. } | Action::HoldFocus { .. } | Action::ReleaseFocus { .. } => {
            ("the surgeon or the operator", matches!(by, Role::Surgeon | Role::Operator))
        }
        Action::Resume => {
            let surgeon_may = state.paused != Some(PauseCause::Operator);
            ("the operator", by == Role::Operator || (by == Role::Surgeon && surgeon_may))
        }
        Action::Withdraw { .. } => ("the operator or the researcher", matches!(by, Role::Operator | Role::Researcher)),
        Action::Unblind { .. } => ("the researcher", by == Role::Researcher),
    };

    if fits { Ok(()) } else { Err(Refusal::only(who)) }
}

/// The phase of `segment` if it is the current one; `None` if it is already done.
///
/// # Errors
/// If the session has no such segment or has not reached it, or was aborted.
fn current(state: &SessionState, segment: SegmentId) -> Result<Option<Phase>, Refusal> {
    let position = state.position(segment).ok_or(Refusal::unknown_segment())?;
    if position < state.done {
        return Ok(None);
    }
    if state.phase == Phase::Aborted {
        return Err(Refusal::not_now("refused-aborted"));
    }
    if position > state.done || state.segment().is_none() {
        return Err(Refusal::not_now("refused-not-reached"));
    }
    Ok(Some(state.phase))
}

fn start(state: &SessionState) -> Result<Vec<EventKind>, Refusal> {
    if state.phase != Phase::Ready {
        return Ok(Vec::new());
    }
    match &state.protocol.consent {
        Some(required) if state.consented.as_ref() != Some(required) => Err(Refusal::Conflict(format!(
            "the protocol requires the participant's consent to version '{required}' of the text; record it first"
        ))),
        _ => Ok(vec![EventKind::Started]),
    }
}

fn acknowledge(state: &SessionState, segment: SegmentId) -> Result<Vec<EventKind>, Refusal> {
    match current(state, segment)? {
        Some(Phase::Notice) => {
            going_on(state)?;
            Ok(vec![EventKind::SegmentStarted { segment }])
        }
        _ => Ok(Vec::new()),
    }
}

fn finish_segment(state: &SessionState, segment: SegmentId, now: Moment) -> Result<Vec<EventKind>, Refusal> {
    match current(state, segment)? {
        Some(Phase::Notice) => Err(Refusal::not_now("refused-not-begun")),
        Some(Phase::Inspecting) => {
            going_on(state)?;
            Ok(finish(state, segment, state.inspected(now)))
        }
        _ => Ok(Vec::new()),
    }
}

fn finish_questions(state: &SessionState, segment: SegmentId) -> Result<Vec<EventKind>, Refusal> {
    match current(state, segment)? {
        Some(Phase::Questions) => {
            going_on(state)?;
            answered(state, Some(segment), &state.protocol.after_segment)?;
            Ok(with_completion(state, EventKind::QuestionsFinished { segment: Some(segment) }))
        }
        Some(_) => Err(Refusal::not_now("refused-not-asked")),
        None => Ok(Vec::new()),
    }
}

fn finish_closing(state: &SessionState) -> Result<Vec<EventKind>, Refusal> {
    match state.phase {
        Phase::Completed => Ok(Vec::new()),
        Phase::Closing => {
            going_on(state)?;
            answered(state, None, &state.protocol.closing)?;
            Ok(vec![EventKind::QuestionsFinished { segment: None }, EventKind::Completed])
        }
        _ => Err(Refusal::not_now("refused-closing-not-asked")),
    }
}

fn finish(state: &SessionState, segment: SegmentId, inspected: Duration) -> Vec<EventKind> {
    let finished = EventKind::SegmentFinished { segment, inspected_ms: milliseconds(inspected) };
    if state.protocol.after_segment.is_empty() { with_completion(state, finished) } else { vec![finished] }
}

/// The event `last`, which ends the current segment, and the session's completion if nothing follows.
fn with_completion(state: &SessionState, last: EventKind) -> Vec<EventKind> {
    let completes = state.done + 1 == state.segments.len() && state.protocol.closing.is_empty();
    let mut events = vec![last];
    events.extend(completes.then_some(EventKind::Completed));
    events
}

fn pause(state: &SessionState, by: Role, reason: &str, now: Moment) -> Result<Vec<EventKind>, Refusal> {
    match state.phase {
        Phase::Ready => return Err(Refusal::not_now("refused-not-started")),
        Phase::Completed | Phase::Aborted => return Err(Refusal::not_now("refused-ended")),
        _ => {}
    }

    // The operator's pause stands above every other, because the surgeon cannot end it.
    let paused_enough = match by {
        Role::Operator => state.paused == Some(PauseCause::Operator),
        _ => state.paused.is_some(),
    };
    if paused_enough {
        return Ok(Vec::new());
    }
    let reason = reason::optional(reason)?;
    Ok(vec![EventKind::Paused { reason, inspected_ms: milliseconds(state.inspected(now)) }])
}

fn give_reason(state: &SessionState, event: u32, reason: &str) -> Result<Vec<EventKind>, Refusal> {
    let reason = reason::needed(reason)?;
    if state.given_reasons.get(&event) == Some(&reason) {
        return Ok(Vec::new());
    }
    if !state.unreasoned.contains(&event) {
        return Err(Refusal::conflict("there is no such pause, or its reason was given"));
    }
    Ok(vec![EventKind::ReasonGiven { about: event, reason }])
}

fn hold_focus(state: &SessionState, segment: SegmentId) -> Result<Vec<EventKind>, Refusal> {
    if !state.protocol.hold {
        return Err(Refusal::not_now("refused-no-hold"));
    }
    match current(state, segment)? {
        Some(_) if state.running() => {
            Ok(if state.pointed.held { Vec::new() } else { vec![EventKind::FocusHeld { segment }] })
        }
        Some(_) => Err(not_inspecting(state, "refused-hold-not-looking")),
        None => Ok(Vec::new()),
    }
}

fn release_focus(state: &SessionState, segment: SegmentId) -> Result<Vec<EventKind>, Refusal> {
    // Whatever else ended the hold did so for this button too.
    let holds = current(state, segment)?.is_some() && state.pointed.held;
    Ok(if holds { vec![EventKind::FocusReleased { segment }] } else { Vec::new() })
}

fn abort(state: &SessionState, reason: &str, now: Moment) -> Result<Vec<EventKind>, Refusal> {
    let reason = reason::needed(reason)?;
    match state.phase {
        Phase::Completed => return Err(Refusal::conflict("the session is complete; nothing is left to abort")),
        Phase::Aborted => return Ok(Vec::new()),
        _ => {}
    }
    Ok(vec![EventKind::Aborted { reason, inspected_ms: milliseconds(state.inspected(now)) }])
}

fn withdraw(state: &SessionState, reason: &str) -> Result<Vec<EventKind>, Refusal> {
    let reason = reason::needed(reason)?;
    if state.withdrawn {
        return Ok(Vec::new());
    }
    if !state.ended() {
        return Err(Refusal::conflict("the session is under way; abort it first, then withdraw it"));
    }
    Ok(vec![EventKind::Withdrawn { reason }])
}

fn unblind(state: &SessionState, reason: &str) -> Result<Vec<EventKind>, Refusal> {
    let reason = reason::needed(reason)?;
    if state.unblinded {
        return Ok(Vec::new());
    }
    Ok(vec![EventKind::Unblinded { reason, emergency: !state.ended() }])
}

fn answered(state: &SessionState, segment: Option<SegmentId>, questions: &[Question]) -> Result<(), Refusal> {
    let whole = |question: &Question| state.answer(segment, &question.id).is_some_and(is_whole);
    let open = questions.iter().find(|question| !question.optional && !whole(question));
    open.map_or(Ok(()), |question| {
        let said = Message::new("refused-still-open").words("question", &question.text);
        Err(Refusal::Said(RefusalKind::Conflict, said))
    })
}

fn going_on(state: &SessionState) -> Result<(), Refusal> {
    if state.paused.is_some() { Err(Refusal::not_now("refused-paused")) } else { Ok(()) }
}

fn milliseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}
