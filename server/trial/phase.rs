//! Where a session stands: its phases, and how far it came.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

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

impl Phase {
    /// Whether the session has ended: nothing more happens in it but late comments and unblinding.
    #[must_use]
    pub const fn has_ended(self) -> bool {
        matches!(self, Self::Completed | Self::Aborted)
    }
}

/// How far a session came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SessionStatus {
    /// Neither completed nor aborted.
    UnderWay,
    /// Every answer is in.
    Completed,
    /// Ended early.
    Aborted,
}
