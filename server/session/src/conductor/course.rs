//! A session in memory: how it was made, its state, the comments on it, which events are not on disk yet, and what it
//! requires of the control loop.

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;

use super::ConductError;
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::clock::Moment;
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_pipeline::control::{Command, Drive};
use parfocal_records::store::{Comment, NewSession, Reader, RunClocks};
use parfocal_trial::account::Actor;
use parfocal_trial::action::Action;
use parfocal_trial::consent::Consent;
use parfocal_trial::event::{Event, EventKind};
use parfocal_trial::grace::Grace;
use parfocal_trial::phase::Phase;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::refusal::Refusal;
use parfocal_trial::role::Role;
use parfocal_trial::session::{Plan, SessionState, decide, decide_time};
use parfocal_trial::unblinding::Circumstances;
use parfocal_trial::view::CommentLine;

/// Number of comments and log lines that the operator sees.
pub(super) const LATEST: usize = 30;

/// A session in memory.
pub(super) struct Course {
    pub made: NewSession,
    pub protocol: Protocol,
    /// The session's state, including the stops that are not on disk yet.
    pub state: SessionState,
    /// Whether comments and answers that arrive still count.
    pub grace: Grace,
    /// The session's study; `None` outside studies.
    pub study: Option<String>,
    /// When its study was locked; `None` if it was not, or outside studies.
    study_locked: Option<Timestamp>,
    /// All its events. Those that are not on disk yet come last.
    pub events: Vec<Event>,
    /// When each event happened, by the server's clocks over its restarts.
    times: Vec<Timestamp>,
    clock: RunClock,
    /// The participant's consent, if recorded.
    pub consent: Option<Consent>,
    /// Number of all comments.
    pub comments: usize,
    /// The latest comments, newest last.
    pub latest_comments: Vec<CommentLine>,
    /// Whether the operator has closed it.
    pub dismissed: bool,
    /// Number of events that are on disk.
    recorded: usize,
    /// The stops that led to the events that are not on disk yet, oldest first.
    stops: Vec<Stop>,
    /// Whether further events are being written. They change the state only when they are on disk.
    writing: bool,
    /// Focal power at which the policy starts when it next drives; `None` starts it where the lens is.
    begin_at: Option<FocalPower>,
    /// Focal power of the lens when the server ended during this session.
    interrupted_at: Option<FocalPower>,
}

/// The number of this run of the server, and the clocks of all runs up to it.
#[derive(Debug, Clone)]
pub(super) struct RunClock {
    pub clocks: Arc<RunClocks>,
    pub run: i64,
}

impl RunClock {
    /// Converts `at`, a moment of this run, to the time that continues over the server's restarts.
    pub fn time(&self, at: Moment) -> Timestamp {
        self.clocks.wall(self.run, at)
    }
}

/// Something that stops the lens: a person's action, or the time limit. It takes effect at once, and is recorded as
/// soon as the disk takes it.
#[derive(Debug, Clone)]
struct Stop {
    by: Actor,
    /// `None` means the time limit.
    action: Option<Action>,
    at: Moment,
    wall: Timestamp,
}

impl Course {
    /// A session just made in `study`, or outside studies; `clock` is this run's.
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

    /// Loads session `session` from the database, or `None`; `clock` is this run's, and knows the earlier runs.
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

    /// The session's identifier.
    pub const fn session(&self) -> SessionId {
        self.made.session
    }

    /// Number of `segment` as surgeons read it, from 1; 0 if the segment is not of this session.
    pub fn setting(&self, segment: SegmentId) -> usize {
        self.state.plan().position(segment).map_or(0, |position| position + 1)
    }

    /// Makes the next events: numbers and stamps `kinds`.
    pub fn number(&self, by: &Actor, kinds: Vec<EventKind>, at: Moment, wall: Timestamp) -> Vec<Event> {
        let next = self.events.last().map_or(1, |event| event.number + 1);
        let event = |(kind, number)| Event { number, by: by.role, account: by.account.clone(), at, wall, kind };
        kinds.into_iter().zip(next..).map(event).collect()
    }

    /// Notes where the lens was when the server ended; the session continues from there.
    pub const fn was_interrupted_at(&mut self, focal_power: FocalPower) {
        self.interrupted_at = Some(focal_power);
    }

    /// The events that `action` causes, to be written to disk. Call [`Course::written`] with the result of writing.
    ///
    /// # Errors
    /// If `by` may not do this, or the action does not fit the session's state or the circumstances.
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

