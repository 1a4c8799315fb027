//! Lenses: focal power, and the devices that set it. This room does not use images.

mod dynamics;
mod emulated;
pub mod emulator;
pub mod optotune;
mod response;
mod simulated;
mod spec;

pub use dynamics::MeasuredDynamics;
pub use optotune::let_go_of_all;
pub use response::Response;
pub use simulated::SimulatedLens;
pub use spec::{open, open_or_await, open_to_stay};

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;
use parfocal_base::options::{BadOptions, Options};

/// A focus-tunable lens.
///
/// An implementation guarantees that [`Lens::set`], [`Lens::measured`] and [`Lens::health`] return within a
/// millisecond, whatever the device does. So a driver that talks to a port does so on its own thread. A lens that
/// failed keeps trying to recover by itself; the caller just keeps calling [`Lens::set`].
pub trait Lens: Send {
    /// Asks the lens to go to `target`. Does not wait until it gets there.
    ///
    /// # Errors
    /// If the lens is gone, did not follow earlier commands, or accepts them too slowly. It stays where it was until it
    /// recovers. Then it may go to the latest target.
    fn set(&mut self, target: FocalPower) -> Result<(), LensError>;

    /// The present focal power, read back or modelled from the commands; `None` if unknown.
    fn measured(&self) -> Option<FocalPower>;

    /// The lens's state, in words for the operator.
    fn health(&self) -> LensHealth;

    /// Describes the device. May talk to it, and block for up to a second.
    ///
    /// # Errors
    /// If the device does not answer.
    fn info(&mut self) -> Result<LensInfo, LensError>;

    /// Dead time and settling time, from which the focal power of a frame's exposure is computed.
    fn dynamics(&self) -> LensDynamics;

    /// The optics for a simulated camera: the true focal power over time. The true focal power of a real lens is
    /// unknown, so a real lens returns a model that follows the commands.
    fn optics(&self) -> Arc<dyn Optics>;

    /// The focal power that the device reports now. May talk to the device, and block for up to a second.
    ///
    /// # Errors
    /// If the device does not answer.
    fn read_back(&mut self) -> Result<FocalPower, LensError> {
        self.measured().ok_or_else(|| LensError::Gone(self.health().message.to_string()))
    }
}

/// The true focal power of a lens over time. Cheap, thread-safe, never blocks.
pub trait Optics: Send + Sync {
    /// True focal power at `moment`.
    fn focal_power_at(&self, moment: Moment) -> FocalPower;
}

/// A lens's state, for people.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LensHealth {
    /// Name for people, for example `simulated lens`.
    pub name: Arc<str>,
    /// Whether there is no real lens. Every page then says so.
    pub simulated: bool,
    /// Whether the lens accepts commands.
    pub working: bool,
    /// Whether the lens works, but not properly. The message says why, and the operator must be warned.
    pub caution: bool,
    /// One sentence: the state and, if it is bad, what to do.
    pub message: Arc<str>,
    /// Errors on the serial line since the lens was opened: damaged, late or missing replies, and noise.
    pub line_errors: u64,
    /// What the device last said about itself; `None` while it is away. Pages get the message instead.
    #[serde(skip)]
    pub info: Option<LensInfo>,
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
    /// Dioptres at focal power 0.
    pub min_dioptre: f64,
    /// Dioptres at focal power 1.
    pub max_dioptre: f64,
    /// Temperature of the lens, if it has a sensor.
    pub temperature_celsius: Option<f64>,
    /// Control mode, for example `focal power`.
    pub mode: String,
    /// Status conditions in words; empty when all is well.
    pub status: Vec<String>,
    /// Errors on the serial line since the lens was opened: damaged, late or missing replies, and noise.
    pub line_errors: u64,
}

/// Milliseconds that a specification may give for a delay, a settling time or a latency.
const MILLIS: std::ops::RangeInclusive<u32> = 0..=10_000;
/// Temperatures of a lens that a specification may give, °C.
const CELSIUS: std::ops::RangeInclusive<f64> = -100.0..=200.0;

/// The milliseconds of option `name`, or else `usual`.
fn take_millis(options: &mut Options, name: &'static str, usual: Duration) -> Result<Duration, BadOptions> {
    let given: Option<u32> = options.take_within(name, MILLIS, " ms")?;
    Ok(given.map_or(usual, |millis| Duration::from_millis(millis.into())))
}

/// The one of the `known` values that is called `name`. `kind` says what they are.
fn named<T: Copy>(kind: &str, known: &[(&str, T)], name: &str) -> Result<T, String> {
    known.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<_> = known.iter().map(|(known, _)| *known).collect();
        format!("unknown {kind} '{name}': choose from {}", names.join(", "))
    })
}

/// The dynamics of a lens that was not measured. A step of a tunable liquid lens settles in about 15 ms (Optics Express
/// 27, 2085, 2019). A command takes 2 ms through USB and driver.
const DYNAMICS: LensDynamics = LensDynamics { delay: Duration::from_millis(2), settling: Duration::from_millis(15) };

/// How a lens responds to a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LensDynamics {
    /// Time from the command to the first movement.
    pub delay: Duration,
    /// Time from the first movement until 5 % of the step remain.
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
    /// There is no device, or it no longer answers.
    #[error("the lens does not answer: {0}")]
    Gone(String),
    /// The device is there, but does not carry out commands in time.
    #[error("the lens does not accept commands: {0}")]
    Stalled(String),
    /// The device refused the command, or cannot be used.
    #[error("the lens refused: {0}")]
    Refused(String),
    /// The specification on the command line is invalid.
    #[error("{0}")]
    BadSpec(String),
}
