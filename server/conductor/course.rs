//! A session in memory: what was made, where it stands, what was said; and what it asks of the control loop.

use std::time::Duration;

use jiff::Timestamp;

use super::ConductError;
use crate::autofocus::PolicyName;
use crate::clock::Moment;
use crate::control::{Command, Drive};
use crate::ids::{SegmentId, SessionId};
use crate::lens::FocalPower;
use crate::store::{Comment, NewSession, Reader, RunClocks};
use crate::trial::event::{Event, EventKind};
use crate::trial::grace::Grace;
use crate::trial::protocol::Protocol;
use crate::trial::session::{Plan, SessionState};
use crate::trial::view::{CommentLine, Phase, Role};

/// Comments and log lines that the operator sees.
pub(super) const LATEST: usize = 30;

/// A session in memory.
pub(super) struct Course {
    pub made: NewSession,
    pub protocol: Protocol,
    pub state: SessionState,
    /// Whether what is said still counts.
    pub grace: Grace,
    /// All its events.
    pub events: Vec<Event>,
    /// Comments in all.
    pub comments: usize,
    /// The latest comments, newest last.
    pub latest_comments: Vec<CommentLine>,
}

/// What a session asks of the control loop.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Driving {
    /// The lens waits where every segment begins.
    AtStart(FocalPower),
    /// A policy runs from `start`, or from where the lens is.
    Policy { segment: SegmentId, name: PolicyName, start: Option<FocalPower> },
    /// The lens holds still.
    Hold(Option<SegmentId>),
}

impl Driving {
    /// The command that brings it about.
    pub fn command(&self) -> Command {
        let (drive, segment) = match self {
            Self::AtStart(start) => (Drive::Manual(*start), None),
            Self::Policy { segment, name, start } => {
                (Drive::Policy { name: name.clone(), start: *start }, Some(*segment))
            }
            Self::Hold(segment) => (Drive::Hold, *segment),
        };
        Command::Drive { drive, segment }
    }
}

impl Course {
    /// A session in which nothing has happened yet.
    pub fn new(made: NewSession, protocol: Protocol) -> Self {
        let segments = made.segments.iter().map(|(segment, _)| *segment).collect();
        let state = SessionState::new(Plan::new(&protocol, segments));
        let grace = Grace::new(protocol.grace);
        Self { made, protocol, state, grace, events: Vec::new(), comments: 0, latest_comments: Vec::new() }
    }

    /// Session `session` as the database has it, or `None`; `clocks` are those of the server's starts.
    pub async fn load(reader: &Reader, clocks: &RunClocks, session: SessionId) -> Result<Option<Self>, ConductError> {
        let Some(stored) = reader.session(session).await? else { return Ok(None) };
        let protocol =
            stored.protocol().map_err(|error| ConductError::Unreadable { session, reason: error.to_string() })?;

        let mut course = Self::new(stored.made, protocol);
        for (run, event) in stored.events {
            let at = clocks.wall(run, event.at);
            course.apply(event, at);
        }
        for (run, answer) in reader.answers(session).await? {
            course.state.keep_answer(answer.segment, &answer.question, answer.given(run, clocks));
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
    pub fn number(&self, by: Role, kinds: Vec<EventKind>, at: Moment, wall: Timestamp) -> Vec<Event> {
        let next = self.events.last().map_or(1, |event| event.number + 1);
        kinds.into_iter().zip(next..).map(|(kind, number)| Event { number, by, at, wall, kind }).collect()
    }

    /// Takes in what happened, at `at` by the server's clocks over its restarts.
    pub fn apply(&mut self, event: Event, at: Timestamp) {
        self.state.apply(&event);
        self.grace.apply(&event.kind, at);
        self.events.push(event);
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

    /// What it asks of the control loop; nothing before its start and after its end.
    pub fn driving(&self) -> Option<Driving> {
        let segment = self.state.segment();
        match (self.state.phase(), segment) {
            (Phase::Inspecting, Some(segment)) if self.state.running() => Some(Driving::Policy {
                segment,
                name: self.made.segments.iter().find(|(known, _)| *known == segment)?.1.clone(),
                start: self.just_begun().then_some(self.protocol.start),
            }),
            (Phase::Notice, _) if self.state.paused().is_none() => Some(Driving::AtStart(self.protocol.start)),
            (Phase::Inspecting, segment) => Some(Driving::Hold(segment)),
            (Phase::Notice | Phase::Questions | Phase::Closing, _) => Some(Driving::Hold(None)),
            (Phase::Ready | Phase::Completed | Phase::Aborted, _) => None,
        }
    }

    /// Whether the segment under way has not been interrupted since it began.
    fn just_begun(&self) -> bool {
        let clock_events = self.events.iter().rev().filter(|event| !matches!(event.kind, EventKind::Unblinded { .. }));
        clock_events
            .map(|event| &event.kind)
            .next()
            .is_some_and(|kind| matches!(kind, EventKind::SegmentStarted { .. }))
    }

    /// Time of inspection until what is shown changes, `inspected` having passed in the segment.
    pub fn until_next_change(&self, inspected: Duration) -> Duration {
        let limit = self.state.plan().limit;
        let next = self.protocol.next_prompt_change(inspected).map_or(limit, |change| change.min(limit));
        next.saturating_sub(inspected).max(Duration::from_millis(1))
    }
}
