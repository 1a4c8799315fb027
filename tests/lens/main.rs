//! The Optotune driver against an emulated Lens Driver 4 behind a pseudo-terminal.

mod closing;
mod command_line;
mod doctor;
mod driver;
mod dynamics;
mod faults;
mod line;

use std::sync::Arc;
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_devices::lens::emulator::{Emulator, Model};
use parfocal_devices::lens::{self, Lens, LensError};

fn emulator(model: Model) -> Emulator {
    Emulator::start(model, Arc::new(SystemClock)).unwrap()
}

fn quick() -> Model {
    Model { latency: Duration::ZERO, ..Model::default() }
}

fn open(emulator: &Emulator, options: &str) -> Result<Box<dyn Lens>, LensError> {
    lens::open(&format!("optotune:{}{options}", emulator.path().display()), Arc::new(SystemClock))
}

fn refused(outcome: Result<Box<dyn Lens>, LensError>) -> String {
    outcome.err().expect("it must not open").to_string()
}

fn power(value: f64) -> FocalPower {
    FocalPower::new(value).unwrap()
}

/// Checks `condition` until it holds, and returns how long that took. Fails after ten seconds.
fn until(what: &str, mut condition: impl FnMut() -> bool) -> Duration {
    let begun = SystemClock.now();
    while !condition() {
        assert!(SystemClock.now().since(begun) < Duration::from_secs(10), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
    SystemClock.now().since(begun)
}

fn last_command(emulator: &Emulator) -> Option<i16> {
    emulator.commands().last().map(|&(_, raw)| raw)
}