    /// Applies `events`, which are now on disk; pass none if writing failed. Stops that happened in the meantime come
    /// after them and are decided again: a pause during a resumption pauses the session again.
    pub fn written(&mut self, events: Vec<Event>) {
        self.writing = false;
        let mut recorded: Vec<(Timestamp, Event)> =
            std::mem::take(&mut self.times).into_iter().zip(std::mem::take(&mut self.events)).collect();
        recorded.truncate(self.recorded);
        recorded.extend(events.into_iter().map(|event| (self.clock.time(event.at), event)));
        self.replay(recorded);

        for stop in std::mem::take(&mut self.stops) {
            // This is refused if the session or setting that it was to stop has ended.
            let _ = self.take(stop);
        }
    }

    /// Stops the session or its setting at once, as `action` says; its events wait for the disk.
    ///
    /// # Errors
    /// If `by` may not do this, or the action does not fit the session's state.
    pub fn stop(&mut self, by: Actor, action: Action, at: Moment, wall: Timestamp) -> Result<(), Refusal> {
        self.take(Stop { by, action: Some(action), at, wall })
    }

    /// Ends the setting if its time is up; its events wait for the disk. Returns whether it ended.
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

        // An action that changes nothing now may change something after the events that are being written.
        if kinds.is_empty() && !(self.writing && stop.action.is_some()) {
            return Ok(());
        }
        for event in self.number(&stop.by, kinds, stop.at, stop.wall) {
            self.apply(self.clock.time(event.at), event);
        }
        self.stops.push(stop);
        Ok(())
    }

    /// The events that are not on disk yet, and the number of stops that led to them.
    pub fn unrecorded(&self) -> (&[Event], usize) {
        (&self.events[self.recorded..], self.stops.len())
    }

    /// Notes that the first `events` of the unrecorded events, and the first `stops` stops, are on disk.
    pub fn recorded(&mut self, events: usize, stops: usize) {
        self.recorded += events;
        self.stops.drain(..stops);
    }

    /// Whether an event is not on disk yet.
    pub const fn is_unrecorded(&self) -> bool {
        self.recorded < self.events.len()
    }

    /// Whether event number `number` is on disk.
    pub fn is_recorded(&self, number: u32) -> bool {
        self.events[..self.recorded].last().is_some_and(|last| number <= last.number)
    }

    /// Whether the session is closed and nothing remains to be written.
    pub const fn is_done_with(&self) -> bool {
        self.dismissed && !self.writing && !self.is_unrecorded()
    }

    /// Rebuilds the state from `events`, which are on disk, each with its time by the server's clocks over its
    /// restarts.
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

    /// Notes a recorded consent.
    pub fn keep_consent(&mut self, consent: Consent) {
        self.state.keep_consent(&consent.text_version);
        self.consent = Some(consent);
    }

    /// Replaces all comments by `comments`, after some were erased.
    pub fn hear_again(&mut self, comments: impl IntoIterator<Item = Comment>) {
        self.comments = 0;
        self.latest_comments.clear();
        comments.into_iter().for_each(|comment| self.heard(comment));
    }

    /// Replaces events by `events` as read from the database, after a reason was erased.
    pub fn read_again(&mut self, events: impl IntoIterator<Item = Event>) {
        for event in events {
            let kept = self.events.iter_mut().find(|kept| kept.number == event.number);
            if let Some(kept) = kept {
                *kept = event;
            }
        }
    }

    /// Adds a comment that was stored.
    pub fn heard(&mut self, comment: Comment) {
        self.comments += 1;
        if self.latest_comments.len() == LATEST {
            self.latest_comments.remove(0);
        }
        let setting = comment.segment.map(|segment| self.setting(segment));
        self.latest_comments.push(CommentLine { at: comment.stamp.wall, setting, said: comment.said });
    }

    /// The command to the control loop that says what drives the lens now. `None` before the session's start and after
    /// its end.
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

    /// Time of inspection until what is shown changes, after `inspected` of it has passed in the segment.
    pub fn until_next_change(&self, inspected: Duration) -> Duration {
        let limit = self.state.plan().limit;
        let next = self.protocol.next_prompt_change(inspected).map_or(limit, |change| change.min(limit));
        next.saturating_sub(inspected).max(Duration::from_millis(1))
    }
}
