//! The Optotune Lens Driver 4/4i over USB serial, as a [`Lens`].
//!
//! The caller's side only touches memory; a thread of its own talks to the port. When the lens is dropped, that thread
//! puts the driver into current mode at 0 mA: the lens relaxes to its resting focal power and does not warm up (unless
//! [`Lens::keep_on_close`] was called). A process that is killed leaves the lens at the last focal power commanded.

pub mod codec;
mod handshake;
mod link;
mod port;
mod range;
mod shared;
mod status;
mod worker;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

pub use handshake::Settings;
use shared::{Ending, Shared};

use super::{FocalPower, Lens, LensDynamics, LensError, LensHealth, LensInfo, Optics, Response};
use crate::clock::Clock;
use crate::options::Options;

/// Until it is measured on the bench: see the simulated lens's figures.
const DYNAMICS: LensDynamics = LensDynamics { delay: Duration::from_millis(2), settling: Duration::from_millis(15) };

/// How serial numbers of emulated units begin (see [`super::emulator`]): behind those no glass moves.
const EMULATED: &str = "EMUL";

/// Longest wait for a device to say who it is, with a second attempt at greeting.
const CONNECT: Duration = Duration::from_secs(2);
/// Longest wait for an answer.
const ANSWER: Duration = Duration::from_millis(900);

/// A lens at a serial port.
pub struct OptotuneLens {
    shared: Arc<Shared>,
    name: Arc<str>,
    thread: Option<JoinHandle<()>>,
    ending: Ending,
    emulated: bool,
}

impl OptotuneLens {
    /// Connects to the driver at `path`.
    ///
    /// # Errors
    /// When it cannot be used right now; says why and what to do. Later failures heal by themselves.
    pub fn connect(path: &Path, settings: Settings, clock: Arc<dyn Clock>) -> Result<Self, LensError> {
        let response = Arc::new(Response::new(DYNAMICS, 0.0, FocalPower::MIDDLE));
        let system = |error: std::io::Error| LensError::Gone(format!("the system is out of resources: {error}"));
        let shared = Arc::new(Shared::new(clock, response).map_err(system)?);
        let (theirs, path_of_thread) = (shared.clone(), path.to_owned());
        let thread = std::thread::Builder::new()
            .name("lens".into())
            .spawn(move || {
                crate::priority::raise();
                worker::run(&theirs, &path_of_thread, &settings);
            })
            .map_err(system)?;
        let mut lens = Self {
            shared,
            name: format!("Optotune lens at {}", path.display()).into(),
            thread: Some(thread),
            ending: Ending::Relaxed,
            emulated: false,
        };
        lens.emulated = lens.shared.wait_connected(CONNECT)?.serial.starts_with(EMULATED);
        Ok(lens)
    }

    /// The lens of a specification: `device` is a path, or `auto` for the one that is plugged in; options are `min` and
    /// `max`, the dioptres to use, and `low` and `high`, the temperature limits in °C.
    pub(super) fn open(device: &str, mut options: Options, clock: Arc<dyn Clock>) -> Result<Self, LensError> {
        let (low, high) = Settings::default().temperatures;
        let settings = Settings {
            min_dioptre: options.take("min")?,
            max_dioptre: options.take("max")?,
            temperatures: (options.take("low")?.unwrap_or(low), options.take("high")?.unwrap_or(high)),
        };
        options.finish()?;
        let path = if device == "auto" { port::find(Path::new(port::BY_ID))? } else { PathBuf::from(device) };
        Self::connect(&path, settings, clock)
    }
}

impl Drop for OptotuneLens {
    fn drop(&mut self) {
        self.shared.end(self.ending);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Lens for OptotuneLens {
    fn set(&mut self, target: FocalPower) -> Result<(), LensError> {
        self.shared.command(target)
    }

    fn measured(&self) -> Option<FocalPower> {
        let connected = self.shared.state().device.is_ok();
        connected.then(|| self.shared.response.focal_power_at(self.shared.clock.now()))
    }

    fn health(&self) -> LensHealth {
        let state = self.shared.state();
        let caution = state.device.as_ref().is_ok_and(|device| device.status.doubtful());
        let (working, message) = match (&state.device, &state.refusal) {
            (Ok(_), None) => (true, state.message.clone()),
            (Ok(_), Some(refusal)) => (false, refusal.clone()),
            (Err(trouble), _) => (false, Arc::from(format!("{trouble}; trying again"))),
        };
        LensHealth { name: self.name.clone(), simulated: self.emulated, working, caution, message }
    }

    fn info(&mut self) -> Result<LensInfo, LensError> {
        let device = self.shared.refresh(ANSWER)?;
        Ok(LensInfo {
            driver: "Optotune Lens Driver 4".into(),
            firmware: device.firmware,
            serial: device.serial,
            min_dioptre: device.range.min_dioptre(),
            max_dioptre: device.range.max_dioptre(),
            temperature_celsius: Some(device.temperature),
            mode: status::mode_name(device.mode).into(),
            status: device.status.words(),
        })
    }

    fn dynamics(&self) -> LensDynamics {
        DYNAMICS
    }

    fn optics(&self) -> Arc<dyn Optics> {
        self.shared.response.clone()
    }

    fn keep_on_close(&mut self) {
        self.ending = Ending::AsItIs;
    }

    fn read_back(&mut self) -> Result<FocalPower, LensError> {
        let device = self.shared.refresh(ANSWER)?;
        Ok(device.range.focal_power(device.read_back))
    }
}
