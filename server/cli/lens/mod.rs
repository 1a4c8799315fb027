//! `parfocal lens`: describes a lens, moves it by hand, sweeps it, measures it, and emulates one.

mod emulate;
mod measure;
mod sweep;
mod which;

use super::output::{Failure, print, print_json};
use parfocal_base::FocalPower;
use which::{LensChoice, go};

/// What `parfocal lens` does.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Print what the lens is and what state it is in.
    Info {
        #[command(flatten)]
        which: LensChoice,
    },
    /// Move to a focal power and stay there.
    Set {
        /// From 0, the lowest dioptre of the range in use, to 1, the highest.
        #[arg(value_parser = parse_focal_power)]
        focal_power: FocalPower,
        #[command(flatten)]
        which: LensChoice,
    },
    /// Step through the range and compare the positions requested with those read back.
    Sweep(sweep::Arguments),
    /// Measure delay, settling time and hysteresis: step the lens and watch it with a camera.
    Measure(measure::Arguments),
    /// Start an emulated Optotune Lens Driver 4, print its port and serve it until Ctrl-C.
    Emulate(emulate::Arguments),
}

/// Does what the arguments say.
///
/// # Errors
/// If the lens cannot be used or does not obey.
pub fn run(action: &Action) -> Result<(), Failure> {
    match action {
        Action::Info { which } => info(which),
        Action::Set { focal_power, which } => set(*focal_power, which),
        Action::Sweep(arguments) => sweep::run(arguments),
        Action::Measure(arguments) => measure::run(arguments),
        Action::Emulate(arguments) => emulate::run(arguments),
    }
}

fn info(which: &LensChoice) -> Result<(), Failure> {
    let mut lens = which.open()?;
    let info = lens.info()?;
    if which.json {
        return print_json(&info);
    }

    let temperature = info.temperature_celsius.map_or("unknown".into(), |celsius| format!("{celsius:.1} °C"));
    let status = if info.status.is_empty() { "all well".into() } else { info.status.join("; ") };

    print(&format!(
        "driver       {}\nfirmware     {}\nserial       {}\n\
         range        {:.2} to {:.2} dpt\ntemperature  {temperature}\n\
         mode         {}\nstatus       {status}\nline errors  {}\n",
        info.driver, info.firmware, info.serial, info.min_dioptre, info.max_dioptre, info.mode, info.line_errors
    ))
}

fn set(target: FocalPower, which: &LensChoice) -> Result<(), Failure> {
    let mut lens = which.open_to_stay()?;
    let position = go(lens.as_mut(), target)?;
    if which.json {
        return print_json(&position);
    }
    print(&format!("focal power {:.4}, {:.3} dpt\n", position.focal_power, position.dioptre))
}

fn parse_focal_power(text: &str) -> Result<FocalPower, String> {
    let value: f64 = text.parse().map_err(|_| "must be a number from 0 to 1".to_owned())?;
    FocalPower::new(value).map_err(|error| error.to_string())
}
