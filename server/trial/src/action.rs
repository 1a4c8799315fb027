//! Actions of people: those that advance a session, and the choice of who focuses outside sessions.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use parfocal_base::ids::SegmentId;

/// An action that advances a session. `segment` is the segment that the page was showing, so that a stale tab or a
/// double click does not advance the session twice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "action", rename_all = "kebab-case")]
pub enum Action {
    /// Operator: start the session. The first notice is shown.
    Start,
    /// Surgeon: the notice of `segment` was tapped. The segment's clock starts.
    Acknowledge {
        /// Segment whose notice was tapped.
        segment: SegmentId,
    },
    /// Surgeon or operator: finish the inspection of `segment`. Its questions follow, or the next notice.
    FinishSegment {
        /// Segment to finish.
        segment: SegmentId,
    },
    /// Surgeon: the questions of `segment`, or the closing questions, are done.
    FinishQuestions {
        /// Segment that the questions are about; none for the closing questions.
        segment: Option<SegmentId>,
    },
    /// Operator or surgeon: pause the session. The lens holds, and the segment's clock stops.
    Pause {
        /// Reason for the pause, if it is known already. It can be given later, see [`Action::GiveReason`].
        #[serde(default)]
        reason: String,
    },
    /// Operator: give the reason for a pause that happened without one.
    GiveReason {
        /// Number of the pause among the session's events.
        event: u32,
        /// Reason for the pause.
        #[schema(pattern = r"\S")]
        reason: String,
    },
    /// Operator or surgeon: hold the focus where it is. The inspection of `segment` goes on.
    HoldFocus {
        /// Segment that is inspected.
        segment: SegmentId,
    },
    /// Operator or surgeon: no longer hold the focus.
    ReleaseFocus {
        /// Segment that is inspected.
        segment: SegmentId,
    },
    /// Operator, or surgeon unless the operator paused: resume a paused session.
    Resume,
    /// Operator: end the session early.
    Abort {
        /// Reason for the abort.
        #[schema(pattern = r"\S")]
        reason: String,
    },
    /// Operator or researcher: the participant has withdrawn. From now on exports leave out the session's data.
    Withdraw {
        /// Reason for the withdrawal.
        #[schema(pattern = r"\S")]
        reason: String,
    },
    /// Researcher: reveal which policies ran. In a session that is still under way this is an emergency unblinding.
    Unblind {
        /// Reason for the unblinding.
        #[schema(pattern = r"\S")]
        reason: String,
        /// Whether to unblind even though comments and answers that a surgeon's device still holds will then not count.
        #[serde(default)]
        despite_outstanding: bool,
    },
}

impl Action {
    /// Whether the action stops the lens. If so, it takes effect before it is written to disk.
    pub const fn stops_the_lens(&self) -> bool {
        matches!(self, Self::FinishSegment { .. } | Self::Pause { .. } | Self::HoldFocus { .. } | Self::Abort { .. })
    }
}

/// What focuses the lens outside sessions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Focus {
    /// No policy: the lens moves to this focal power (0..=1) and stays there.
    FocalPower(f64),
    /// The policy with this name.
    Policy(String),
}
