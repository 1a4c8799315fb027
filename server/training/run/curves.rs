//! A training's curves: as lines of text, and as a picture.
#![allow(clippy::cast_precision_loss, reason = "counts of updates")]

use std::fmt::Write as _;

/// Updates done, mean loss since the point before, and the validation's mean absolute error where there was one.
pub(super) type Point = (u64, f64, Option<f64>);

/// `curve` with a line for each point: its three numbers between commas, the last one empty where there is none.
pub(super) fn text(curve: &[Point]) -> String {
    let line = |&(updates, loss, mae): &Point| {
        format!("{updates},{loss},{}", mae.map_or(String::new(), |mae| mae.to_string()))
    };
    curve.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// What [`text`] made a text of; lines that it cannot have written are left out.
pub(super) fn parse(text: &str) -> Vec<Point> {
    let point = |line: &str| {
        let mut parts = line.split(',');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?, parts.next()?.parse().ok()))
    };
    text.lines().filter_map(point).collect()
}

/// Loss (grey) and validation error (blue) over updates, each from 0 to its largest value.
pub(super) fn svg(curve: &[Point]) -> String {
    let end = curve.last().map_or(1, |point| point.0).max(1) as f64;
    let line = |points: Vec<(u64, f64)>, colour: &str, name: &str| {
        let most = points.iter().map(|point| point.1).fold(1e-9, f64::max);
        let mut text = String::new();
        for (updates, value) in points {
            let _ = write!(text, "{:.1},{:.1} ", 20.0 + 760.0 * updates as f64 / end, 280.0 - 240.0 * value / most);
        }
        format!(
            "<polyline points=\"{text}\" fill=\"none\" stroke=\"{colour}\"/>\
             <text x=\"{}\" y=\"20\" fill=\"{colour}\">{name}, at most {most:.3}</text>",
            if colour == "grey" { 20 } else { 400 }
        )
    };
    let loss = line(curve.iter().map(|point| (point.0, point.1)).collect(), "grey", "loss");
    let mae = line(curve.iter().filter_map(|point| Some((point.0, point.2?))).collect(), "blue", "validation MAE");
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 800 300\" font-family=\"sans-serif\" font-size=\"12\">\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>{loss}{mae}\
         <text x=\"780\" y=\"296\" text-anchor=\"end\">{end} updates</text></svg>\n"
    )
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
