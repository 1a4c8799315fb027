//! What is read from and written to the database, as plain records.

use std::collections::BTreeMap;
use std::time::Duration;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use parfocal_base::clock::Moment;
use parfocal_base::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::{CommentContent, Origin, Sight};
use parfocal_trial::standing::{AnswerStanding, GivenAnswer, by_question};

/// When something was recorded, by both clocks of the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    /// When it was recorded, by the server's wall clock.
    pub wall: Timestamp,
    /// When it was recorded, by the monotonic clock.
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
    /// The run that counted the frame.
    pub frame_run: Option<i64>,
    /// What the surgeon saw, as the page reported it.
    pub sight: Sight,
    /// Device and time of the comment, as the page reported them.
    pub origin: Origin,
    /// Whether it arrived too late to count.
    pub late: bool,
    /// When it was kept.
    pub stamp: Stamp,
    /// Content of the comment.
    pub said: CommentContent,
}

/// An answer kept, or to be kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The browser's idempotency key.
    pub key: IdempotencyKey,
    /// Its session.
    pub session: SessionId,
    /// Its segment; `None` for a closing question.
    pub segment: Option<SegmentId>,
    /// The question's id.
    pub question: String,
    /// The answer, or the part of it that was given.
    pub value: AnswerValue,
    /// Where and when it was given, as the page reported.
    pub origin: Origin,
    /// Whether it arrived too late to count.
    pub late: bool,
    /// When it was kept.
    pub stamp: Stamp,
}

impl Answer {
    /// The answer in the form in which the answers to a question are compared. `run` is the run that kept it, and
    /// `clocks` has the clocks of that run.
    pub fn given(&self, run: i64, clocks: &RunClocks) -> GivenAnswer {
        GivenAnswer {
            device: self.origin.device,
            sequence: self.origin.sequence,
            at: clocks.entered_at(run, self.stamp.at, &self.origin),
            late: self.late,
            value: self.value.clone(),
        }
    }
}

/// The standing of each of `answers`, such as whether it counts. `answers` are those of a session in the order they
/// were kept, each with the run that kept it.
pub fn standings(answers: &[(i64, Answer)], clocks: &RunClocks) -> Vec<AnswerStanding> {
    let asked = |(run, answer): &(i64, Answer)| ((answer.segment, answer.question.clone()), answer.given(*run, clocks));
    by_question(answers.iter().map(asked))
}

/// The last report of a surgeon's device about how many comments and answers of a session it still holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceReport {
    /// The device.
    pub device: DeviceId,
    /// How many it held, the run in which it reported this, and when; `None` if it never reported.
    pub report: Option<(u32, i64, Moment)>,
}

impl DeviceReport {
    /// How many the device held, and when it reported this, by `clocks`; `None` if it never reported.
    pub fn told_on(&self, clocks: &RunClocks) -> Option<(u32, Timestamp)> {
        let (holding, run, at) = self.report?;
        Some((holding, clocks.wall(run, at)))
    }
}

/// A session in a list. Says nothing of policies.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
#[allow(clippy::struct_excessive_bools, reason = "facts that the list shows each by itself")]
pub struct SessionLine {
    /// Session.
    pub session: SessionId,
    /// When the session was made, by the server's wall clock.
    #[schema(value_type = String)]
    pub created: Timestamp,
    /// Code of the participant, as it was recorded.
    pub participant: String,
    /// Corrected code of the participant; none if it was not corrected, or back to the first one.
    pub corrected_participant: Option<String>,
    /// Name of the protocol.
    pub protocol: String,
    /// Whether it is a practice session.
    pub practice: bool,
    /// The study that it belongs to; none if it belongs to none.
    pub study: Option<String>,
    /// State of the session.
    pub status: SessionStatus,
    /// Number of settings inspected to the end.
    pub finished_settings: i64,
    /// Number of settings in the session.
    pub settings: i64,
    /// Number of comments that the surgeon did not take back.
    pub comments: i64,
    /// Whether it was unblinded.
    pub unblinded: bool,
    /// Whether it was unblinded in an emergency: while it was under way, or while its study was blinded.
    pub emergency: bool,
    /// Whether the participant withdrew: its data stay out of exports.
    pub withdrawn: bool,
}

impl SessionLine {
    /// The surgeon whose session it is: the corrected code if there is one, otherwise the recorded one.
    pub fn surgeon(&self) -> &str {
        self.corrected_participant.as_ref().unwrap_or(&self.participant)
    }
}

/// A point of a session's focal path. Only people who know the policy may see its metric.
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
    /// Focal power that the frame was exposed at, 0..=1; `None` if it is not known.
    pub measured: Option<f64>,
    /// The optimum, 0..=1, if a simulation knows it.
    pub optimal: Option<f64>,
    /// The policy's focus metric. Its scale reveals the policy.
    pub metric: Option<f64>,
    /// Left column of the patch, mosaic cells.
    pub patch_x: i64,
    /// Top row of the patch, mosaic cells.
    pub patch_y: i64,
}

/// A device started or stopped working.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceEvent {
    /// When it was recorded, by the server's wall clock.
    pub wall: Timestamp,
    /// When it was recorded, by the monotonic clock.
    pub at: Moment,
    /// `camera` or `lens`.
    pub device: String,
    /// Whether it works now.
    pub working: bool,
    /// What the device reports, or what was changed, in words.
    pub message: String,
}

/// The clocks at each start of the server. They give each moment of a run its time of day.
#[derive(Debug, Clone, Default)]
pub struct RunClocks(pub(super) BTreeMap<i64, Stamp>);

impl RunClocks {
    /// The time of day of `at` in run `run`, counted from the wall clock at the start of that run. So setting the wall
    /// clock does not change the distances between times of a run.
    pub fn wall(&self, run: i64, at: Moment) -> Timestamp {
        let Some(start) = self.0.get(&run) else { return Timestamp::UNIX_EPOCH };
        start.wall.saturating_add(at.since(start.at)).unwrap_or(start.wall)
    }

    /// When a comment or answer was entered that arrived at `at` in run `run`: the arrival minus its wait on the
    /// surgeon's device.
    pub fn entered_at(&self, run: i64, at: Moment, origin: &Origin) -> Timestamp {
        let arrived = self.wall(run, at);
        let waited = Duration::from_millis(origin.waited_millis.map_or(0, i64::unsigned_abs));
        arrived.saturating_sub(waited).unwrap_or(arrived)
    }
}
