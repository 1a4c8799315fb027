//! The options that choose a lens, and functions that move it.

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use crate::cli::interrupt;
use crate::cli::output::Failure;
use parfocal_base::FocalPower;
use parfocal_base::clock::SystemClock;
use parfocal_devices::lens::{self, Lens, LensInfo};

/// The lens to use, and the output format.
#[derive(Debug, clap::Args)]
pub struct LensChoice {
    /// `optotune:auto` or `optotune:/dev/...`, with `?min=5&max=10` to use only those dioptres; `simulated`; or
    /// `emulated`, an emulated Optotune driver, with options like those of `lens emulate`: `?delay=10&settling=40`.
    #[arg(long, value_name = "SPEC")]
    pub lens: String,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

impl LensChoice {
    pub fn open(&self) -> Result<Box<dyn Lens>, Failure> {
        interrupt::let_lenses_go_first()?;
        Ok(lens::open(&self.lens, Arc::new(SystemClock))?)
    }

    pub fn open_to_stay(&self) -> Result<Box<dyn Lens>, Failure> {
        Ok(lens::open_to_stay(&self.lens, Arc::new(SystemClock))?)
    }
}

/// The position of a lens (see docs/scripting.md).
#[derive(Debug, Serialize)]
pub struct Position {
    pub focal_power: f64,
    pub dioptre: f64,
}

/// Moves the lens to `target`, lets it settle, and reads back its position.
pub fn go(lens: &mut dyn Lens, target: FocalPower) -> Result<Position, Failure> {
    lens.set(target)?;
    std::thread::sleep(settled_after(lens));
    let read_back = lens.read_back()?;
    Ok(Position { focal_power: read_back.get(), dioptre: dioptre(&lens.info()?, read_back) })
}

/// How long to wait after a command: four times the settling time leaves 1/160 000 of a step.
fn settled_after(lens: &dyn Lens) -> Duration {
    let dynamics = lens.dynamics();
    dynamics.delay + dynamics.settling * 4
}

pub fn dioptre(info: &LensInfo, power: FocalPower) -> f64 {
    info.min_dioptre + power.get() * (info.max_dioptre - info.min_dioptre)
}
