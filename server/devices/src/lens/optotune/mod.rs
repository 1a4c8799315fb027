//! The Optotune Lens Driver 4/4i over USB serial, as a [`Lens`].
//!
//! The caller's side only touches memory; a separate thread talks to the port. When the lens is dropped, that thread
//! puts the driver into current mode at 0 mA, unless [`DriverSettings::keep`] is set. The lens then relaxes to its
//! resting focal power and does not warm up. [`let_go_of_all`] does the same before a process ends in another way. Only
//! `kill -9` leaves the lens at the last focal power commanded, until it is opened again.

pub mod codec;
mod handshake;
mod link;
mod port;
mod range;
mod shared;
mod status;
mod worker;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

pub use handshake::DriverSettings;
use port::Address;
use shared::{Device, Shared};

use super::{CELSIUS, DYNAMICS, Lens, LensDynamics, LensError, LensHealth, LensInfo, Optics, Response};
use parfocal_base::FocalPower;
use parfocal_base::clock::Clock;
use parfocal_base::options::Options;
use parfocal_base::priority::{self, ThreadRole};

/// Dioptres that a specification may give: all that the driver has numbers for.
const DIOPTRES: std::ops::RangeInclusive<f64> = -160.0..=160.0;

/// Longest wait for a device to identify itself. Long enough for a bad line with many repetitions.
const CONNECT: Duration = Duration::from_secs(4);
/// Longest wait for an answer.
const ANSWER: Duration = Duration::from_millis(900);

/// Longest wait for the driver's thread to remove the lens's current. With a silent driver it tries three times on the
/// open connection, and three times on a new one.
const LETTING_GO: Duration = Duration::from_secs(3);

/// The open lenses. However the process ends, they must not be left under current.
static OPEN: Mutex<Vec<Weak<Shared>>> = Mutex::new(Vec::new());

/// Removes the current of every open lens, except of those that must stay where they are, and waits until that is done.
/// The lenses accept no more commands.
pub fn let_go_of_all() {
    let open: Vec<_> = {
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        open.drain(..).filter_map(|shared| shared.upgrade()).collect()
    };

    // All are asked to end before any is waited for, so that they end at the same time.
    for shared in &open {
        shared.end();
    }
    for shared in &open {
        shared.wait_ended(LETTING_GO);
    }
}

/// How a lens is opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Opening {
    /// It must be there now.
    Now,
    /// It must be there now, keeps its state, and stays where it is when it is dropped.
    ToStay,
    /// It is looked for until it is there.
    OrAwait,
}

/// A lens at a serial port.
pub struct OptotuneLens {
    shared: Arc<Shared>,
    name: Arc<str>,
    thread: Option<JoinHandle<()>>,
}

impl OptotuneLens {
    /// Connects to the driver at `path`.
    ///
    /// # Errors
    /// If the lens cannot be used right now. The error says why and what to do. The lens recovers from later failures
    /// by itself.
    pub fn connect(path: &Path, settings: DriverSettings, clock: Arc<dyn Clock>) -> Result<Self, LensError> {
        let (lens, first) = Self::start(Address::Port(path.to_owned()), settings, clock)?;
        first.map(|_| lens)
    }

    /// Starts the thread that connects to the driver at `address`. Returns the lens and the outcome of the first
    /// attempt.
    fn start(
        address: Address,
        settings: DriverSettings,
        clock: Arc<dyn Clock>,
    ) -> Result<(Self, Result<Device, LensError>), LensError> {
        let response = Arc::new(Response::new(DYNAMICS, 0.0, FocalPower::MIDDLE));
        let system = |error: std::io::Error| LensError::Gone(format!("the system is out of resources: {error}"));
        let shared = Arc::new(Shared::new(clock, response).map_err(system)?);
        let name = match &address {
            Address::Port(path) => format!("Optotune lens at {}", path.display()).into(),
            Address::Any => Arc::from("Optotune lens"),
        };

        let theirs = shared.clone();
        OPEN.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::downgrade(&shared));
        let thread = std::thread::Builder::new()
            .name("lens".into())
            .spawn(move || {
                priority::raise(ThreadRole::Wire);
                worker::run(&theirs, &address, &settings);
                theirs.ended();
            })
            .map_err(system)?;

        let lens = Self { shared, name, thread: Some(thread) };
        let first = lens.shared.wait_connected(CONNECT);
        Ok((lens, first))
    }

    /// Opens the lens of a specification. `device` is a path, or `auto` for the one driver that is plugged in. Options
    /// are `min` and `max`, the dioptres to use, and `low` and `high`, the temperature limits in °C.
    pub(super) fn open(
        device: &str,
        mut options: Options,
        opening: Opening,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, LensError> {
        let (low, high) = DriverSettings::default().temperatures;
        let settings = DriverSettings {
            min_dioptre: options.take_within("min", DIOPTRES, " dpt")?,
            max_dioptre: options.take_within("max", DIOPTRES, " dpt")?,
            temperatures: (
                options.take_within("low", CELSIUS, " °C")?.unwrap_or(low),
                options.take_within("high", CELSIUS, " °C")?.unwrap_or(high),
            ),
            keep: opening == Opening::ToStay,
        };

        options.finish()?;
        settings.check()?;

        let address = match device {
            // More than one driver is an error at once, and so is none unless it is waited for.
            "auto" => match port::find(Path::new(port::BY_ID)) {
                Ok(path) => Address::Port(path),
                Err(LensError::Gone(_)) if opening == Opening::OrAwait => Address::Any,
                Err(error) => return Err(error),
            },
            path => Address::Port(PathBuf::from(path)),
        };

        let (lens, first) = Self::start(address, settings, clock)?;
        match first {
            Ok(_) => Ok(lens),
            Err(error @ LensError::Gone(_)) if opening == Opening::OrAwait => {
                tracing::warn!("{error}; looking for it");
                Ok(lens)
            }
            Err(error) => Err(error),
        }
    }

    fn described(&self, device: &Device) -> LensInfo {
        LensInfo {
            driver: "Optotune Lens Driver 4".into(),
            firmware: device.firmware.clone(),
            serial: device.serial.clone(),
            min_dioptre: device.range.min_dioptre(),
            max_dioptre: device.range.max_dioptre(),
            temperature_celsius: Some(device.temperature),
            mode: status::mode_name(device.mode).into(),
            status: device.status.words(),
            line_errors: self.shared.line_errors(),
        }
    }
}

impl Drop for OptotuneLens {
    fn drop(&mut self) {
        self.shared.end();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }

        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|shared| !std::ptr::eq(shared.as_ptr(), Arc::as_ptr(&self.shared)));
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

        LensHealth {
            name: self.name.clone(),
            simulated: state.emulated,
            working,
            caution,
            message,
            line_errors: self.shared.line_errors(),
            info: state.device.as_ref().ok().map(|device| self.described(device)),
        }
    }

    fn info(&mut self) -> Result<LensInfo, LensError> {
        let device = self.shared.refresh(ANSWER)?;
        Ok(self.described(&device))
    }

    fn dynamics(&self) -> LensDynamics {
        DYNAMICS
    }

    fn optics(&self) -> Arc<dyn Optics> {
        self.shared.response.clone()
    }

    fn read_back(&mut self) -> Result<FocalPower, LensError> {
        let device = self.shared.refresh(ANSWER)?;
        Ok(device.range.focal_power(device.read_back))
    }
}
