//! `parfocal lens sweep`: requested positions against those read back, over the range, as a table and a plot.

use std::fmt::Write;
use std::path::PathBuf;

use indicatif::ProgressBar;
use serde::Serialize;

use super::which::{LensChoice, dioptre, go};
use crate::cli::output::{Failure, print_result, save_plot};
use parfocal_base::FocalPower;
use parfocal_base::plot::{Axis, Plot};

/// Arguments of `parfocal lens sweep`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    which: LensChoice,
    /// Number of stops on the way up, and again on the way down.
    #[arg(long, default_value_t = 21, value_parser = clap::value_parser!(u16).range(2..=1001))]
    steps: u16,
    /// Also save the plot as this SVG file.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// One stop of the sweep: focal powers from 0 to 1, and dioptres.
#[derive(Debug, Serialize)]
struct Stop {
    asked: f64,
    read_back: f64,
    asked_dioptre: f64,
    read_back_dioptre: f64,
}

/// Sweeps up and down.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let stops = measure(arguments)?;
    // A plot that cannot be saved costs nobody the measurement.
    let saved = arguments.plot.as_ref().map_or(Ok(()), |path| save_plot(path, &plot(&stops)));
    print_result(arguments.which.json, &stops, || table(&stops))?;
    saved
}

fn measure(arguments: &Arguments) -> Result<Vec<Stop>, Failure> {
    let mut lens = arguments.which.open()?;
    let info = lens.info()?;
    let last = arguments.steps - 1;
    let progress = ProgressBar::new(2 * u64::from(arguments.steps));

    (0..=last)
        .chain((0..=last).rev())
        .map(|step| {
            let asked = FocalPower::nearest(f64::from(step) / f64::from(last));
            let reached = go(lens.as_mut(), asked)?;
            progress.inc(1);
            Ok(Stop {
                asked: asked.get(),
                read_back: reached.focal_power,
                asked_dioptre: dioptre(&info, asked),
                read_back_dioptre: reached.dioptre,
            })
        })
        .collect()
}

fn worst(stops: &[Stop]) -> f64 {
    stops.iter().map(|stop| (stop.read_back_dioptre - stop.asked_dioptre).abs()).fold(0.0, f64::max)
}

fn table(stops: &[Stop]) -> String {
    let mut text = String::from("  asked  read back       asked   read back        off\n");
    for Stop { asked, read_back, asked_dioptre, read_back_dioptre } in stops {
        let off = read_back_dioptre - asked_dioptre;
        let _ = writeln!(
            text,
            "{asked:7.3}    {read_back:7.3}  {asked_dioptre:6.3} dpt  {read_back_dioptre:6.3} dpt  {off:+.3} dpt"
        );
    }

    let _ = writeln!(text, "largest difference {:.3} dpt", worst(stops));
    text
}

/// Plots positions read back over those requested, both in dioptres; the line is where they agree.
fn plot(stops: &[Stop]) -> String {
    let positions = stops.iter().flat_map(|stop| [stop.asked_dioptre, stop.read_back_dioptre]);
    let hundredths = positions.map(|dioptre| dioptre * 100.0);
    let least = hundredths.clone().fold(f64::INFINITY, f64::min).floor() / 100.0;
    let most = hundredths.fold(f64::NEG_INFINITY, f64::max).ceil() / 100.0;

    let mut plot = Plot::default();
    let axis = |label| Axis { label, from: least, to: most };
    let mut panel = plot.panel(axis("asked, dpt"), axis("read back, dpt"));
    panel.line("where both agree", "#999999", [(least, least), (most, most)]);
    let name = format!("read back; largest difference {:.3} dpt", worst(stops));
    panel.dots(&name, "#0a58ca", stops.iter().map(|stop| (stop.asked_dioptre, stop.read_back_dioptre)));
    plot.svg()
}
