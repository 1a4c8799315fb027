//! A session in memory: how it was made, its state, the comments on it, which events are not on disk yet, and what it
//! requires of the control loop.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::ConductError;
use parfocal_base::FocalPower;
use parfocal_base::PatchPlace;
use parfocal_base::PolicyName;
use parfocal_base::boxed;
use parfocal_base::clock::Moment;
use parfocal_base::ids::{IdempotencyKey, SegmentId, SessionId};
use parfocal_pipeline::control::{Command, Drive};
use parfocal_records::store::{Comment, NewSession, Reader, RunClocks, Stamp, Store, StoreError};
use parfocal_trial::account::Actor;
use parfocal_trial::action::Action;
use parfocal_trial::consent::Consent;
use parfocal_trial::event::{Event, EventKind, Seen};
use parfocal_trial::grace::{Grace, Outstanding};
use parfocal_trial::phase::Phase;
use parfocal_trial::pointing::Choice;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::refusal::Refusal;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::role::Role;
use parfocal_trial::session::{
    SessionState, decide, decide_by_hand, decide_choice, decide_small_picture, decide_tablet, decide_time,
};
use parfocal_trial::tablet::{PictureSize, Presence, TabletReport};
use parfocal_trial::unblinding::Circumstances;
use parfocal_trial::view::CommentLine;

/// Number of comments and log lines that the operator sees.
pub(super) const LATEST: usize = 30;

/// A session in memory.
pub(crate) struct Course {
    pub made: NewSession,
    pub protocol: Arc<Protocol>,
    /// The session's state, including the stops that are not on disk yet.
    pub state: SessionState,
    /// Whether comments and answers that arrive still count.
    pub grace: Grace,
    /// The session's study; `None` outside studies.
    pub study: Option<String>,
    /// When its study was locked; `None` if it was not, or outside studies.
    pub study_locked: Option<Timestamp>,
    /// All its events. Those that are not on disk yet come last.
    pub events: Vec<Event>,
    /// When each event happened, by the server's clocks over its restarts.
    times: Vec<Timestamp>,
    clock: RunClock,
    /// The participant's consent, if recorded.
    pub consent: Option<Consent>,
    /// The comments, in the order they were kept. Withdrawals are not among them.
    comments: Vec<(IdempotencyKey, CommentLine)>,
    /// The comments that the surgeon took back.
    withdrawn: BTreeSet<IdempotencyKey>,
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
    /// Where the operator last moved the lens by hand since the session was stopped, as recorded.
    by_hand: Option<FocalPower>,
    /// The operator's latest movement of the lens, until it is recorded.
    movement: Option<Movement>,
    /// What the surgeon sees, since the size of the picture last changed in this inspection.
    seen_pictures: Option<SeenPictures>,
    /// Since when the surgeon's picture is smaller than the protocol allows.
    small_since: Option<Moment>,
}

/// Pictures of one size that the surgeon saw.
#[derive(Debug, Clone, Copy)]
struct SeenPictures {
    segment: SegmentId,
    size: PictureSize,
    since: Moment,
    pictures: u64,
}

/// A picture may be smaller than the protocol allows for this long: each link begins with small ones.
const SMALL_FOR: Duration = Duration::from_secs(3);

/// A movement of the lens by hand that is not among the events yet, because the hand may still be moving.
#[derive(Debug, Clone)]
struct Movement {
    by: Actor,
    to: FocalPower,
    stamp: Stamp,
}

/// A hand that has not moved the lens for this long is at rest.
const AT_REST: Duration = Duration::from_secs(1);

/// The number of this run of the server, and the clocks of all runs up to it.
#[derive(Debug, Clone)]
pub(crate) struct RunClock {
    pub clocks: Arc<RunClocks>,
    pub run: i64,
}

impl RunClock {
    /// The clocks of the server that has `store` open.
    pub async fn of(store: &Store) -> Result<Self, StoreError> {
        Ok(Self { clocks: Arc::new(store.reader().run_clocks().await?), run: store.run() })
    }

    /// Converts `at`, a moment of this run, to the time that continues over the server's restarts.
    pub fn time(&self, at: Moment) -> Timestamp {
        self.clocks.wall(self.run, at)
    }
}

/// Something that does not wait for the disk. It takes effect at once, and is recorded as soon as the disk takes it.
#[derive(Debug, Clone)]
struct Stop {
    by: Actor,
    cause: StopCause,
    stamp: Stamp,
}

