//! The steps as a picture.

use std::fmt::Write;

use super::{Fit, Measurement, Sample};

const WIDTH: f64 = 600.0;
const HEIGHT: f64 = 300.0;
const MARGIN: f64 = 50.0;
/// Share of the step at the plot's lower and upper edge.
const SHARES: (f64, f64) = (-0.2, 1.2);
/// Colours of steps up, steps down, and the fit.
const COLOURS: [&str; 3] = ["#0a58ca", "#c2410c", "#111111"];

/// Share of the step over time, as SVG: a dot a frame, and the fit as a line.
#[must_use]
pub fn plot(measurement: &Measurement) -> String {
    let [up, down] = &measurement.samples;
    // Three times as long as the lens takes shows how it came to rest.
    let longest = 3.0 * (measurement.both.delay + measurement.both.settling).max(0.01);
    let across = |at: f64| MARGIN + at / longest * WIDTH;
    let height = |share: f64| MARGIN + (SHARES.1 - share) / (SHARES.1 - SHARES.0) * HEIGHT;
    let dots = |samples: &[Sample], colour: &str| {
        let mut text = format!("<g fill=\"{colour}\" fill-opacity=\"0.6\">\n");
        let visible = |sample: &&Sample| sample.at <= longest && (SHARES.0..=SHARES.1).contains(&sample.share);
        for sample in samples.iter().filter(visible) {
            let _ = writeln!(
                text,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.5\"/>",
                across(sample.at),
                height(sample.share)
            );
        }
        text + "</g>\n"
    };
    let mut line = String::new();
    for step in 0..=200 {
        let at = longest * f64::from(step) / 200.0;
        let _ = write!(line, "{:.1},{:.1} ", across(at), height(measurement.both.share(at)));
    }
    let (whole_width, whole_height) = (WIDTH + 2.0 * MARGIN, HEIGHT + 2.0 * MARGIN);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {whole_width} {whole_height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{whole_width}\" height=\"{whole_height}\" fill=\"white\"/>\n\
         <rect x=\"{MARGIN}\" y=\"{MARGIN}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"gray\"/>\n{}{}\
         <polyline points=\"{line}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"/>\n{}</svg>\n",
        dots(up, COLOURS[0]),
        dots(down, COLOURS[1]),
        COLOURS[2],
        words(&measurement.both, longest),
    )
}

fn words(fit: &Fit, longest: f64) -> String {
    let (left, right, bottom) = (MARGIN, MARGIN + WIDTH, MARGIN + HEIGHT);
    let (delay, settling) = (1000.0 * fit.delay, 1000.0 * fit.settling);
    format!(
        "<text x=\"{left}\" y=\"30\">delay {delay:.1} ms, settling {settling:.1} ms</text>\n\
         <text x=\"{right}\" y=\"30\" text-anchor=\"end\"><tspan fill=\"{0}\">up</tspan> <tspan fill=\"{1}\">down</tspan> \
         <tspan fill=\"{2}\">fit</tspan></text>\n\
         <text x=\"{left}\" y=\"{3}\" text-anchor=\"middle\">0</text><text x=\"{right}\" y=\"{3}\" text-anchor=\"middle\">{4:.0}</text>\
         <text x=\"{5}\" y=\"{3}\" text-anchor=\"middle\">ms after the command</text>\n\
         <text x=\"20\" y=\"{6}\" text-anchor=\"middle\" transform=\"rotate(-90 20 {6})\">share of the step</text>\n",
        COLOURS[0],
        COLOURS[1],
        COLOURS[2],
        bottom + 20.0,
        1000.0 * longest,
        MARGIN + WIDTH / 2.0,
        MARGIN + HEIGHT / 2.0,
    )
}
