//! Plots as SVG: lines over frames or poses.

use std::fmt::Write as _;

/// Width of a plot.
const WIDTH: f64 = 900.0;
/// Height of a panel.
pub const PANEL: f64 = 230.0;
/// Where panels begin, rightwards.
const LEFT: f64 = 55.0;

/// Rightmost end of panels and keys.
const RIGHT: f64 = WIDTH - 15.0;
/// Height of a row of keys.
const ROW: f64 = 18.0;

/// A frame with its top at `top`, for values of `label` from 0 to `most` over `across`.
pub fn panel(svg: &mut String, top: f64, label: &str, most: f64, across: &str) {
    let (right, bottom) = (RIGHT, top + PANEL);
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
    let step = (RIGHT - LEFT) / (values.len().max(2) - 1) as f64;
    let mut points = String::new();
    for (index, value) in values.iter().enumerate() {
        let y = top + PANEL * (1.0 - (value / most).clamp(0.0, 1.0));
        let _ = write!(points, "{:.1},{y:.1} ", LEFT + step * index as f64);
    }
    let _ = writeln!(
        svg,
        "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\">\
         <title>{}</title></polyline>",
        escaped(name),
    );
}

/// The whole plot of what `panels` holds down to `bottom`, with a key below for each name and colour.
#[must_use]
pub fn finished<'a>(panels: &str, bottom: f64, entries: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
    let (mut keys, mut x, mut y) = (String::new(), LEFT, bottom + ROW);
    for (name, colour) in entries {
        let name = shortened(name);
        let width = key_width(&name);
        if x + width > RIGHT && x > LEFT {
            (x, y) = (LEFT, y + ROW);
        }
        let _ = writeln!(
            keys,
            "<rect x=\"{x:.1}\" y=\"{}\" width=\"12\" height=\"4\" fill=\"{colour}\"/>\
             <text x=\"{:.1}\" y=\"{y}\">{}</text>",
            y - 6.0,
            x + 16.0,
            escaped(&name),
        );
        x += width;
    }
    let height = y + 12.0;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{panels}{keys}</svg>\n"
    )
}

/// Room for a key: swatch, gaps, and 7.5 a character, wider than sans-serif letters of 12 are on average.
#[allow(clippy::cast_precision_loss, reason = "a hundred characters at most")]
fn key_width(name: &str) -> f64 {
    30.0 + 7.5 * name.chars().count() as f64
}

/// The end of a name that is too long for a row, as of a file deep in folders.
fn shortened(name: &str) -> String {
    const MOST: usize = 80;
    let extra = name.chars().count().saturating_sub(MOST);
    if extra == 0 { name.to_owned() } else { format!("…{}", name.chars().skip(extra).collect::<String>()) }
}

/// `text` as it may stand in XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Focal powers over poses: a line for each name and colour.
#[must_use]
pub fn over_poses(lines: &[(&str, &str, &[f64])]) -> String {
    let mut panels = String::new();
    panel(&mut panels, 20.0, "focal power", 1.0, "pose");
    for (name, colour, values) in lines {
        line(&mut panels, values, 20.0, 1.0, colour, name);
    }
    finished(&panels, PANEL + 40.0, lines.iter().map(|(name, colour, _)| (*name, *colour)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where each key stands: left end, base line, name.
    fn keys(svg: &str) -> Vec<(f64, f64, String)> {
        let keys = svg.lines().filter(|line| line.starts_with("<rect x=") && line.contains("height=\"4\""));
        keys.map(|line| {
            let (x, rest) = line.split_once("<text x=\"").unwrap().1.split_once("\" y=\"").unwrap();
            let (y, rest) = rest.split_once("\">").unwrap();
            (x.parse().unwrap(), y.parse().unwrap(), rest.strip_suffix("</text>").unwrap().to_owned())
        })
        .collect()
    }

    #[test]
    fn keys_go_on_in_the_next_row_and_stay_within_the_picture() {
        let names = ["fixed", "mgm-hill-climber", "mlr-hill-climber", "mgm-learned", "mlr-learned", "cnn-learned"];
        let names = names.into_iter().chain(["parfocal", "file:my.pt", "optimum"]);
        let svg = finished("", 300.0, names.map(|name| (name, "black")));
        let keys = keys(&svg);
        assert_eq!(keys.len(), 9);
        for (key, next) in keys.iter().zip(&keys[1..]) {
            // At 12 pixels no sans-serif letter of these names is wider than 7 on average.
            let end = key.0 + 7.0 * f64::from(u8::try_from(key.2.len()).unwrap());
            assert!(end <= WIDTH && (next.1 > key.1 || end < next.0 - 16.0), "{key:?} {next:?}");
        }
        let last = keys.last().unwrap();
        assert!(last.1 > 318.0 && svg.contains(&format!("0 0 900 {}", last.1 + 12.0)), "{svg}");
    }

    #[test]
    fn names_are_escaped_and_long_ones_lose_their_beginning() {
        let name = format!("file:{}/a&b<c>.pt", "x".repeat(200));
        let svg = over_poses(&[(&name, "black", &[0.5])]);
        assert!(svg.contains("<title>file:xxx") && svg.contains("/a&amp;b&lt;c&gt;.pt</title>"), "{svg}");
        assert!(keys(&svg)[0].2.starts_with("…xxx"), "{svg}");
    }
}
