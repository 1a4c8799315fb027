//! What each role may see of a session. [`SurgeonView`] has no field for a policy, its order or its timing, and the code
//! that serves surgeons sees no other.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};

/// Where a session stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Made, not started.
    Ready,
    /// The full-screen notice "setting k of n" waits for the surgeon's tap.
    Notice,
    /// The surgeon inspects; the segment's clock runs.
    Inspecting,
    /// The questions after a segment.
    Questions,
    /// The questions at the end.
    Closing,
    /// Every answer is in.
    Completed,
    /// Ended early, with a reason.
    Aborted,
}

/// A session as the surgeon's browser gets it. Everything in it is the same whatever the policy.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[allow(clippy::struct_excessive_bools, reason = "facts that the page shows each by itself")]
pub struct SurgeonView {
    /// The session; random.
    pub session: SessionId,
    /// Where it stands.
    pub phase: Phase,
    /// Whether it is paused in that phase (by the operator, or by a restart of the server).
    pub paused: bool,
    /// Whether the surgeon may let it go on: after a restart of the server, not after a pause by the operator.
    pub may_resume: bool,
    /// Whether what stopped the session or its setting last (a pause, an end) is not on the disk yet.
    pub unrecorded: bool,
    /// Whether this is practice.
    pub practice: bool,
    /// The protocol's title for surgeons.
    pub title: String,
    /// The segment in progress: random, never shared by two segments.
    pub segment: Option<SegmentId>,
    /// Setting in progress, from 1; 0 before the first.
    pub setting: usize,
    /// Settings in all.
    pub settings: usize,
    /// Seconds of inspection left in the segment at the time of sending.
    pub remaining_seconds: Option<f64>,
    /// The prompt to show now, if one is due ("How does the focus feel now?").
    pub prompt: Option<String>,
    /// One-tap comments.
    pub quick_comments: Vec<String>,
    /// The questions to show in `Questions` and `Closing`.
    pub questions: Vec<Question>,
    /// Answers already kept for those questions, by question id.
    pub answers: BTreeMap<String, AnswerValue>,
    /// Comments kept so far in this session.
    pub comments: usize,
}

/// A question of the protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Question {
    /// Id, unique in the protocol.
    pub id: String,
    /// The question as read by the surgeon.
    pub text: String,
    /// What sort of answer it takes.
    #[serde(flatten)]
    pub kind: QuestionKind,
    /// Whether it can be left out.
    #[serde(default)]
    pub optional: bool,
}

/// Sorts of answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum QuestionKind {
    /// Free text.
    Text,
    /// A point from 1 to `points`.
    Likert {
        /// 5 or 7.
        points: u8,
        /// What 1 means.
        low: String,
        /// What the highest point means.
        high: String,
    },
    /// All settings of the session put in order, best first.
    Ranking,
    /// The System Usability Scale: ten items of 1..=5.
    Sus,
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum AnswerValue {
    /// A Likert point.
    Point(u8),
    /// A ranking of settings (from 1), best first; or the ten SUS items, 0 for those that this answer leaves as they were.
    Points(Vec<u8>),
    /// Text.
    Text(String),
}

/// A comment as a surgeon's browser sends it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
pub struct NewComment {
    /// Idempotency key, made by the browser: the same key again is the same comment.
    pub key: IdempotencyKey,
    /// Session that the surgeon's page was showing.
    pub session: SessionId,
    /// Segment that the page was showing.
    pub segment: Option<SegmentId>,
    /// Number of the frame that was on screen.
    pub frame: Option<u64>,
    /// The run that counted it, as its header told.
    #[serde(default)]
    pub run: Option<i64>,
    /// Where and when it was said.
    #[serde(flatten)]
    pub origin: Origin,
    /// What was said.
    #[serde(flatten)]
    pub said: Said,
}

/// Where and when something was said, as the surgeon's page tells.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
pub struct Origin {
    /// The device.
    #[serde(default)]
    pub device: Option<DeviceId>,
    /// Counts up with everything that is said on the device, in whatever tab; gaps mean nothing.
    #[serde(default)]
    pub sequence: Option<i64>,
    /// When it was said: milliseconds since 1970 by the browser's clock.
    #[serde(default)]
    pub client_millis: Option<i64>,
    /// Milliseconds that it waited on the device before it was sent this time.
    #[serde(default)]
    pub waited_millis: Option<i64>,
    /// The clock that measured this wait.
    #[serde(default)]
    pub waited_by: Option<WaitClock>,
}

impl Origin {
    /// The same without a wait below zero. A wait of which the page does not tell the clock is by the wall clock, as
    /// older pages measured it.
    #[must_use]
    pub fn plausible(self) -> Self {
        let waited_millis = self.waited_millis.filter(|waited| *waited >= 0);
        let waited_by = waited_millis.map(|_| self.waited_by.unwrap_or(WaitClock::WallClock));
        Self { waited_millis, waited_by, ..self }
    }
}

