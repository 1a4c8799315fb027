//! Lenses: focal power, and the devices that set it. This room knows nothing of images.

mod dynamics;
mod emulated;
pub mod emulator;
mod focal_power;
pub mod optotune;
mod response;
mod simulated;
mod spec;

pub use dynamics::MeasuredDynamics;
pub use focal_power::{FocalPower, OutOfRange};
pub use optotune::let_go_of_all;
pub use response::Response;
pub use simulated::{SimulatedFault, SimulatedFaults, SimulatedLens};
pub use spec::{open, open_to_stay};

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use crate::clock::Moment;
use crate::options::BadOptions;

/// A focus-tunable lens.
///
/// An implementation guarantees that [`Lens::set`], [`Lens::measured`] and [`Lens::health`] return
/// within a millisecond whatever the device does: a driver that talks to a port does so on a thread
/// of its own. A lens that failed keeps trying to recover by itself; the caller just keeps setting.
pub trait Lens: Send {
    /// Asks the lens to go to `target`; returns without waiting for it to get there.
    ///
    /// # Errors
    /// When the lens is gone, did not follow the commands before, or takes them too slowly. It stays
    /// where it was until it recovers; then it may go to the latest target.
    fn set(&mut self, target: FocalPower) -> Result<(), LensError>;

    /// The focal power last known to be real (read back, or modelled from the commands), if known.
    fn measured(&self) -> Option<FocalPower>;

    /// The lens's state, in words for the operator.
    fn health(&self) -> LensHealth;

    /// Describes the device. May talk to it, and block for up to a second.
    ///
    /// # Errors
    /// When the device does not answer.
    fn info(&mut self) -> Result<LensInfo, LensError>;

    /// Dead time and settling time, for attributing a frame to the focal power that it was exposed at.
    fn dynamics(&self) -> LensDynamics;

    /// The glass that a simulated camera looks through: its true focal power over time. Real lenses,
    /// whose glass cannot be known, return a model fed with the commands.
    fn optics(&self) -> Arc<dyn Optics>;

    /// The focal power as the device itself reports it now. May talk to the device, and block for up to
    /// a second.
    ///
    /// # Errors
    /// When the device does not answer.
    fn read_back(&mut self) -> Result<FocalPower, LensError> {
        self.measured().ok_or_else(|| LensError::Gone(self.health().message.to_string()))
    }

    /// The switch for its faults, if the lens is a simulated one.
    fn faults(&self) -> Option<SimulatedFaults> {
        None
    }
}

/// The glass itself, as the light sees it. Cheap, thread-safe, never blocks.
pub trait Optics: Send + Sync {
    /// True focal power at `moment`.
    fn focal_power_at(&self, moment: Moment) -> FocalPower;
}

/// A lens's state, in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LensHealth {
    /// Name for people, for example `simulated lens`.
    pub name: Arc<str>,
    /// Whether no real glass moves; every page says so.
    pub simulated: bool,
    /// Whether commands are being taken.
    pub working: bool,
    /// Whether the lens works, but not properly: the message says why, and the operator must be warned.
    pub caution: bool,
    /// One sentence: the state and, if it is bad, what to do.
    pub message: Arc<str>,
    /// Errors on its line since it was opened: replies that were damaged, late or missing, and noise.
    pub line_errors: u64,
}

/// A lens's description of itself (`parfocal lens info --json`; see docs/scripting.md).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LensInfo {
    /// Driver's name, for example `Optotune Lens Driver 4` or `simulated`.
    pub driver: String,
    /// Firmware type and version.
    pub firmware: String,
    /// Serial number.
    pub serial: String,
    /// Least dioptres; focal power 0.
    pub min_dioptre: f64,
    /// Most dioptres; focal power 1.
    pub max_dioptre: f64,
    /// Temperature of the lens.
    pub temperature_celsius: Option<f64>,
    /// Control mode, for example `focal power`.
    pub mode: String,
    /// Status conditions in words; empty when all is well.
    pub status: Vec<String>,
    /// Errors on its line since it was opened: replies that were damaged, late or missing, and noise.
    pub line_errors: u64,
}

/// How a lens responds to a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LensDynamics {
    /// From command to first movement.
    pub delay: Duration,
    /// From first movement to within 5 % of the step.
    pub settling: Duration,
}

impl From<BadOptions> for LensError {
    fn from(error: BadOptions) -> Self {
        Self::BadSpec(error.to_string())
    }
}

/// Why a lens did not follow a command.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LensError {
    /// No device, or it went away.
    #[error("the lens does not answer: {0}")]
    Gone(String),
    /// The device is there, but commands wait to be carried out.
    #[error("the lens does not accept commands: {0}")]
    Stalled(String),
    /// The device refused.
    #[error("the lens refused: {0}")]
    Refused(String),
    /// The specification given on the command line makes no sense.
    #[error("{0}")]
    BadSpec(String),
}
