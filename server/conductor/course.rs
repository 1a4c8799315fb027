//! A session in memory: how it was made, where it stands, what was said, what of it is not on disk
//! yet, and what it asks of the control loop.

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;

use super::ConductError;
use crate::autofocus::PolicyName;
use crate::clock::Moment;
use crate::control::{Command, Drive};
use crate::ids::{SegmentId, SessionId};
use crate::lens::FocalPower;
use crate::store::{Comment, NewSession, Reader, RunClocks};
use crate::trial::account::Actor;
use crate::trial::action::Action;
use crate::trial::consent::Consent;
use crate::trial::event::{Event, EventKind};
use crate::trial::grace::Grace;
use crate::trial::phase::Phase;
use crate::trial::protocol::Protocol;
use crate::trial::refusal::Refusal;
use crate::trial::role::Role;
use crate::trial::session::{Plan, SessionState, decide, decide_time};
use crate::trial::unblinding::Circumstances;
use crate::trial::view::CommentLine;

/// Comments and log lines that the operator sees.
pub(super) const LATEST: usize = 30;

/// A session in memory.
pub(super) struct Course {
    pub made: NewSession,
    pub protocol: Protocol,
    /// Where it stands, with what stopped it since the disk last took something.
    pub state: SessionState,
    /// Whether what is said still counts.
    pub grace: Grace,
    /// The study that it belongs to; none outside any study.
    pub study: Option<String>,
    /// When its study was locked, if it belongs to one that was.
    study_locked: Option<Timestamp>,
    /// All its events, those that are not on the disk yet last.
    pub events: Vec<Event>,
    /// When each of them happened, by the server's clocks over its restarts.
    times: Vec<Timestamp>,
    clock: RunClock,
    /// What the participant consented to, if that is recorded.
    pub consent: Option<Consent>,
    /// Comments in all.
    pub comments: usize,
    /// The latest comments, newest last.
    pub latest_comments: Vec<CommentLine>,
    /// Whether the operator has closed it.
    pub dismissed: bool,
    /// How many events are on the disk.
    recorded: usize,
    /// What led to the events that are not, oldest first.
    stops: Vec<Stop>,
    /// Whether further events are being written. They change the state once they are on disk.
    writing: bool,
    /// Where the policy begins when it is next put in charge; none: where the lens is.
    begin_at: Option<FocalPower>,
    /// Where the lens was when the server ended in this session.
    interrupted_at: Option<FocalPower>,
}

/// This run of the server and its clock, with those of the runs before.
#[derive(Debug, Clone)]
pub(super) struct RunClock {
    pub clocks: Arc<RunClocks>,
    pub run: i64,
}

impl RunClock {
    /// `at`, a moment of this run, on the time that goes on over the server's restarts.
    pub fn time(&self, at: Moment) -> Timestamp {
        self.clocks.wall(self.run, at)
    }
}

/// What stops the lens: somebody's action, or the time limit. It takes effect at once, and is
/// recorded as soon as the disk takes it.
#[derive(Debug, Clone)]
struct Stop {
    by: Actor,
    /// None: the time limit.
    action: Option<Action>,
    at: Moment,
    wall: Timestamp,
}

impl Course {
    /// A session just made in `study`, or outside any; `clock` is this run's.
    pub fn new(made: NewSession, protocol: Protocol, created: Event, study: Option<String>, clock: RunClock) -> Self {
        let mut course = Self::without_events(made, protocol, clock);
        course.study = study;
        let at = course.clock.time(created.at);
        course.replay(vec![(at, created)]);
        course
    }

    fn without_events(made: NewSession, protocol: Protocol, clock: RunClock) -> Self {
        let segments = made.segments.iter().map(|(segment, _)| *segment).collect();
        let state = SessionState::new(Plan::new(&protocol, segments));
        let grace = Grace::new(protocol.grace);
        Self {
            made,
            protocol,
            state,
            grace,
            study: None,
            study_locked: None,
            events: Vec::new(),
            times: Vec::new(),
            clock,
            consent: None,
            comments: 0,
            latest_comments: Vec::new(),
            dismissed: false,
            recorded: 0,
            stops: Vec::new(),
            writing: false,
            begin_at: None,
            interrupted_at: None,
        }
    }

