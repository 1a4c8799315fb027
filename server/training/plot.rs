//! Plots as SVG: lines over frames or poses.

use std::fmt::Write as _;

/// Width of a plot.
pub const WIDTH: f64 = 900.0;
/// Height of a panel.
pub const PANEL: f64 = 230.0;
/// Where panels begin, rightwards.
pub const LEFT: f64 = 55.0;

/// The beginning of a plot of this height.
#[must_use]
pub fn begin(height: f64) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    )
}

/// A frame with its top at `top`, for values of `label` from 0 to `most` over `across`.
pub fn panel(svg: &mut String, top: f64, label: &str, most: f64, across: &str) {
    let (right, bottom) = (WIDTH - 15.0, top + PANEL);
    let _ = writeln!(
        svg,
        "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{}\" height=\"{PANEL}\" fill=\"none\" stroke=\"#cccccc\"/>\
         <text x=\"{LEFT}\" y=\"{}\">{label}</text><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{most}</text>\
         <text x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">0</text>\
         <text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{across}</text>",
        right - LEFT,
        top - 5.0,
        LEFT - 5.0,
        top + 10.0,
        LEFT - 5.0,
        bottom + 14.0,
    );
}

/// A line through `values` in the panel whose top is at `top`.
#[allow(clippy::cast_precision_loss, reason = "frame numbers are small")]
pub fn line(svg: &mut String, values: &[f64], top: f64, most: f64, colour: &str, name: &str) {
    let step = (WIDTH - 15.0 - LEFT) / (values.len().max(2) - 1) as f64;
    let mut points = String::new();
    for (index, value) in values.iter().enumerate() {
        let y = top + PANEL * (1.0 - (value / most).clamp(0.0, 1.0));
        let _ = write!(points, "{:.1},{y:.1} ", LEFT + step * index as f64);
    }
    let _ = writeln!(
        svg,
        "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\">\
         <title>{name}</title></polyline>"
    );
}

/// What each colour stands for, in a row whose base line is at `y`.
pub fn legend<'a>(svg: &mut String, y: f64, entries: impl IntoIterator<Item = (&'a str, &'a str)>) {
    let mut x = LEFT;
    for (name, colour) in entries {
        let _ = writeln!(svg, "<rect x=\"{x}\" y=\"{}\" width=\"12\" height=\"4\" fill=\"{colour}\"/>", y - 6.0);
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y}\">{name}</text>", x + 16.0);
        x += 105.0;
    }
}

/// Focal powers over poses: a line for each name and colour.
#[must_use]
pub fn over_poses(lines: &[(&str, &str, &[f64])]) -> String {
    let height = PANEL + 70.0;
    let mut svg = begin(height);
    panel(&mut svg, 20.0, "focal power", 1.0, "pose");
    for (name, colour, values) in lines {
        line(&mut svg, values, 20.0, 1.0, colour, name);
    }
    legend(&mut svg, height - 12.0, lines.iter().map(|(name, colour, _)| (*name, *colour)));
    svg.push_str("</svg>\n");
    svg
}
