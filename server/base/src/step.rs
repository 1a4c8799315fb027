//! One step of the control loop, as telemetry keeps it.

use serde::Serialize;

use crate::clock::Moment;
use crate::ids::SegmentId;
use crate::{FocalPower, PolicyName};

/// One step of the loop, as recorded by telemetry.
#[derive(Debug, Clone, PartialEq)]
pub struct StepRecord {
    /// The frame's number.
    pub frame: u64,
    /// End of the exposure.
    pub exposed_at: Moment,
    /// The trial's segment, if one is running.
    pub segment: Option<SegmentId>,
    /// Policy that was asked, if any.
    pub policy: Option<PolicyName>,
    /// Focal power that the lens was asked for after this frame.
    pub asked: FocalPower,
    /// Focal power at the middle of the frame's exposure, according to the lens's dynamics; `None` while the lens is
    /// disconnected.
    pub measured: Option<FocalPower>,
    /// The focus metric that the policy computed, if any.
    pub metric: Option<f64>,
    /// Duration of the policy's step, in microseconds; 0 without one.
    pub policy_micros: u32,
    /// Time from the end of the exposure to the lens command, in microseconds.
    pub latency_micros: u32,
    /// Why the loop held the lens instead of following the policy; `None` if it did not.
    pub held: Option<Hold>,
    /// The optimum, if the camera is simulated and knows it.
    pub optimal: Option<FocalPower>,
    /// Left column and top row of the patch, in mosaic cells.
    pub patch: (u32, u32),
}

/// Why the last good focal power is being held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// The policy panicked. A new instance is being made.
    PolicyPanicked,
    /// The policy asked for an invalid focal power.
    PolicyNonsense,
    /// The policy took longer than a frame, or is starting.
    PolicySlow,
    /// The policy cannot run here, or no policy has that name.
    PolicyUnavailable,
    /// The lens did not accept the command.
    LensFailed,
    /// No frame came, or the frames are too small for a patch.
    CameraFailed,
    /// Paused on request.
    Paused,
    /// The focus is held on request while the setting goes on.
    FocusHeld,
}

impl Hold {
    /// Whether the policy is the cause. Such holds could unblind a session: only learned policies take time to start
    /// and to compute.
    pub const fn caused_by_policy(self) -> bool {
        matches!(self, Self::PolicyPanicked | Self::PolicyNonsense | Self::PolicySlow | Self::PolicyUnavailable)
    }

    /// Name in the database and in exports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PolicyPanicked => "policy-panicked",
            Self::PolicyNonsense => "policy-nonsense",
            Self::PolicySlow => "policy-slow",
            Self::PolicyUnavailable => "policy-unavailable",
            Self::LensFailed => "lens-failed",
            Self::CameraFailed => "camera-failed",
            Self::Paused => "paused",
            Self::FocusHeld => "focus-held",
        }
    }
}