    /// Session `session` as the database has it, or `None`; `clock` is this run's, and knows those
    /// before.
    pub async fn load(reader: &Reader, clock: &RunClock, session: SessionId) -> Result<Option<Self>, ConductError> {
        let Some(stored) = reader.session(session).await? else { return Ok(None) };
        let protocol =
            stored.protocol().map_err(|error| ConductError::Unreadable { session, reason: error.to_string() })?;

        let mut course = Self::without_events(stored.made, protocol, clock.clone());
        course.study = stored.study;
        course.study_locked = stored.study_locked;
        let at = |(run, event): (i64, Event)| (clock.clocks.wall(run, event.at), event);
        course.replay(stored.events.into_iter().map(at).collect());
        for (run, answer) in reader.answers(session).await? {
            course.state.keep_answer(answer.segment, &answer.question, answer.given(run, &clock.clocks));
        }
        if let Some(latest) = reader.consents(session).await?.pop() {
            course.keep_consent(latest.consent);
        }
        reader.comments(session).await?.into_iter().for_each(|(_, comment)| course.heard(comment));
        Ok(Some(course))
    }

    /// Its id.
    pub const fn session(&self) -> SessionId {
        self.made.session
    }

    /// Number of `segment` as surgeons read it, from 1; 0 where it is none of this session's.
    pub fn setting(&self, segment: SegmentId) -> usize {
        self.state.plan().position(segment).map_or(0, |position| position + 1)
    }

    /// The next events, numbered and stamped.
    pub fn number(&self, by: &Actor, kinds: Vec<EventKind>, at: Moment, wall: Timestamp) -> Vec<Event> {
        let next = self.events.last().map_or(1, |event| event.number + 1);
        let event = |(kind, number)| Event { number, by: by.role, account: by.account.clone(), at, wall, kind };
        kinds.into_iter().zip(next..).map(event).collect()
    }

    /// Tells where the lens was when the server ended: the session goes on from there.
    pub const fn was_interrupted_at(&mut self, focal_power: FocalPower) {
        self.interrupted_at = Some(focal_power);
    }

    /// The events that `action` brings about, to be written to the disk; [`Course::written`] says
    /// what became of them.
    ///
    /// # Errors
    /// When `by` may not, or the action does not fit where the session stands or the circumstances.
    pub fn begin_writing(
        &mut self,
        by: &Actor,
        action: &Action,
        circumstances: &Circumstances,
        at: Moment,
        wall: Timestamp,
    ) -> Result<Vec<Event>, Refusal> {
        let kinds = circumstances.decide(self.session(), &self.state, by.role, action, at)?;
        self.writing = !kinds.is_empty();
        Ok(self.number(by, kinds, at, wall))
    }

    /// Takes in `events`, which are now on disk; none where writing failed. What stopped the
    /// session in the meantime comes after them and is decided anew: a pause while the session was
    /// being resumed pauses it again.
    pub fn written(&mut self, events: Vec<Event>) {
        self.writing = false;
        let mut recorded: Vec<(Timestamp, Event)> =
            std::mem::take(&mut self.times).into_iter().zip(std::mem::take(&mut self.events)).collect();
        recorded.truncate(self.recorded);
        recorded.extend(events.into_iter().map(|event| (self.clock.time(event.at), event)));
        self.replay(recorded);

        for stop in std::mem::take(&mut self.stops) {
            // It is refused where the session or setting that it was to stop has ended.
            let _ = self.take(stop);
        }
    }

    /// Stops the session or its setting at once, as `action` asks; its events wait for the disk.
    ///
    /// # Errors
    /// When `by` may not, or the action does not fit where the session stands.
    pub fn stop(&mut self, by: Actor, action: Action, at: Moment, wall: Timestamp) -> Result<(), Refusal> {
        self.take(Stop { by, action: Some(action), at, wall })
    }

    /// Ends the setting if its time is up; its events wait for the disk. Whether it did.
    pub fn keep_time(&mut self, at: Moment, wall: Timestamp) -> bool {
        let before = self.events.len();
        // The time limit is never refused.
        let _ = self.take(Stop { by: Role::System.into(), action: None, at, wall });
        self.events.len() > before
    }

    fn take(&mut self, stop: Stop) -> Result<(), Refusal> {
        let kinds = match &stop.action {
            Some(action) => decide(&self.state, stop.by.role, action, stop.at)?,
            None => decide_time(&self.state, stop.at),
        };

        // An action that changes nothing now may change something once the events being written are
        // there.
        if kinds.is_empty() && !(self.writing && stop.action.is_some()) {
            return Ok(());
        }
        for event in self.number(&stop.by, kinds, stop.at, stop.wall) {
            self.apply(self.clock.time(event.at), event);
        }
        self.stops.push(stop);
        Ok(())
    }

    /// The events that are not on the disk yet, and how many stops led to them.
    pub fn unrecorded(&self) -> (&[Event], usize) {
        (&self.events[self.recorded..], self.stops.len())
    }

