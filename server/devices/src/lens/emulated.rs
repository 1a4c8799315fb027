//! The Optotune driver on an emulated unit in the same process: everything of a bench's lens except the glass.
//!
//! The simulated camera looks through the emulated glass itself. With a unit in another process
//! (`parfocal lens emulate`) it would have to use the driver's model of the glass instead. So a measurement includes
//! what a real one would: the path through thread, wire and firmware, and dynamics that the driver does not know.

use std::sync::Arc;

use super::emulator::{Emulator, Fault, LENS_DIOPTRES, Model};
use super::optotune::{DriverSettings, OptotuneLens};
use super::{CELSIUS, Lens, LensDynamics, LensError, LensHealth, LensInfo, Optics, take_millis};
use parfocal_base::FocalPower;
use parfocal_base::clock::Clock;
use parfocal_base::options::Options;

/// The driver and its emulated unit. The driver is dropped first, and leaves the unit at rest.
pub struct EmulatedLens {
    lens: OptotuneLens,
    emulator: Emulator,
}

impl EmulatedLens {
    /// Opens the lens with a specification's `options`: `latency`, `delay` and `settling` in milliseconds, `hysteresis`
    /// in dioptres, `temperature` in °C, and `fault`, which begins once the lens is connected.
    pub(super) fn open(mut options: Options, clock: Arc<dyn Clock>) -> Result<Self, LensError> {
        let usual = Model::default();
        let latency = take_millis(&mut options, "latency", usual.latency)?;
        let glass = LensDynamics {
            delay: take_millis(&mut options, "delay", usual.glass.delay)?,
            settling: take_millis(&mut options, "settling", usual.glass.settling)?,
        };

        let play = options.take("hysteresis")?.map_or(Ok(usual.play), play)?;
        let temperature = options.take_within("temperature", CELSIUS, " °C")?;
        let fault: Option<Fault> = options.take("fault")?;
        options.finish()?;

        let system = |error: std::io::Error| LensError::Gone(format!("the system is out of resources: {error}"));
        let emulator = Emulator::start(Model { latency, glass, play, ..usual }, clock.clone()).map_err(system)?;
        if let Some(celsius) = temperature {
            emulator.set_temperature(celsius);
        }

        let lens = OptotuneLens::connect(emulator.path(), DriverSettings::default(), clock)?;
        emulator.set_fault(fault.unwrap_or_default());

        Ok(Self { lens, emulator })
    }
}

/// Converts a hysteresis in dioptres to its half-width as a share of the range.
fn play(dioptres: f64) -> Result<f64, LensError> {
    Model::play_of(dioptres).ok_or_else(|| {
        let range = LENS_DIOPTRES.1 - LENS_DIOPTRES.0;
        LensError::BadSpec(format!("hysteresis={dioptres}: must be from 0 to {range} dpt"))
    })
}

impl Lens for EmulatedLens {
    fn set(&mut self, target: FocalPower) -> Result<(), LensError> {
        self.lens.set(target)
    }

    fn measured(&self) -> Option<FocalPower> {
        self.lens.measured()
    }

    fn health(&self) -> LensHealth {
        LensHealth { name: "emulated Optotune lens".into(), ..self.lens.health() }
    }

    fn info(&mut self) -> Result<LensInfo, LensError> {
        self.lens.info()
    }

    fn dynamics(&self) -> LensDynamics {
        self.lens.dynamics()
    }

    /// The emulated glass. The driver uses its whole range, so both have the same scale.
    fn optics(&self) -> Arc<dyn Optics> {
        self.emulator.glass()
    }

    fn read_back(&mut self) -> Result<FocalPower, LensError> {
        self.lens.read_back()
    }
}
