//! Control: the loop camera -> patch -> policy -> lens, its watchdog and its telemetry. It never waits for a viewer,
//! disk or database.

mod advice;
mod attribution;
mod eye;
mod lock;
mod pilot;
mod runner;
mod slot;
mod source;
mod spawn;
mod stepper;
mod tap;
mod window;

pub use eye::Eye;
pub(crate) use eye::cells;
pub use lock::{FocusLock, LockWatch};
pub use pilot::HoldReason;
pub use runner::keep_policies_quiet;
pub use slot::LatestSlot;
pub use spawn::{ControlLoop, LoopSettings, Rig};
pub use stepper::Stepper;
pub use tap::Tap;
pub use window::LatencyFigures;

use std::sync::Arc;
use std::time::Duration;

use parfocal_base::ids::SegmentId;
use serde::Serialize;
use tokio::sync::{mpsc, watch};

use parfocal_base::FocalPower;
use parfocal_base::PatchPlace;
use parfocal_base::PolicyName;
use parfocal_base::clock::Moment;
use parfocal_base::priority::Scheduling;
use parfocal_base::step::{Hold, StepRecord};
use parfocal_devices::camera::{CameraHealth, CameraOffer, Controls, Frame};
use parfocal_devices::lens::LensHealth;
use parfocal_imaging::{ContentArea, PatchArea};

/// After a longer gap between two frames they are not compared: the camera was away, and the tissue has moved.
pub(crate) const GAP: Duration = Duration::from_secs(1);

/// What drives the lens.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// No policy: the lens goes to this focal power and stays there.
    Manual(FocalPower),
    /// A new instance of a policy.
    Policy {
        /// Name of the policy.
        name: PolicyName,
        /// Focal power to begin at; `None` for where the lens is, or for the middle while nobody may see where it is.
        start: Option<FocalPower>,
    },
    /// Nothing: no policy is asked, and the lens holds still (a paused session).
    Hold {
        /// Focal power to go to and hold; `None` to stay where the lens is.
        at: Option<FocalPower>,
    },
}

/// A command to the loop. Sending never blocks; the loop looks for commands between two frames.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Changes what drives the lens, and the segment of later steps.
    Drive {
        /// The new driver.
        drive: Drive,
        /// The trial's segment to which later steps belong, if any.
        segment: Option<SegmentId>,
    },
    /// The content area found by the imaging thread; `None` if it sees none.
    ContentArea(Option<ContentArea>),
    /// Where to look, and whether to hold the focus. The lens does not move by it.
    Aim(Aim),
}

/// Where the policy looks, as people have chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Aim {
    /// Place of the patch.
    pub place: PatchPlace,
    /// How often people have chosen a place since the server started. So a page can tell a choice from a place that was
    /// set back.
    pub choices: u64,
    /// Whether the focus is held: the policy is not asked, and the lens stays where it is.
    pub held: bool,
    /// Whether a place other than the centre follows the tissue. Never during a session.
    pub follows: bool,
}

/// A frame with all results of its step. Goes to the imaging thread.
#[derive(Debug, Clone)]
pub struct ControlledFrame {
    /// The frame.
    pub frame: Frame,
    /// Place of the patch in the frame.
    pub patch: PatchArea,
    /// Content area by which the patch was placed, if known.
    pub content_area: Option<ContentArea>,
    /// Where people have chosen to look; where the patch follows the tissue, its present place.
    pub aim: Aim,
    /// How often the policy has been made to forget what it saw: because the patch jumped, the focus was held, or camera
    /// or lens were away.
    pub jumps: u64,
    /// The record of its step.
    pub record: StepRecord,
    /// The policy's belief, if it has one.
    pub belief: Option<Arc<[f32]>>,
    /// Whether the lens stands where a session's policy has left it. Until something else has moved it, nobody may see
    /// where it stands.
    pub left_by_session: bool,
}

/// The loop's state, published a few times a second and at every important change. Each role gets only a part of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlStatus {
    /// Time of this status. If it is seconds old, the loop has stalled.
    pub at: Moment,
    /// The camera's health.
    pub camera: CameraHealth,
    /// The camera's settings that can be changed while it runs.
    pub camera_offer: CameraOffer,
    /// The lens's health.
    pub lens: LensHealth,
    /// The policy that drives the lens, if any.
    pub policy: Option<PolicyName>,
    /// The last focal power that the lens accepted.
    pub focal_power: FocalPower,
    /// Whether the lens stands where a session's policy has left it, so that nobody may see where.
    pub left_by_session: bool,
    /// Why the lens is held; `None` if it is not.
    pub held: Option<Hold>,
    /// How long the lens has been held without a break because of the policy, or without a break for other causes. If
    /// one follows the other, such as a policy's slow start after a long pause, the time starts again.
    pub held_for: Duration,
    /// The reason for the hold in words, and what to do.
    pub message: Option<Arc<str>>,
    /// Steps of the loop in the last second.
    pub steps_per_second: f64,
    /// Steps since the loop started.
    pub steps: u64,
    /// Telemetry records dropped because the writer was too slow.
    pub telemetry_dropped: u64,
    /// Median latency from the end of the exposure to the lens command over the last second, in microseconds.
    pub latency_p50_micros: u32,
    /// 99th percentile of the same latency, in microseconds.
    pub latency_p99_micros: u32,
    /// Scheduling priority of the loop's thread.
    pub priority: Scheduling,
    /// What people can point at.
    pub geometry: PictureGeometry,
    /// What the policy's belief says of the focus.
    pub lock: FocusLock,
    /// Whether the patch follows the tissue.
    pub following: Following,
}

/// Whether the patch stays on the screen or follows the tissue.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Following {
    /// It stays where it is in the bright circle.
    #[default]
    Screen,
    /// It is carried along with the tissue, as soon as people have pointed.
    Tissue,
    /// The tissue could not be recognised any more. The patch is at the centre.
    Lost,
    /// The tissue has left the bright circle. The patch is at the centre.
    Left,
}

/// What a place in the picture means: the size of the picture, and the bright circle in it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PictureGeometry {
    /// Width and height of the latest picture, in mosaic cells; 0 before the first.
    pub cells: (usize, usize),
    /// The content area in use, in cells.
    pub content_area: Option<ContentArea>,
}

/// Access to the loop for the rest of the server.
#[derive(Clone)]
pub struct ControlHandle {
    /// Sends commands to the loop.
    pub commands: mpsc::UnboundedSender<Command>,
    /// The loop's latest status.
    pub status: watch::Receiver<Arc<ControlStatus>>,
    /// The latest frame, for the imaging thread.
    pub frames: Arc<LatestSlot<ControlledFrame>>,
    /// The camera's settings, if it has any.
    pub camera: Option<Controls>,
    /// Connects a recorder to the loop's frames.
    pub tap: Tap,
}

/// Access to the loop's state and frames, without the right to command it.
#[derive(Clone)]
pub struct ControlObserver {
    /// The loop's latest status.
    pub status: watch::Receiver<Arc<ControlStatus>>,
    /// The latest frame.
    pub frames: Arc<LatestSlot<ControlledFrame>>,
    /// The camera's settings, if it has any.
    pub camera: Option<Controls>,
}

impl ControlHandle {
    /// The same access without the right to command the loop.
    pub fn observer(&self) -> ControlObserver {
        ControlObserver { status: self.status.clone(), frames: Arc::clone(&self.frames), camera: self.camera.clone() }
    }

    /// Sends a command to the loop. After the loop's end it is dropped.
    pub fn send(&self, command: Command) {
        let _ = self.commands.send(command);
    }
}
