//! Makes each role's view of a session. The views contain no policies.

use std::collections::BTreeMap;

use super::course::{Course, LATEST};
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;
use parfocal_trial::event::Event;
use parfocal_trial::phase::Phase;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::session::PauseCause;
use parfocal_trial::view::{LogLine, OperatorView, ReasonWanted, SurgeonView};

/// The surgeon's and the operator's view of `course` at `now`. `because` says why the last attempt to record a stop
/// failed.
pub(super) fn both(course: &Course, because: Option<&str>, now: Moment) -> (SurgeonView, OperatorView) {
    let surgeon = surgeon(course, now);
    let withdrawn = course.state.withdrawn();
    let comments = course.standing_comments();
    let readable = comments.iter().rev().filter(|_| !withdrawn).take(LATEST);
    let operator = OperatorView {
        surgeon: surgeon.clone(),
        study: course.study.clone(),
        participant: course.made.participant.clone(),
        protocol: course.made.protocol.clone(),
        consent_required: course.protocol.consent.clone(),
        consent: course.consent.clone(),
        withdrawn,
        may_focus_by_hand: course.state.may_be_focused_by_hand(),
        by_hand: course.moved_by_hand().map(FocalPower::get),
        reason_wanted: reason_wanted(course),
        unrecorded_because: because.filter(|_| course.is_unrecorded()).map(str::to_owned),
        latest_comments: readable.copied().cloned().collect(),
        log: log(course),
    };

    (surgeon, operator)
}

fn surgeon(course: &Course, now: Moment) -> SurgeonView {
    let state = &course.state;
    let inspected = state.inspected(now);
    let inspecting = state.phase() == Phase::Inspecting;
    SurgeonView {
        session: course.session(),
        phase: state.phase(),
        paused: state.paused().is_some(),
        paused_by: state.paused(),
        may_resume: state.paused().is_some_and(|cause| cause != PauseCause::Operator),
        may_pause: may_pause(course),
        unrecorded: course.is_unrecorded(),
        practice: course.made.practice,
        language: course.protocol.language,
        title: course.protocol.title.clone(),
        segment: state.segment(),
        setting: setting(course),
        settings: state.segments().len(),
        remaining_seconds: inspecting.then(|| course.protocol.segment_limit.saturating_sub(inspected).as_secs_f64()),
        prompt: course.protocol.prompt_at(inspected).filter(|_| inspecting).map(|prompt| prompt.text.clone()),
        quick_comments: course.protocol.quick_comments.clone(),
        voice: course.protocol.voice,
        pointing: course.protocol.patch.is_free(),
        holding: course.protocol.hold,
        focus_held: state.focus_held(),
        questions: state.questions().to_vec(),
        answers: answers(course),
        comments: course.standing_comments().len(),
        said: if state.phase() == Phase::Closing { comments_by_setting(course) } else { Vec::new() },
    }
}

/// What the surgeon said in words of each setting, so that the closing questions can recall it.
fn comments_by_setting(course: &Course) -> Vec<Vec<String>> {
    let mut settings = vec![Vec::new(); course.state.segments().len()];
    for comment in course.standing_comments() {
        let (CommentContent::Text(text) | CommentContent::Quick(text)) = &comment.said else { continue };
        let place = comment.setting.and_then(|setting| settings.get_mut(setting.checked_sub(1)?));
        if let Some(words) = place.filter(|_| !text.is_empty()) {
            words.push(text.clone());
        }
    }
    settings
}

/// Whether the surgeon can pause the session now.
fn may_pause(course: &Course) -> bool {
    let phase = course.state.phase();
    phase != Phase::Ready && !phase.has_ended() && course.state.paused().is_none()
}

/// The latest pause without a reason.
fn reason_wanted(course: &Course) -> Option<ReasonWanted> {
    let number = *course.state.unreasoned().last()?;
    let event = course.events.iter().find(|event| event.number == number)?;
    Some(ReasonWanted { event: number, by: event.by, at: event.wall })
}

/// Number of the current setting, from 1; at the end, of the last one. 0 before the start.
fn setting(course: &Course) -> usize {
    let state = &course.state;
    match state.phase() {
        Phase::Ready => 0,
        Phase::Notice | Phase::Inspecting | Phase::Questions => state.done() + 1,
        Phase::Closing | Phase::Completed | Phase::Aborted => state.done().min(state.segments().len()),
    }
}

fn answers(course: &Course) -> BTreeMap<String, AnswerValue> {
    let state = &course.state;
    let kept = |id: &String| state.answer(state.segment(), id).cloned();
    state.questions().iter().filter_map(|question| Some((question.id.clone(), kept(&question.id)?))).collect()
}

/// The latest events in words. The reason for an unblinding may name a policy, so only the researcher sees it.
fn log(course: &Course) -> Vec<LogLine> {
    let line = |event: &Event| {
        let text = event.kind.for_the_blinded().in_words(|segment| course.setting(segment));
        let unrecorded = if course.is_recorded(event.number) { "" } else { " (not recorded yet)" };
        let account = event.account.as_ref().map(ToString::to_string);
        let text = format!("{text}{unrecorded}");
        LogLine { at: event.wall, by: event.by, account, text, erasable_event: None }
    };
    // The size of the picture changes again and again on a weak network, and would push out what people did. It stands
    // beside the tablet's sign as it is now.
    let deeds = course.events.iter().rev().filter(|event| event.kind.seen().is_none());
    deeds.take(LATEST).map(line).collect()
}
