//! `parfocal lens measure`: delay, settling and hysteresis of a lens, as a camera sees them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use indicatif::ProgressBar;
use serde::Serialize;

use super::which::LensChoice;
use crate::cli::output::{Failure, print_result};
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::files::replace;
use parfocal_devices::camera::{self, CameraSettings};
use parfocal_devices::lens::{LensInfo, MeasuredDynamics};
use parfocal_imaging::Reconstructor;
use parfocal_pipeline::control::Eye;
use parfocal_pipeline::lens_measurement::{CameraView, Fit, Measurement, Plan, measure, plot};

/// Arguments of `parfocal lens measure`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    which: LensChoice,
    /// Camera that looks through the lens at something still: `gige:ID`; try it with `phantom:still`.
    #[arg(long, value_name = "SPEC")]
    camera: String,
    /// Frame rate to request from the camera, per second; a higher rate measures more finely.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=1000))]
    fps: u32,
    /// Number of steps up, and again of steps down.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Milliseconds to watch each step.
    #[arg(long, value_name = "MS", default_value_t = 300, value_parser = clap::value_parser!(u32).range(20..=10_000))]
    watch: u32,
    /// Also save into this folder dynamics.toml (for `parfocal serve --lens-dynamics`) and the plot steps.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// What is printed as JSON. Times in milliseconds, focal powers from 0 to 1.
#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    found: MeasuredDynamics,
    hysteresis_dioptre: f64,
    up: Times,
    down: Times,
    between: (f64, f64),
    frames: usize,
    /// Root mean square deviation from the fit, as a fraction of the step.
    rms: f64,
}

#[derive(Debug, Serialize)]
struct Times {
    delay_ms: f64,
    settling_ms: f64,
}

/// Measures and reports.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);

    let mut lens = arguments.which.open()?;
    let info = lens.info()?;

    let settings =
        CameraSettings { fps: arguments.fps.into(), seed: 0, optics: lens.optics(), clock: Arc::clone(&clock) };
    let camera = camera::open(&arguments.camera, settings)?;
    let eye = Eye::new(Reconstructor::default());
    let mut view = CameraView::new(camera, eye, Arc::clone(&clock));

    let watch = Duration::from_millis(arguments.watch.into());
    let plan = Plan { repeats: arguments.repeats, watch, ..Plan::default() };

    let progress = ProgressBar::new_spinner().with_message("stepping the lens and watching it settle");
    progress.enable_steady_tick(Duration::from_millis(100));
    let measured = measure(lens.as_mut(), &mut view, plan, &|time| std::thread::sleep(time))?;
    progress.finish_and_clear();

    let report = Report::new(&measured, info, clock.as_ref());
    // A folder that cannot be written costs nobody the measurement.
    let saved = arguments.out.as_ref().map_or(Ok(()), |folder| save(folder, &report, &measured));
    print_result(arguments.which.json, &report, || report.text())?;
    saved
}

impl Report {
    fn new(measured: &Measurement, info: LensInfo, clock: &dyn Clock) -> Self {
        let times = |fit: &Fit| Times { delay_ms: millis(fit.delay), settling_ms: millis(fit.settling) };
        let Times { delay_ms, settling_ms } = times(&measured.both);

        Self {
            hysteresis_dioptre: measured.hysteresis * (info.max_dioptre - info.min_dioptre),
            found: MeasuredDynamics {
                driver: info.driver,
                serial: info.serial,
                date: clock.wall().to_string(),
                delay_ms,
                settling_ms,
                hysteresis: measured.hysteresis,
            },
            up: times(&measured.up),
            down: times(&measured.down),
            between: measured.between,
            frames: measured.samples.iter().map(Vec::len).sum(),
            rms: measured.both.rms,
        }
    }

    fn text(&self) -> String {
        let Self { found, up, down, between: (low, high), .. } = self;

        format!(
            "delay       {:6.1} ms   up {:.1}, down {:.1}\nsettling    {:6.1} ms   up {:.1}, down {:.1}\n\
             hysteresis  {:6.4}      {:.3} dpt\n\
             from {} frames, between focal power {low:.2} and {high:.2}; scatter {:.1} % of a step\n",
            found.delay_ms,
            up.delay_ms,
            down.delay_ms,
            found.settling_ms,
            up.settling_ms,
            down.settling_ms,
            found.hysteresis,
            self.hysteresis_dioptre,
            self.frames,
            100.0 * self.rms,
        )
    }
}

fn millis(seconds: f64) -> f64 {
    1000.0 * seconds
}

fn save(folder: &Path, report: &Report, measured: &Measurement) -> Result<(), Failure> {
    let failed = |error: std::io::Error| format!("cannot write to {}: {error}", folder.display());

    std::fs::create_dir_all(folder).map_err(failed)?;
    replace(&folder.join("dynamics.toml"), report.found.to_toml()?.as_bytes()).map_err(failed)?;
    replace(&folder.join("steps.svg"), plot(measured).as_bytes()).map_err(failed)?;
    Ok(())
}