/// What does not wait for the disk.
#[derive(Debug, Clone)]
enum StopCause {
    /// A person's action that stops the lens.
    Action(Action),
    /// The time limit.
    TimeLimit,
    /// The operator focuses by hand, after the session was stopped.
    ByHand { to: FocalPower, left_at: Option<FocalPower> },
    /// Somebody chose what is to be in focus.
    Choice(Choice),
    /// The surgeon's tablet went away, or is back.
    Tablet(Presence),
    /// The surgeon's picture is smaller than the protocol allows.
    SmallPicture,
    /// What the surgeon saw is to be recorded.
    Seen(EventKind),
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
        let protocol = Arc::new(protocol);
        let state = SessionState::new(Arc::clone(&protocol), segments);
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
            comments: Vec::new(),
            withdrawn: BTreeSet::new(),
            dismissed: false,
            recorded: 0,
            stops: Vec::new(),
            writing: false,
            begin_at: None,
            interrupted_at: None,
            by_hand: None,
            movement: None,
            seen_pictures: None,
            small_since: None,
        }
    }

    /// Loads session `session` from the database; `clock` is this run's, and knows the earlier runs.
    #[boxed]
    pub async fn load(reader: &Reader, clock: &RunClock, session: SessionId) -> Result<Self, ConductError> {
        let stored = reader.session(session).await?.ok_or_else(ConductError::no_session)?;
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
        Ok(course)
    }

    /// The session's identifier.
    pub const fn session(&self) -> SessionId {
        self.made.session
    }

    /// All its events, each with its time by the server's clocks over its restarts.
    pub fn timed_events(&self) -> impl Iterator<Item = (Timestamp, &Event)> {
        self.times.iter().copied().zip(&self.events)
    }

    /// Number of `segment` as surgeons read it, from 1; 0 if the segment is not of this session.
    pub fn setting(&self, segment: SegmentId) -> usize {
        self.state.position(segment).map_or(0, |position| position + 1)
    }

    /// Makes the next events: numbers and stamps `kinds`.
    pub fn number(&self, by: &Actor, kinds: Vec<EventKind>, Stamp { at, wall }: Stamp) -> Vec<Event> {
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
        stamp: Stamp,
    ) -> Result<Vec<Event>, Refusal> {
        let kinds = circumstances.decide(self.session(), &self.state, by.role, action, stamp.at)?;
        self.writing = !kinds.is_empty();
        Ok(self.number(by, kinds, stamp))
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
    pub fn stop(&mut self, by: Actor, action: Action, stamp: Stamp) -> Result<(), Refusal> {
        self.record_movement();
        // Who holds the focus goes on looking.
        if !matches!(action, Action::HoldFocus { .. }) {
            self.record_sight(stamp);
        }
        self.take(Stop { by, cause: StopCause::Action(action), stamp })
    }

    /// Sends the lens to `to` by hand; `lens_at` is where it is. The first place of a movement is recorded as soon as
    /// the disk takes it, and the last when the hand is at rest.
    ///
    /// # Errors
    /// If `by` may not do this, or the session is neither paused nor aborted.
    pub fn focus_by_hand(
        &mut self,
        by: Actor,
        to: FocalPower,
        lens_at: FocalPower,
        stamp: Stamp,
    ) -> Result<(), Refusal> {
        let left_at = self.by_hand.is_none().then_some(lens_at);
        let is_first = self.movement.is_none() && !self.moved_within(AT_REST, stamp.at);
        if is_first {
            return self.take(Stop { by, cause: StopCause::ByHand { to, left_at }, stamp });
        }

        decide_by_hand(&self.state, by.role, to, left_at)?;
        self.movement = Some(Movement { by, to, stamp });
        Ok(())
    }

    /// Looks where somebody has chosen. The event is recorded as soon as the disk takes it.
    ///
    /// # Errors
    /// If `by` may not do this, the protocol does not allow it, or no setting is being inspected.
    pub fn choose(&mut self, by: Actor, choice: Choice, stamp: Stamp) -> Result<(), Refusal> {
        self.take(Stop { by, cause: StopCause::Choice(choice), stamp })
    }

    /// Whether the last event is a movement by hand no longer than `time` before `at`.
    fn moved_within(&self, time: Duration, at: Moment) -> bool {
        let last = self.events.last();
        last.is_some_and(|event| event.kind.focal_power().is_some() && at.since(event.at) < time)
    }

    /// Makes an event of the operator's last movement of the lens, if there is one that is none yet.
    pub fn record_movement(&mut self) {
        let Some(Movement { by, to, stamp }) = self.movement.take() else { return };
        // It is refused only if the session is under way again.
        let _ = self.take(Stop { by, cause: StopCause::ByHand { to, left_at: None }, stamp });
    }

    /// The same once the hand is at rest at `now`. Returns whether there was something to record.
    pub fn record_movement_at_rest(&mut self, now: Moment) -> bool {
        let at_rest = self.movement.as_ref().is_some_and(|movement| now.since(movement.stamp.at) >= AT_REST);
        if at_rest {
            self.record_movement();
        }
        at_rest
    }

    /// Makes events of a movement by hand and of what the surgeon sees, because the server is about to end.
    pub fn record_what_goes_on(&mut self, stamp: Stamp) {
        self.record_movement();
        self.record_sight(stamp);
    }

    /// Whether a movement waits for the hand to come to rest.
    pub const fn is_moved(&self) -> bool {
        self.movement.is_some()
    }

    /// Ends the setting if its time is up; its events wait for the disk. Returns whether it ended.
    pub fn keep_time(&mut self, stamp: Stamp) -> bool {
        let before = self.events.len();
        if decide_time(&self.state, stamp.at).is_empty() {
            return false;
        }
        self.record_sight(stamp);
        self.notice(StopCause::TimeLimit, stamp);
        self.events.len() > before
    }

    /// Follows what the surgeon's tablets report. Returns whether there is something to record.
    pub fn follow_tablets(&mut self, report: &TabletReport, stamp: Stamp) -> bool {
        let before = self.events.len();
        self.see(report, stamp);
        if !decide_tablet(&self.state, report.presence, stamp.at).is_empty() {
            self.record_sight(stamp);
            self.notice(StopCause::Tablet(report.presence), stamp);
        }
        if self.small_since.is_some_and(|since| stamp.at.since(since) >= SMALL_FOR) {
            self.small_since = None;
            self.record_sight(stamp);
            self.notice(StopCause::SmallPicture, stamp);
        }
        self.events.len() > before
    }

    /// Notes the pictures of `report` that were seen during an inspection.
    fn see(&mut self, report: &TabletReport, stamp: Stamp) {
        let Some(segment) = self.state.segment().filter(|_| self.state.running()) else {
            self.seen_pictures = None;
            self.small_since = None;
            return;
        };
        let Some(size) = report.size else { return };

        let least = self.protocol.least_picture_width.unwrap_or(0);
        self.small_since = if size.width < least { self.small_since.or(Some(stamp.at)) } else { None };

        if self.seen_pictures.is_some_and(|seen_pictures| seen_pictures.size != size) {
            self.record_sight(stamp);
        }
        let seen_pictures =
            self.seen_pictures.get_or_insert(SeenPictures { segment, size, since: stamp.at, pictures: 0 });
        seen_pictures.pictures += report.pictures;
    }

    /// Makes an event of what the surgeon saw until now.
    fn record_sight(&mut self, stamp: Stamp) {
        let Some(SeenPictures { segment, size, since, pictures }) = self.seen_pictures.take() else { return };
        if !self.state.running() || self.state.segment() != Some(segment) {
            return;
        }
        let over_ms = u64::try_from(stamp.at.since(since).as_millis()).unwrap_or(u64::MAX);
        let seen = EventKind::PicturesSeen(Seen { segment, size, pictures, over_ms });
        self.notice(StopCause::Seen(seen), stamp);
    }

    /// Takes what the server itself notices, which is never refused.
    fn notice(&mut self, cause: StopCause, stamp: Stamp) {
        let _ = self.take(Stop { by: Role::System.into(), cause, stamp });
    }

    fn take(&mut self, stop: Stop) -> Result<(), Refusal> {
        let at = stop.stamp.at;
        let kinds = match &stop.cause {
            StopCause::Action(action) => decide(&self.state, stop.by.role, action, at)?,
            StopCause::TimeLimit => decide_time(&self.state, at),
            StopCause::ByHand { to, left_at } => decide_by_hand(&self.state, stop.by.role, *to, *left_at)?,
            StopCause::Choice(choice) => decide_choice(&self.state, stop.by.role, choice)?,
            StopCause::Tablet(presence) => decide_tablet(&self.state, *presence, at),
            StopCause::SmallPicture => decide_small_picture(&self.state, at),
            StopCause::Seen(seen) => vec![seen.clone()],
        };

        // An action that changes nothing now may change something after the events that are being written.
        if kinds.is_empty() && !(self.writing && matches!(stop.cause, StopCause::Action(_))) {
            return Ok(());
        }
        for event in self.number(&stop.by, kinds, stop.stamp) {
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
        self.state = self.state.before_all_events();
        self.grace = Grace::new(self.protocol.grace).locked(self.study_locked);
        self.begin_at = None;
        self.by_hand = None;
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
            EventKind::FocusedByHand { left_at, .. } => self.begin_at.or(*left_at),
            EventKind::Resumed
            | EventKind::ReasonGiven { .. }
            | EventKind::TabletAway { .. }
            | EventKind::TabletBack
            | EventKind::PicturesSeen(_)
            | EventKind::PatchPlaced { .. }
            | EventKind::PatchCentred { .. }
            | EventKind::FocusHeld { .. }
            | EventKind::FocusReleased { .. }
            | EventKind::Unblinded { .. } => self.begin_at,
            _ => None,
        };
        match &event.kind {
            EventKind::FocusedByHand { focal_power, .. } => self.by_hand = Some(*focal_power),
            EventKind::Resumed => {
                self.by_hand = None;
                self.movement = None;
            }
            _ => {}
        }

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
        self.comments.clear();
        comments.into_iter().for_each(|comment| self.heard(comment));
    }

    /// Replaces events by `events` as read from the database, after a reason was erased.
    pub fn read_again(&mut self, events: impl IntoIterator<Item = Event>) {
        for event in events {
            let Some(kept) = self.events.iter_mut().find(|kept| kept.number == event.number) else { continue };
            if kept.kind.reason() != event.kind.reason() {
                self.state.keep_erasure(event.number);
            }
            *kept = event;
        }
    }

    /// Adds a comment that was stored.
    pub fn heard(&mut self, comment: Comment) {
        if let CommentContent::Withdrawal(key) = comment.said {
            if !comment.late {
                self.withdrawn.insert(key);
            }
            return;
        }

        let waited = comment.origin.waited_millis.unwrap_or(0).max(0);
        let kept = comment.stamp.wall;
        let at = kept.saturating_sub(SignedDuration::from_millis(waited)).unwrap_or(kept);
        let setting = comment.segment.map(|segment| self.setting(segment));
        self.comments.push((comment.key, CommentLine { at, setting, said: comment.said }));
    }

    /// The comments that the surgeon did not take back, in the order they were said.
    pub fn standing_comments(&self) -> Vec<&CommentLine> {
        let standing = self.comments.iter().filter(|(key, _)| !self.withdrawn.contains(key));
        let mut standing: Vec<&CommentLine> = standing.map(|(_, line)| line).collect();
        standing.sort_by_key(|line| line.at);
        standing
    }

    /// Where the operator last moved the lens by hand since the session was stopped; `None` if nobody did.
    pub fn moved_by_hand(&self) -> Option<FocalPower> {
        let moved = self.movement.as_ref().map(|movement| movement.to).or(self.by_hand);
        moved.filter(|_| self.state.may_be_focused_by_hand())
    }

    /// The command to the control loop that says what drives the lens now. `None` before the session's start and after
    /// its end.
    pub fn lens_command(&self) -> Option<Command> {
        let segment = self.state.segment();
        let running = self.state.running();
        let paused = self.state.paused().is_some();

        if let Some(to) = self.moved_by_hand() {
            // Outside the segment: what a hand does is not the policy's path.
            return Some(Command::Drive { drive: Drive::Manual(to), segment: None });
        }

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

    /// Where the policy looks, and whether the focus is held. `None` before the session's start and after its end, when
    /// the session has no say in it.
    pub const fn aim(&self) -> Option<(PatchPlace, bool)> {
        match self.state.phase() {
            Phase::Ready | Phase::Completed | Phase::Aborted => None,
            _ => Some((self.state.patch(), self.state.focus_held())),
        }
    }

    fn policy_of(&self, segment: SegmentId) -> Option<PolicyName> {
        let (_, policy) = self.made.segments.iter().find(|(known, _)| *known == segment)?;
        Some(policy.clone())
    }

    /// Time of inspection until what is shown changes, after `inspected` of it has passed in the segment.
    pub fn until_next_change(&self, inspected: Duration) -> Duration {
        let limit = self.protocol.segment_limit;
        let next = self.protocol.next_prompt_change(inspected).map_or(limit, |change| change.min(limit));
        next.saturating_sub(inspected).max(Duration::from_millis(1))
    }
}

/// What may still arrive for `session`, which has the grace period `grace`, and would not count if it were unblinded at
/// `now`.
pub(crate) async fn outstanding(
    reader: &Reader,
    clocks: &RunClocks,
    session: SessionId,
    grace: Grace,
    now: Timestamp,
) -> Result<Option<Outstanding>, StoreError> {
    let devices = reader.surgeon_devices(session).await?;
    Ok(grace.outstanding(now, devices.iter().map(|device| device.told_on(clocks))))
}