/// The clock by which a page measured how long something waited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WaitClock {
    /// The page's monotonic clock: nobody can set it.
    PageClock,
    /// The device's wall clock: the page was loaded anew meanwhile, or the device slept.
    WallClock,
}

impl WaitClock {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PageClock => "page-clock",
            Self::WallClock => "wall-clock",
        }
    }

    /// The clock called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::PageClock, Self::WallClock].into_iter().find(|clock| clock.name() == name)
    }
}

/// What was said.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", content = "text", rename_all = "kebab-case")]
pub enum Said {
    /// Typed.
    Text(String),
    /// One of the protocol's quick comments.
    Quick(String),
    /// "Mark this moment".
    Mark,
}

/// An answer as a surgeon's browser sends it. Of several to the same question the one given last counts, as far as it
/// gives an answer, in whatever order they arrive; the others stay in the log.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
pub struct NewAnswer {
    /// Idempotency key.
    pub key: IdempotencyKey,
    /// Session.
    pub session: SessionId,
    /// Segment; none for the questions at the end.
    pub segment: Option<SegmentId>,
    /// Question id.
    pub question: String,
    /// The answer.
    pub value: AnswerValue,
    /// Where and when it was given.
    #[serde(flatten)]
    pub origin: Origin,
}

/// How much a surgeon's device still holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
pub struct Holding {
    /// The session that it was said in.
    pub session: SessionId,
    /// The device.
    pub device: DeviceId,
    /// Comments and answers that it has not seen saved, half-written ones included.
    pub holding: u32,
}

/// Something that moves a session on. `segment` names the one that the page was showing, so that a stale tab or a double
/// click moves nothing twice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "action", rename_all = "kebab-case")]
pub enum Action {
    /// Operator: begin; the first notice is shown.
    Start,
    /// Surgeon: tapped the notice of `segment`; its clock starts.
    Acknowledge {
        /// The segment.
        segment: SegmentId,
    },
    /// Surgeon or operator: enough of `segment`; on to its questions, or the next notice.
    FinishSegment {
        /// The segment.
        segment: SegmentId,
    },
    /// Surgeon: done with the questions of `segment`, or with the closing ones.
    FinishQuestions {
        /// The segment; none for the closing questions.
        segment: Option<SegmentId>,
    },
    /// Operator: hold everything.
    Pause {
        /// Why.
        #[schema(pattern = r"\S")]
        reason: String,
    },
    /// Operator, or surgeon after a restart of the server: go on.
    Resume,
    /// Operator: end now.
    Abort {
        /// Why.
        #[schema(pattern = r"\S")]
        reason: String,
    },
    /// Researcher: tell which policies ran. On a session still under way this is emergency unblinding.
    Unblind {
        /// Why.
        #[schema(pattern = r"\S")]
        reason: String,
        /// Whether to do it though what a surgeon's device still holds would then not count any more.
        #[serde(default)]
        despite_outstanding: bool,
    },
}

impl Action {
    /// Whether it stops the lens, and so is done before it is on the disk.
    #[must_use]
    pub const fn stops_the_lens(&self) -> bool {
        matches!(self, Self::FinishSegment { .. } | Self::Pause { .. } | Self::Abort { .. })
    }
}

/// Who acts; kept with every event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// In the trial.
    Surgeon,
    /// At the device.
    Operator,
    /// Runs the study.
    Researcher,
    /// The server itself: a time limit, a restart.
    System,
}

impl Role {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Surgeon => "surgeon",
            Self::Operator => "operator",
            Self::Researcher => "researcher",
            Self::System => "system",
        }
    }

    /// The role called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Surgeon, Self::Operator, Self::Researcher, Self::System].into_iter().find(|role| role.name() == name)
    }
}

/// The session under way as the operator sees it. No policy either: the operator stands beside the surgeon.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct OperatorView {
    /// What the surgeon sees.
    #[serde(flatten)]
    pub surgeon: SurgeonView,
    /// Participant's code.
    pub participant: String,
    /// Protocol's name.
    pub protocol: String,
    /// Why the disk has not taken what is `unrecorded`, as far as it has said.
    pub unrecorded_because: Option<String>,
    /// The latest comments, newest first.
    pub latest_comments: Vec<CommentLine>,
    /// The latest events in words, newest first.
    pub log: Vec<LogLine>,
}

/// A comment for reading.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct CommentLine {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: jiff::Timestamp,
    /// Setting, from 1.
    pub setting: Option<usize>,
    /// What was said.
    #[serde(flatten)]
    pub said: Said,
}

/// An event in words.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct LogLine {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: jiff::Timestamp,
    /// Who.
    pub by: Role,
    /// What happened.
    pub text: String,
}
