//! A training's curves, as lines of CSV and as SVG.

use parfocal_base::plot::{Axis, Plot};

/// Updates done, mean loss since the previous point, and the validation's mean absolute error if there was one.
pub(super) type Point = (u64, f64, Option<f64>);

/// `curve` with one line for each point: its three values separated by commas. A missing third value is empty.
pub(super) fn text(curve: &[Point]) -> String {
    let line = |&(updates, loss, mae): &Point| {
        format!("{updates},{loss},{}", mae.map_or(String::new(), |mae| mae.to_string()))
    };
    curve.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Parses what [`text`] wrote. Skips lines that do not have that form.
pub(super) fn parse(text: &str) -> Vec<Point> {
    let point = |line: &str| {
        let mut parts = line.split(',');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?, parts.next()?.parse().ok()))
    };
    text.lines().filter_map(point).collect()
}

/// Loss and validation error over updates, each in its own panel, from 0 to its largest value.
pub(super) fn svg(curve: &[Point]) -> String {
    let end = curve.last().map_or(1, |point| point.0).max(1) as f64;
    let loss: Vec<_> = curve.iter().map(|point| (point.0 as f64, point.1)).collect();
    let mae: Vec<_> = curve.iter().filter_map(|point| Some((point.0 as f64, point.2?))).collect();

    let mut plot = Plot::default();
    for (label, colour, points) in [("loss", "#555555", loss), ("validation MAE", "#0a58ca", mae)] {
        let most = points.iter().map(|point| point.1).fold(1e-9, f64::max);
        let up = Axis { label, from: 0.0, to: (1000.0 * most).ceil() / 1000.0 };
        plot.panel(Axis { label: "updates", from: 0.0, to: end }, up).line(label, colour, points);
    }
    plot.svg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_comes_back_from_its_text() {
        let curve = [(100, 0.25, None), (200, 0.125, Some(0.0625))];
        assert_eq!(text(&curve), "100,0.25,\n200,0.125,0.0625");
        assert_eq!(parse(&text(&curve)), curve);
        assert_eq!(parse(""), []);
    }
}
