//! A session's phase and its status.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The phase of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// The session is made, but not started.
    Ready,
    /// The full-screen notice "setting k of n" waits for the surgeon's tap.
    Notice,
    /// The surgeon inspects, and the segment's clock runs.
    Inspecting,
    /// The surgeon answers the questions after a segment.
    Questions,
    /// The surgeon answers the closing questions.
    Closing,
    /// The session ran to its end, with all required answers.
    Completed,
    /// The session was ended early, with a reason.
    Aborted,
}

impl Phase {
    /// Whether the session has ended. After that, only late comments and answers, withdrawal and unblinding can follow.
    pub const fn has_ended(self) -> bool {
        matches!(self, Self::Completed | Self::Aborted)
    }
}

/// Whether a session is under way, completed or aborted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SessionStatus {
    /// Neither completed nor aborted. It may not have started yet.
    UnderWay,
    /// The session ran to its end, with all required answers.
    Completed,
    /// Ended early.
    Aborted,
}
