//! The simulated lens: behaves like a tunable lens, deterministic for a given clock, and fails on request.

use std::str::FromStr;
use std::sync::Arc;

use super::response::Response;
use super::{DYNAMICS, Lens, LensDynamics, LensError, LensHealth, LensInfo, Optics, named, take_millis};
use parfocal_base::FocalPower;
use parfocal_base::clock::Clock;
use parfocal_base::options::Options;

/// Half-width of the hysteresis, as a share of the range: 0.02 of 5 dioptres.
const PLAY: f64 = 0.004;

/// Dioptres at focal power 0 and 1: a lens without an offset lens.
const DIOPTRES: (f64, f64) = (5.0, 10.0);

/// A lens without hardware.
pub struct SimulatedLens {
    clock: Arc<dyn Clock>,
    dynamics: LensDynamics,
    /// The true focal power, with hysteresis.
    glass: Arc<Response>,
    /// The focal power as a driver can know it. A driver cannot sense hysteresis, so this model has none.
    known: Response,
    fault: SimulatedFault,
    name: Arc<str>,
}

/// A fault of a simulated lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum SimulatedFault {
    /// No fault.
    #[default]
    None,
    /// Commands are accepted, but get lost.
    Drops,
    /// Commands pile up: the driver accepts none.
    Stalls,
    /// The driver answers every command with an error.
    Refuses,
    /// The device does not answer.
    Gone,
}

impl FromStr for SimulatedFault {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = [
            ("none", Self::None),
            ("drops", Self::Drops),
            ("stalls", Self::Stalls),
            ("refuses", Self::Refuses),
            ("gone", Self::Gone),
        ];
        named("fault", &known, name)
    }
}

impl SimulatedLens {
    /// A lens at rest in the middle of its range.
    pub fn new(clock: Arc<dyn Clock>) -> Self {
        Self::moving(DYNAMICS, clock)
    }

    /// The same with other `dynamics`.
    pub fn moving(dynamics: LensDynamics, clock: Arc<dyn Clock>) -> Self {
        Self {
            clock,
            dynamics,
            glass: Arc::new(Response::new(dynamics, PLAY, FocalPower::MIDDLE)),
            known: Response::new(dynamics, 0.0, FocalPower::MIDDLE),
            fault: SimulatedFault::None,
            name: Arc::from("simulated lens"),
        }
    }

    /// Opens the lens with a specification's `options`: `fault`, the initial fault; `delay` and `settling` in
    /// milliseconds.
    pub(super) fn open(mut options: Options, clock: Arc<dyn Clock>) -> Result<Self, LensError> {
        let fault: Option<SimulatedFault> = options.take("fault")?;
        let dynamics = LensDynamics {
            delay: take_millis(&mut options, "delay", DYNAMICS.delay)?,
            settling: take_millis(&mut options, "settling", DYNAMICS.settling)?,
        };
        options.finish()?;

        Ok(Self { fault: fault.unwrap_or_default(), ..Self::moving(dynamics, clock) })
    }

    fn failure(&self) -> Option<LensError> {
        match self.fault {
            SimulatedFault::None | SimulatedFault::Drops => None,
            SimulatedFault::Stalls => Some(LensError::Stalled("commands pile up (simulated fault)".into())),
            SimulatedFault::Refuses => {
                Some(LensError::Refused("error reply to every command (simulated fault)".into()))
            }
            SimulatedFault::Gone => Some(LensError::Gone("unplugged (simulated fault)".into())),
        }
    }

    fn described(&self) -> Result<LensInfo, LensError> {
        match self.failure() {
            Some(failure @ LensError::Gone(_)) => Err(failure),
            failure => Ok(LensInfo {
                driver: "simulated".into(),
                firmware: env!("CARGO_PKG_VERSION").into(),
                serial: "none".into(),
                min_dioptre: DIOPTRES.0,
                max_dioptre: DIOPTRES.1,
                temperature_celsius: None,
                mode: "focal power".into(),
                status: failure.iter().map(ToString::to_string).collect(),
                line_errors: 0,
            }),
        }
    }
}

