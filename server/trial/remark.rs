//! What a surgeon says, as the page sends it: comments and answers, each with where and when it was said.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::question::AnswerValue;
use crate::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};

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
    /// Said aloud: the recording follows in pieces.
    Voice,
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
