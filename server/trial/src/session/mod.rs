//! The session's state machine. Events are the only source of truth: [`SessionState::apply`] folds them into a state,
//! and [`decide`] says which events an action causes. Neither reads a clock, and neither stores anything elsewhere.
//!
//! ```text
//! Ready -Start-> Notice -Acknowledge-> Inspecting -FinishSegment, or time is up-> Questions -FinishQuestions-+
//!                  ^                                                                                          |
//!                  +------------------------------- while settings are left ---------------------------------+
//!                                                                                                             |
//!                                    Completed <-FinishQuestions- Closing <-----------------------------------+
//! ```
//! If there are no questions, their step is skipped. Every phase from Notice to Closing can be paused and aborted.

mod decide;
mod inspections;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use utoipa::ToSchema;

pub use decide::{
    decide, decide_by_hand, decide_choice, decide_restart, decide_small_picture, decide_tablet, decide_time,
};
pub use inspections::{Inspection, inspections};

use super::event::{Event, EventKind};
use super::phase::Phase;
use super::protocol::Protocol;
use super::question::{AnswerValue, Question};
use super::role::Role;
use super::standing::{GivenAnswer, counted};
use parfocal_base::PatchPlace;
use parfocal_base::clock::Moment;
use parfocal_base::ids::SegmentId;

/// What paused a session. The surgeon can resume it too, unless it was the operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PauseCause {
    /// The operator. Only the operator can resume the session.
    Operator,
    /// The surgeon.
    Surgeon,
    /// A restart of the server.
    Restart,
    /// No tablet showed the surgeon's page.
    TabletAway,
    /// The surgeon's picture was smaller than the protocol allows.
    SmallPicture,
}

/// The state of a session.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionState {
    protocol: Arc<Protocol>,
    segments: Vec<SegmentId>,
    phase: Phase,
    done: usize,
    /// Number of segments whose inspection has ended, so that their questions may be answered.
    asked: usize,
    paused: Option<PauseCause>,
    inspected: Duration,
    running_since: Option<Moment>,
    unblinded: bool,
    withdrawn: bool,
    /// Whether the last event about the surgeon's tablet says that it is away.
    tablet_away: bool,
    pointed: Pointed,
    /// Numbers of the pauses without a reason, oldest first.
    unreasoned: Vec<u32>,
    /// The reasons that were given after their pauses, by the pauses' numbers.
    given_reasons: BTreeMap<u32, String>,
    /// Numbers of the pauses whose reason was erased. They look like those that never had one.
    erased_reasons: BTreeSet<u32>,
    /// Version of the consent text that the participant consented to last.
    consented: Option<String>,
    answers: BTreeMap<(Option<SegmentId>, String), Answered>,
}

/// What people have chosen of the focus.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pointed {
    /// Place of the patch.
    patch: PatchPlace,
    /// Whether the focus is held on request.
    held: bool,
}

/// The answers to one question.
#[derive(Debug, Clone, Default, PartialEq)]
struct Answered {
    /// All answers, in the order of their arrival.
    given: Vec<GivenAnswer>,
    /// The answer that counts.
    counts: Option<AnswerValue>,
}

impl SessionState {
    /// The state of a new session by `protocol` with `segments`, in order.
    pub const fn new(protocol: Arc<Protocol>, segments: Vec<SegmentId>) -> Self {
        Self {
            protocol,
            segments,
            phase: Phase::Ready,
            done: 0,
            asked: 0,
            paused: None,
            inspected: Duration::ZERO,
            running_since: None,
            unblinded: false,
            withdrawn: false,
            tablet_away: false,
            pointed: Pointed { patch: PatchPlace::CENTRE, held: false },
            unreasoned: Vec::new(),
            given_reasons: BTreeMap::new(),
            erased_reasons: BTreeSet::new(),
            consented: None,
            answers: BTreeMap::new(),
        }
    }

