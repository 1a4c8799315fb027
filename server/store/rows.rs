//! What is read from and written to the database, as plain records.

use std::collections::BTreeMap;
use std::time::Duration;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use crate::clock::Moment;
use crate::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};
use crate::trial::phase::SessionStatus;
use crate::trial::question::AnswerValue;
use crate::trial::remark::{Origin, Said};
use crate::trial::standing::{Given, Standing, by_question};

/// When and by which server something was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    /// By the server's wall clock.
    pub wall: Timestamp,
    /// By the monotonic clock.
    pub at: Moment,
}

/// A comment kept, or to be kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Comment {
    /// The browser's idempotency key.
    pub key: IdempotencyKey,
    /// Its session.
    pub session: SessionId,
    /// Its segment, if it belongs to one.
    pub segment: Option<SegmentId>,
    /// Number of the frame on screen.
    pub frame: Option<u64>,
    /// The run that counted it.
    pub frame_run: Option<i64>,
    /// Where and when it was said, as the page told.
    pub origin: Origin,
    /// Whether it arrived when nothing counted any more.
    pub late: bool,
    /// When it was kept.
    pub stamp: Stamp,
    /// What was said.
    pub said: Said,
}

/// An answer kept, or to be kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The browser's idempotency key.
    pub key: IdempotencyKey,
    /// Its session.
    pub session: SessionId,
    /// Its segment; none for a closing question.
    pub segment: Option<SegmentId>,
    /// The question's id.
    pub question: String,
    /// The answer, or the part of it that was given.
    pub value: AnswerValue,
    /// Where and when it was given, as the page told.
    pub origin: Origin,
    /// Whether it arrived too late to count.
    pub late: bool,
    /// When it was kept.
    pub stamp: Stamp,
}

impl Answer {
    /// As the answers to its question are compared; it was kept in run `run`, of which `clocks` know the clocks.
    #[must_use]
    pub fn given(&self, run: i64, clocks: &RunClocks) -> Given {
        Given {
            device: self.origin.device,
            sequence: self.origin.sequence,
            at: clocks.said(run, self.stamp.at, &self.origin),
            late: self.late,
            value: self.value.clone(),
        }
    }
}

/// What became of each of `answers`, which are a session's in the order they were kept, each with the run that kept it.
#[must_use]
pub fn standings(answers: &[(i64, Answer)], clocks: &RunClocks) -> Vec<Standing> {
    let asked = |(run, answer): &(i64, Answer)| ((answer.segment, answer.question.clone()), answer.given(*run, clocks));
    by_question(answers.iter().map(asked))
}

/// What a surgeon's device told last of what it holds of a session, if it told anything.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceReport {
    /// The device.
    pub device: DeviceId,
    /// How much it held; in which run of the server it told so, and when.
    pub told: Option<(u32, i64, Moment)>,
}

impl DeviceReport {
    /// How much the device held, and when it told so on the time of `clocks`; none where it never told.
    #[must_use]
    pub fn told_on(&self, clocks: &RunClocks) -> Option<(u32, Timestamp)> {
        let (holding, run, at) = self.told?;
        Some((holding, clocks.wall(run, at)))
    }
}

/// A participant.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Participant {
    /// Code.
    pub code: String,
    /// When it was added, by the server's wall clock.
    #[schema(value_type = String)]
    pub added: Timestamp,
    /// Sessions, practice excluded.
    pub sessions: i64,
}

/// A session in a list. Says nothing of policies.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
#[allow(clippy::struct_excessive_bools, reason = "facts that the list shows each by itself")]
pub struct SessionLine {
    /// Session.
    pub session: SessionId,
    /// When it was made, by the server's wall clock.
    #[schema(value_type = String)]
    pub created: Timestamp,
    /// Participant's code, as it was recorded.
    pub participant: String,
    /// The right code, where that was corrected.
    pub corrected_participant: Option<String>,
    /// Protocol's name.
    pub protocol: String,
    /// Whether it is practice.
    pub practice: bool,
    /// The study that it belongs to; none where it is outside any study.
    pub study: Option<String>,
    /// How far it came.
    pub status: SessionStatus,
    /// Settings inspected to the end.
    pub finished_settings: i64,
    /// Settings in all.
    pub settings: i64,
    /// Comments kept.
    pub comments: i64,
    /// Whether it was told which policies ran.
    pub unblinded: bool,
    /// Whether that was while it was under way.
    pub emergency: bool,
    /// Whether the participant withdrew: its data stay out of exports.
    pub withdrawn: bool,
}

/// A point of a session's focal path, with the metric, which is for those alone who know the policy.
#[derive(Debug, Clone, PartialEq)]
pub struct PathPoint {
    /// Setting, from 1.
    pub setting: i64,
    /// Frame's number.
    pub frame: i64,
    /// Start of the server that it belongs to.
    pub run: i64,
    /// End of the exposure.
    pub exposed: Moment,
    /// Focal power asked for, 0..=1.
    pub asked: f64,
    /// Focal power that the frame was exposed at, 0..=1.
    pub measured: Option<f64>,
    /// The optimum, 0..=1, where a simulation knows it.
    pub optimal: Option<f64>,
    /// The policy's focus metric, which names the policy by its scale.
    pub metric: Option<f64>,
}

/// A device began or ceased to work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceEvent {
    /// By the server's wall clock.
    pub wall: Timestamp,
    /// By the monotonic clock.
    pub at: Moment,
    /// `camera` or `lens`.
    pub device: String,
    /// Whether it works now.
    pub working: bool,
    /// What it says of itself.
    pub message: String,
}

/// The clocks at each start of the server: by them a moment of any run has a time of day.
#[derive(Debug, Clone, Default)]
pub struct RunClocks(pub(super) BTreeMap<i64, Stamp>);

impl RunClocks {
    /// The time of day of `at` in run `run`, by the wall clock as it was when that run began; so times
    /// within a run keep their distances when the wall clock is set.
    #[must_use]
    pub fn wall(&self, run: i64, at: Moment) -> Timestamp {
        let Some(start) = self.0.get(&run) else { return Timestamp::UNIX_EPOCH };
        start.wall.saturating_add(at.since(start.at)).unwrap_or(start.wall)
    }

    /// When something was said that arrived at `at` in run `run`: its wait on the surgeon's device is taken off.
    #[must_use]
    pub fn said(&self, run: i64, at: Moment, origin: &Origin) -> Timestamp {
        let arrived = self.wall(run, at);
        let waited = Duration::from_millis(origin.waited_millis.map_or(0, i64::unsigned_abs));
        arrived.saturating_sub(waited).unwrap_or(arrived)
    }
}