impl Lens for SimulatedLens {
    fn set(&mut self, target: FocalPower) -> Result<(), LensError> {
        if let Some(failure) = self.failure() {
            return Err(failure);
        }
        if self.fault != SimulatedFault::Drops {
            let now = self.clock.now();
            self.glass.command(now, target);
            self.known.command(now, target);
        }

        Ok(())
    }

    fn measured(&self) -> Option<FocalPower> {
        (self.fault != SimulatedFault::Gone).then(|| self.known.focal_power_at(self.clock.now()))
    }

    fn health(&self) -> LensHealth {
        let failure = self.failure();
        let message = match (&failure, self.fault) {
            (Some(failure), _) => failure.to_string(),
            (None, SimulatedFault::Drops) => "commands get lost on the way (simulated fault)".into(),
            (None, _) => "follows commands; no real glass moves".into(),
        };

        let name = self.name.clone();
        let working = failure.is_none();
        LensHealth {
            name,
            simulated: true,
            working,
            caution: false,
            message: message.into(),
            line_errors: 0,
            info: self.described().ok(),
        }
    }

    fn info(&mut self) -> Result<LensInfo, LensError> {
        self.described()
    }

    fn dynamics(&self) -> LensDynamics {
        self.dynamics
    }

    fn optics(&self) -> Arc<dyn Optics> {
        self.glass.clone()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use parfocal_base::clock::ManualClock;

    fn lens() -> (SimulatedLens, Arc<ManualClock>) {
        let clock = Arc::new(ManualClock::new(jiff::Timestamp::UNIX_EPOCH));
        (SimulatedLens::new(clock.clone()), clock)
    }

    fn settled(lens: &SimulatedLens, clock: &ManualClock) -> f64 {
        clock.advance(Duration::from_secs(1));
        lens.optics().focal_power_at(clock.now()).get()
    }

    #[test]
    fn follows_commands_and_reports_what_a_driver_can_know() {
        let (mut lens, clock) = lens();
        lens.set(FocalPower::MAX).unwrap();
        assert!((settled(&lens, &clock) - 0.996).abs() < 1e-9, "the glass lags by the play");
        assert!((lens.measured().unwrap().get() - 1.0).abs() < 1e-9, "the driver cannot see that");
        assert!(lens.health().working && lens.health().simulated);
    }

    #[test]
    fn drops_take_the_command_and_move_nothing() {
        let (mut lens, clock) = lens();
        lens.fault = SimulatedFault::Drops;

        assert_eq!(lens.set(FocalPower::MAX), Ok(()));
        assert!((settled(&lens, &clock) - 0.5).abs() < 1e-9);
        assert!(lens.health().message.contains("lost"));
    }

    #[test]
    fn each_failing_fault_says_so_leaves_the_glass_and_heals() {
        for (fault, expected) in [
            (SimulatedFault::Stalls, "the lens does not accept commands"),
            (SimulatedFault::Refuses, "the lens refused"),
            (SimulatedFault::Gone, "the lens does not answer"),
        ] {
            let (mut lens, clock) = lens();
            lens.fault = fault;

            let error = lens.set(FocalPower::MAX).unwrap_err();
            assert!(error.to_string().starts_with(expected), "{error}");
            assert!(!lens.health().working);
            assert!((settled(&lens, &clock) - 0.5).abs() < 1e-9);
            assert_eq!(lens.measured().is_none(), fault == SimulatedFault::Gone);
            assert_eq!(lens.info().is_err(), fault == SimulatedFault::Gone);

            lens.fault = SimulatedFault::None;
            lens.set(FocalPower::MIN).unwrap();
            assert!((settled(&lens, &clock) - 0.004).abs() < 1e-9);
            assert!(lens.health().working);
        }
    }
}
