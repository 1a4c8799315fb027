//! Control: the loop camera -> patch -> policy -> lens, its watchdog and its telemetry. Waits for
//! no viewer, disk or database.

mod advice;
mod attribution;
mod eye;
mod pilot;
mod runner;
mod slot;
mod source;
mod spawn;
mod stepper;
mod tap;
mod window;

pub use eye::Eye;
pub use pilot::HoldReason;
pub use runner::keep_policies_quiet;
pub use slot::LatestSlot;
pub use spawn::{ControlLoop, Rig, Settings};
pub use stepper::Stepper;
pub use tap::Tap;
pub use window::LatencyFigures;

use std::sync::Arc;
use std::time::Duration;

use crate::ids::SegmentId;
use serde::Serialize;
use tokio::sync::{mpsc, watch};

use crate::autofocus::PolicyName;
use crate::camera::{CameraHealth, CameraOffer, Controls, Frame};
use crate::clock::Moment;
use crate::imaging::{ContentArea, PatchArea};
use crate::lens::{FocalPower, LensHealth};
use crate::priority::Standing;

/// Who drives the lens.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// Nobody: the lens stays where it is put.
    Manual(FocalPower),
    /// A fresh instance of a policy, from `start` if given, else from where the lens is.
    Policy {
        /// Which.
        name: PolicyName,
        /// Focal power to begin at.
        start: Option<FocalPower>,
    },
    /// Nobody asks the policy and the lens holds still (a paused session).
    Hold {
        /// Focal power to go to and hold, if given; else the lens stays where it is.
        at: Option<FocalPower>,
    },
}

/// A command to the loop. Sending never blocks; the loop looks for commands between two frames.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Change who drives, and mark every later step as belonging to `segment`.
    Drive {
        /// The new driver.
        drive: Drive,
        /// The trial segment that later steps belong to.
        segment: Option<SegmentId>,
    },
    /// The content area found by the imaging thread, or that none is seen.
    ContentArea(Option<ContentArea>),
}

/// One step of the loop: what telemetry keeps.
#[derive(Debug, Clone, PartialEq)]
pub struct StepRecord {
    /// Frame's number.
    pub frame: u64,
    /// End of the exposure.
    pub exposed_at: Moment,
    /// Trial segment, if one is running.
    pub segment: Option<SegmentId>,
    /// Policy that was asked, if any.
    pub policy: Option<PolicyName>,
    /// Focal power asked of the lens after this frame.
    pub asked: FocalPower,
    /// Focal power at the middle of the frame's exposure, by the lens's dynamics; none while the
    /// lens is away.
    pub measured: Option<FocalPower>,
    /// The policy's focus metric.
    pub metric: Option<f64>,
    /// Duration of the policy's step, microseconds.
    pub policy_micros: u32,
    /// From end of exposure to the lens command, microseconds.
    pub latency_micros: u32,
    /// Why the loop held the lens instead of following the policy, if it did.
    pub held: Option<Hold>,
    /// The optimum, where a simulation knows it.
    pub optimal: Option<FocalPower>,
}

/// Why the last good focal power is being held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// The policy panicked; a fresh instance is being made.
    PolicyPanicked,
    /// The policy asked for an invalid focal power.
    PolicyNonsense,
    /// The policy took longer than a frame.
    PolicySlow,
    /// The policy cannot run here, or there is none of that name.
    PolicyUnavailable,
    /// The lens did not take the command.
    LensFailed,
    /// No frame came.
    CameraFailed,
    /// Paused on request.
    Paused,
}

impl Hold {
    /// Whether the policy is the cause. Such holds tell policies apart: only learned ones take time
    /// to start and to compute.
    #[must_use]
    pub const fn caused_by_policy(self) -> bool {
        matches!(self, Self::PolicyPanicked | Self::PolicyNonsense | Self::PolicySlow | Self::PolicyUnavailable)
    }

    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PolicyPanicked => "policy-panicked",
            Self::PolicyNonsense => "policy-nonsense",
            Self::PolicySlow => "policy-slow",
            Self::PolicyUnavailable => "policy-unavailable",
            Self::LensFailed => "lens-failed",
            Self::CameraFailed => "camera-failed",
            Self::Paused => "paused",
        }
    }
}

/// A frame with everything the loop knew when it was done with it. Goes to the imaging thread.
#[derive(Debug, Clone)]
pub struct ControlledFrame {
    /// The frame.
    pub frame: Frame,
    /// Where the patch was.
    pub patch: PatchArea,
    /// Content area in use.
    pub content_area: Option<ContentArea>,
    /// The step taken on it.
    pub record: StepRecord,
    /// The policy's belief, if it has one.
    pub belief: Option<Arc<[f32]>>,
}

/// The loop's state; published a few times a second and at every change. Each role is told a part
/// of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlStatus {
    /// When the loop said so. One that says nothing for seconds has stalled.
    pub at: Moment,
    /// The camera.
    pub camera: CameraHealth,
    /// What can be changed on it while it runs.
    pub camera_offer: CameraOffer,
    /// The lens.
    pub lens: LensHealth,
    /// Policy in charge, if one is.
    pub policy: Option<PolicyName>,
    /// Last focal power asked for.
    pub focal_power: FocalPower,
    /// Why the lens is being held, if it is.
    pub held: Option<Hold>,
    /// For how long it has been held without a break, for the policy's sake or for other reasons:
    /// where one follows the other, a policy's slow start after a long pause, it counts from there.
    pub held_for: Duration,
    /// The hold in words, and what to do.
    pub message: Option<Arc<str>>,
    /// Loop steps a second over the last second.
    pub steps_per_second: f64,
    /// Steps since the start.
    pub steps: u64,
    /// Telemetry records dropped because the writer fell behind.
    pub telemetry_dropped: u64,
    /// Median latency from exposure to lens command over the last second, microseconds.
    pub latency_p50_micros: u32,
    /// 99th percentile of the same.
    pub latency_p99_micros: u32,
    /// How the loop stands to other programs.
    pub priority: Standing,
}

/// Access to the loop for the rest of the server.
#[derive(Clone)]
pub struct ControlHandle {
    /// Commands in.
    pub commands: mpsc::UnboundedSender<Command>,
    /// Status out.
    pub status: watch::Receiver<Arc<ControlStatus>>,
    /// The latest frame out, for the imaging thread.
    pub frames: Arc<LatestSlot<ControlledFrame>>,
    /// The camera's settings, where it has any.
    pub camera: Option<Controls>,
    /// Where frames leave to be recorded.
    pub tap: Tap,
}

/// Access to the loop's state and frames, without the right to command it.
#[derive(Clone)]
pub struct ControlObserver {
    /// The loop's state.
    pub status: watch::Receiver<Arc<ControlStatus>>,
    /// The latest frame.
    pub frames: Arc<LatestSlot<ControlledFrame>>,
    /// The camera's settings, where it has any.
    pub camera: Option<Controls>,
}

impl ControlHandle {
    /// The same without the right to command the loop.
    #[must_use]
    pub fn observer(&self) -> ControlObserver {
        ControlObserver { status: self.status.clone(), frames: Arc::clone(&self.frames), camera: self.camera.clone() }
    }

    /// Tells the loop something; what is sent after the loop's end is dropped.
    pub fn send(&self, command: Command) {
        let _ = self.commands.send(command);
    }
}
