//! What people do: actions that move a session on, and, outside sessions, who is to focus.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::SegmentId;

/// Something that moves a session on. `segment` names the one that the page was showing, so that a
/// stale tab or a double click moves nothing twice.
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
    /// Operator or researcher: the participant has withdrawn; from now on the session's data stay out of exports.
    Withdraw {
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

/// Who is to focus outside sessions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Focus {
    /// Nobody: the lens goes to this focal power, 0..=1, and stays.
    FocalPower(f64),
    /// A policy.
    Policy(String),
}