    /// The state before the first event, but with the present answers, the consent, and which reasons were erased.
    #[must_use]
    pub fn before_all_events(&self) -> Self {
        let state = Self::new(Arc::clone(&self.protocol), self.segments.clone());
        Self {
            answers: self.answers.clone(),
            consented: self.consented.clone(),
            erased_reasons: self.erased_reasons.clone(),
            ..state
        }
    }

    /// The session's protocol.
    pub fn protocol(&self) -> &Protocol {
        &self.protocol
    }

    /// The session's segments, in order.
    pub fn segments(&self) -> &[SegmentId] {
        &self.segments
    }

    /// Place of `segment` in the session, from 0.
    pub fn position(&self, segment: SegmentId) -> Option<usize> {
        self.segments.iter().position(|&known| known == segment)
    }

    /// The session's phase. It does not change while the session is paused.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// What paused the session; none if it is not paused.
    pub const fn paused(&self) -> Option<PauseCause> {
        self.paused
    }

    /// Whether the operator may focus by hand: while the session is paused, and after an abort.
    pub fn may_be_focused_by_hand(&self) -> bool {
        self.phase == Phase::Aborted || (self.paused.is_some() && !self.ended())
    }

    /// Place of the patch.
    pub const fn patch(&self) -> PatchPlace {
        self.pointed.patch
    }

    /// Whether the focus is held on request.
    pub const fn focus_held(&self) -> bool {
        self.pointed.held
    }

    /// Numbers of the events of people who paused the session without giving a reason, oldest first.
    pub fn unreasoned(&self) -> &[u32] {
        &self.unreasoned
    }

    /// Whether the session was completed or aborted.
    pub const fn ended(&self) -> bool {
        self.phase.has_ended()
    }

    /// Whether the session was unblinded.
    pub const fn unblinded(&self) -> bool {
        self.unblinded
    }

    /// Whether the participant withdrew.
    pub const fn withdrawn(&self) -> bool {
        self.withdrawn
    }

    /// Records a consent to version `text_version` of the consent text.
    pub fn keep_consent(&mut self, text_version: &str) {
        self.consented = Some(text_version.to_owned());
    }

    /// Notes that the reason of pause `event` was erased, so that nobody is asked for it again.
    pub fn keep_erasure(&mut self, event: u32) {
        self.erased_reasons.insert(event);
    }

    /// Number of segments that are done, including their questions.
    pub const fn done(&self) -> usize {
        self.done
    }

    /// The current segment, from its notice to the end of its questions; none outside that.
    pub fn segment(&self) -> Option<SegmentId> {
        let under_way = matches!(self.phase, Phase::Notice | Phase::Inspecting | Phase::Questions);
        self.segments.get(self.done).copied().filter(|_| under_way)
    }

    /// Time inspected in the current segment, without pauses, and never more than the limit.
    pub fn inspected(&self, now: Moment) -> Duration {
        let running = self.running_since.map_or(Duration::ZERO, |since| now.since(since));
        (self.inspected + running).min(self.protocol.segment_limit)
    }

    /// Whether the segment's clock is running.
    pub const fn running(&self) -> bool {
        self.running_since.is_some()
    }

    /// The questions that are asked now.
    pub fn questions(&self) -> &[Question] {
        match self.phase {
            Phase::Questions => &self.protocol.after_segment,
            Phase::Closing => &self.protocol.closing,
            _ => &[],
        }
    }

    /// The answer to `question` that counts. The question was asked after `segment`, or at the end if that is `None`.
    pub fn answer(&self, segment: Option<SegmentId>, question: &str) -> Option<&AnswerValue> {
        self.answers.get(&(segment, question.to_owned()))?.counts.as_ref()
    }

    /// Adds an answer that has arrived. Of all answers to a question, the one given last counts.
    pub fn keep_answer(&mut self, segment: Option<SegmentId>, question: &str, given: GivenAnswer) {
        let answered = self.answers.entry((segment, question.to_owned())).or_default();
        answered.given.push(given);
        answered.counts = counted(&answered.given);
    }

