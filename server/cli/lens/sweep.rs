//! `parfocal lens sweep`: requested positions against those read back, over the range, as a table and a plot.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use serde::Serialize;

use super::which::{LensChoice, dioptre, go};
use crate::cli::output::{Failure, print_result};
use parfocal_base::FocalPower;
use parfocal_base::files::replace;

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
    if let Some(path) = &arguments.plot {
        save(path, &plot(&stops))?;
    }
    print_result(arguments.which.json, &stops, || table(&stops))
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
    const SIDE: f64 = 400.0;
    const MARGIN: f64 = 50.0;
    let ends = |pick: fn(f64, f64) -> f64, start| stops.iter().map(|stop| stop.asked_dioptre).fold(start, pick);
    let min = ends(f64::min, f64::INFINITY);
    let max = ends(f64::max, f64::NEG_INFINITY);

    let along = |value: f64| MARGIN + (value - min) / (max - min) * SIDE;
    let up = |value: f64| MARGIN + SIDE - (value - min) / (max - min) * SIDE;
    let low = MARGIN;
    let high = MARGIN + SIDE;
    let middle = MARGIN + SIDE / 2.0;
    let whole = SIDE + 2.0 * MARGIN;

    let mut dots = String::new();
    for stop in stops {
        let x = along(stop.asked_dioptre);
        let y = up(stop.read_back_dioptre);
        let _ = writeln!(dots, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/>");
    }

    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {whole} {whole}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{whole}\" height=\"{whole}\" fill=\"white\"/>\n\
         <rect x=\"{low}\" y=\"{low}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"gray\"/>\n\
         <line x1=\"{low}\" y1=\"{high}\" x2=\"{high}\" y2=\"{low}\" stroke=\"gray\"/>\n\
         <g fill=\"#0a58ca\">\n{dots}</g>\n\
         <g text-anchor=\"middle\"><text x=\"{low}\" y=\"{0}\">{min:.2}</text>\
         <text x=\"{high}\" y=\"{0}\">{max:.2}</text>\
         <text x=\"{middle}\" y=\"{0}\">asked, dpt</text>\
         <text x=\"20\" y=\"{middle}\" transform=\"rotate(-90 20 {middle})\">read back, dpt</text>\
         <text x=\"{middle}\" y=\"30\">largest difference {1:.3} dpt</text></g>\n</svg>\n",
        high + 20.0,
        worst(stops)
    )
}

fn save(path: &Path, text: &str) -> Result<(), Failure> {
    replace(path, text.as_bytes())
        .map_err(|error| format!("cannot save the plot to {}: {error}", path.display()).into())
}
