//! The steps as a picture.

use super::{Measurement, Sample};
use parfocal_base::plot::{Axis, Plot};

/// Points of the line that shows the fit.
const POINTS: u32 = 200;

/// Share of the step over time, as SVG: a dot a frame, and the fit as a line.
pub fn plot(measurement: &Measurement) -> String {
    let fit = &measurement.both;
    // Three times the lens's own time also shows how it came to rest.
    let longest = (3000.0 * (fit.delay + fit.settling).max(0.01)).ceil();
    let across = Axis { label: "ms after the command", from: 0.0, to: longest };
    let up = Axis { label: "share of the step", from: -0.2, to: 1.2 };

    let mut plot = Plot::default();
    let mut panel = plot.panel(across, up);
    let [steps_up, steps_down] = &measurement.samples;
    let point = |sample: &Sample| (1000.0 * sample.at, sample.share);
    panel.dots("steps up", "#0a58ca", steps_up.iter().map(point));
    panel.dots("steps down", "#c2410c", steps_down.iter().map(point));

    let name = format!("fit: delay {:.1} ms, settling {:.1} ms", 1000.0 * fit.delay, 1000.0 * fit.settling);
    let times = (0..=POINTS).map(|step| longest * f64::from(step) / f64::from(POINTS));
    panel.line(&name, "#111111", times.map(|ms| (ms, fit.share(ms / 1000.0))));

    plot.svg()
}