    /// Whether answers to the questions about `segment` (`None`: the closing questions) are kept. They always are once
    /// the questions have been shown. [`Grace`](super::grace::Grace) decides whether a late answer counts.
    pub fn takes_answers(&self, segment: Option<SegmentId>) -> bool {
        match segment {
            None => matches!(self.phase, Phase::Closing | Phase::Completed) || self.done == self.segments.len(),
            Some(segment) => self.position(segment).is_some_and(|position| position < self.asked),
        }
    }

    /// Applies an event.
    pub fn apply(&mut self, event: &Event) {
        match &event.kind {
            EventKind::Created
            | EventKind::QuestionsFinished { segment: None }
            | EventKind::FocusedByHand { .. }
            | EventKind::PicturesSeen(_) => {}
            EventKind::Started => self.phase = Phase::Notice,
            EventKind::SegmentStarted { .. } => {
                self.phase = Phase::Inspecting;
                self.inspected = Duration::ZERO;
                self.running_since = Some(event.at);
            }
            EventKind::SegmentFinished { inspected_ms, .. } => {
                self.stop_clock(*inspected_ms);
                if !self.protocol.patch.stays() {
                    self.pointed.patch = PatchPlace::CENTRE;
                }
                self.asked = self.done + 1;
                if self.protocol.after_segment.is_empty() {
                    self.leave_segment();
                } else {
                    self.phase = Phase::Questions;
                }
            }
            EventKind::QuestionsFinished { segment: Some(_) } => self.leave_segment(),
            EventKind::Paused { inspected_ms, reason } => {
                self.stop_clock(*inspected_ms);
                self.paused = Some(match event.by {
                    Role::Surgeon => PauseCause::Surgeon,
                    Role::System if self.tablet_away => PauseCause::TabletAway,
                    Role::System => PauseCause::SmallPicture,
                    _ => PauseCause::Operator,
                });
                if reason.is_empty() && !self.erased_reasons.contains(&event.number) {
                    self.unreasoned.push(event.number);
                }
            }
            EventKind::PatchPlaced { place, .. } => self.pointed.patch = *place,
            EventKind::PatchCentred { .. } => self.pointed.patch = PatchPlace::CENTRE,
            EventKind::FocusHeld { .. } => self.pointed.held = true,
            EventKind::FocusReleased { .. } => self.pointed.held = false,
            EventKind::ReasonGiven { about, reason } => {
                self.unreasoned.retain(|number| number != about);
                self.given_reasons.insert(*about, reason.clone());
            }
            EventKind::TabletAway { .. } => self.tablet_away = true,
            EventKind::TabletBack => self.tablet_away = false,
            EventKind::Resumed => {
                self.paused = None;
                self.running_since = (self.phase == Phase::Inspecting).then_some(event.at);
            }
            EventKind::ServerRestarted { inspected_ms } => {
                self.stop_clock(*inspected_ms);
                self.paused = self.paused.or(Some(PauseCause::Restart));
            }
            EventKind::Completed => self.phase = Phase::Completed,
            EventKind::Aborted { inspected_ms, .. } => {
                self.stop_clock(*inspected_ms);
                self.paused = None;
                self.phase = Phase::Aborted;
            }
            EventKind::Withdrawn { .. } => self.withdrawn = true,
            EventKind::Unblinded { .. } => self.unblinded = true,
        }
    }

    fn stop_clock(&mut self, inspected_ms: u64) {
        self.inspected = Duration::from_millis(inspected_ms);
        self.running_since = None;
        self.pointed.held = false;
    }

    const fn leave_segment(&mut self) {
        self.done += 1;
        self.inspected = Duration::ZERO;
        self.phase = if self.done < self.segments.len() { Phase::Notice } else { Phase::Closing };
    }
}