    /// Notes that the first `events` of those events are on the disk, and with them the first
    /// `stops` stops.
    pub fn recorded(&mut self, events: usize, stops: usize) {
        self.recorded += events;
        self.stops.drain(..stops);
    }

    /// Whether something that happened is not on the disk yet.
    pub const fn is_unrecorded(&self) -> bool {
        self.recorded < self.events.len()
    }

    /// Whether event number `number` is on the disk.
    pub fn is_recorded(&self, number: u32) -> bool {
        self.events[..self.recorded].last().is_some_and(|last| number <= last.number)
    }

    /// Whether it is closed and leaves nothing to do.
    pub const fn is_done_with(&self) -> bool {
        self.dismissed && !self.writing && !self.is_unrecorded()
    }

    /// Starts over with `events`, which are on disk, each with its time by the server's clocks over
    /// its restarts.
    fn replay(&mut self, events: Vec<(Timestamp, Event)>) {
        self.recorded = events.len();
        self.state = self.state.replayed(&[]);
        self.grace = Grace::new(self.protocol.grace).locked(self.study_locked);
        self.begin_at = None;
        self.events = Vec::with_capacity(events.len());
        self.times = Vec::with_capacity(events.len());
        for (at, event) in events {
            self.apply(at, event);
        }
    }

    fn apply(&mut self, at: Timestamp, event: Event) {
        self.begin_at = match &event.kind {
            EventKind::SegmentStarted { .. } => Some(self.protocol.start),
            EventKind::ServerRestarted { .. } => self.interrupted_at,
            EventKind::Paused { .. } if !self.state.running() => self.begin_at,
            EventKind::Resumed | EventKind::Unblinded { .. } => self.begin_at,
            _ => None,
        };

        self.state.apply(&event);
        self.grace.apply(&event.kind, at);
        self.times.push(at);
        self.events.push(event);
    }

    /// Takes in a consent that was recorded.
    pub fn keep_consent(&mut self, consent: Consent) {
        self.state.keep_consent(&consent.text_version);
        self.consent = Some(consent);
    }

    /// Forgets the comments, of which some were erased, and takes in `comments`, which are all there are.
    pub fn hear_again(&mut self, comments: impl IntoIterator<Item = Comment>) {
        self.comments = 0;
        self.latest_comments.clear();
        comments.into_iter().for_each(|comment| self.heard(comment));
    }

    /// Takes in its `events` as the disk has them, where a reason was erased.
    pub fn read_again(&mut self, events: impl IntoIterator<Item = Event>) {
        for event in events {
            let kept = self.events.iter_mut().find(|kept| kept.number == event.number);
            if let Some(kept) = kept {
                *kept = event;
            }
        }
    }

    /// Takes in a comment that was kept.
    pub fn heard(&mut self, comment: Comment) {
        self.comments += 1;
        if self.latest_comments.len() == LATEST {
            self.latest_comments.remove(0);
        }
        let setting = comment.segment.map(|segment| self.setting(segment));
        self.latest_comments.push(CommentLine { at: comment.stamp.wall, setting, said: comment.said });
    }

    /// Who is to drive the lens now, as a command to the control loop. None before the session's
    /// start and after its end.
    pub fn lens_command(&self) -> Option<Command> {
        let segment = self.state.segment();
        let running = self.state.running();
        let paused = self.state.paused().is_some();

        let (drive, segment) = match (self.state.phase(), segment) {
            (Phase::Inspecting, Some(segment)) if running => {
                (Drive::Policy { name: self.policy_of(segment)?, start: self.begin_at }, Some(segment))
            }
            (Phase::Notice, _) if !paused => (Drive::Manual(self.protocol.start), None),
            (Phase::Inspecting, segment) => (Drive::Hold { at: self.begin_at }, segment),
            (Phase::Questions, _) => (Drive::Hold { at: self.begin_at }, None),
            (Phase::Notice | Phase::Closing, _) => (Drive::Hold { at: None }, None),
            (Phase::Ready | Phase::Completed | Phase::Aborted, _) => return None,
        };

        Some(Command::Drive { drive, segment })
    }

    fn policy_of(&self, segment: SegmentId) -> Option<PolicyName> {
        let (_, policy) = self.made.segments.iter().find(|(known, _)| *known == segment)?;
        Some(policy.clone())
    }

    /// Time of inspection until what is shown changes, `inspected` having passed in the segment.
    pub fn until_next_change(&self, inspected: Duration) -> Duration {
        let limit = self.state.plan().limit;
        let next = self.protocol.next_prompt_change(inspected).map_or(limit, |change| change.min(limit));
        next.saturating_sub(inspected).max(Duration::from_millis(1))
    }
}
