//! Plots as SVG: panels one below another, each with lines and dots over one axis, and a key of their names below.

use std::fmt::Write as _;

/// Width of a plot.
const WIDTH: f64 = 900.0;
/// Left end of panels and keys: leaves room for the numbers of the vertical axis.
const LEFT: f64 = 55.0;
/// Right end of panels and keys.
const RIGHT: f64 = WIDTH - 15.0;
/// Height of a panel.
const PANEL: f64 = 230.0;
/// Gap between panels: leaves room for the words below one panel and above the next.
const GAP: f64 = 50.0;
/// Height of a row of keys.
const ROW: f64 = 18.0;
/// Longest name in the key, in characters; a longer one loses its beginning.
const LONGEST_NAME: usize = 80;

/// The horizontal or vertical axis of a panel.
#[derive(Debug, Clone, Copy)]
pub struct Axis<'a> {
    /// Name of the quantity, with its unit.
    pub label: &'a str,
    /// Value at its start: left or bottom.
    pub from: f64,
    /// Value at its end: right or top.
    pub to: f64,
}

impl Axis<'_> {
    /// Position of `value` along the axis: 0 at its start, 1 at its end; clamped to these.
    fn share(&self, value: f64) -> f64 {
        let length = self.to - self.from;
        if length == 0.0 { 0.0 } else { ((value - self.from) / length).clamp(0.0, 1.0) }
    }
}

/// A plot that is being drawn.
#[derive(Debug, Default)]
pub struct Plot {
    panels: usize,
    body: String,
    /// Name and colour of each series, in drawing order.
    keys: Vec<(String, String)>,
}

/// A panel of a [`Plot`].
pub struct Panel<'a> {
    plot: &'a mut Plot,
    across: Axis<'a>,
    up: Axis<'a>,
    top: f64,
}

impl Plot {
    /// Begins a panel below the existing ones.
    pub fn panel<'a>(&'a mut self, across: Axis<'a>, up: Axis<'a>) -> Panel<'a> {
        let panel = self.frame(across, up);
        let bottom = panel.top + PANEL;
        panel.plot.text(LEFT, bottom + 14.0, "start", &across.from.to_string());
        panel.plot.text(RIGHT, bottom + 14.0, "end", &across.to.to_string());
        panel
    }

    /// Begins a panel whose horizontal axis has named places: the first at 1, the second at 2, and so on.
    pub fn panel_of<'a>(&'a mut self, label: &'a str, names: &[String], up: Axis<'a>) -> Panel<'a> {
        let across = Axis { label: "", from: 0.5, to: names.len() as f64 + 0.5 };
        let panel = self.frame(across, up);
        let bottom = panel.top + PANEL;
        for (name, place) in names.iter().zip(1..) {
            let (x, _) = panel.place((f64::from(place), up.from));
            panel.plot.text(x, bottom + 14.0, "middle", name);
        }
        panel.plot.text(f64::midpoint(LEFT, RIGHT), bottom + 29.0, "middle", label);
        panel
    }

    /// Draws the frame of a panel, with its labels and the numbers of its vertical axis.
    fn frame<'a>(&'a mut self, across: Axis<'a>, up: Axis<'a>) -> Panel<'a> {
        let top = 20.0 + self.panels as f64 * (PANEL + GAP);
        self.panels += 1;

        let bottom = top + PANEL;
        let width = RIGHT - LEFT;
        let _ = writeln!(
            self.body,
            "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{width}\" height=\"{PANEL}\" fill=\"none\" stroke=\"#cccccc\"/>"
        );

        self.text(LEFT, top - 5.0, "start", up.label);
        self.text(LEFT - 5.0, top + 10.0, "end", &up.to.to_string());
        self.text(LEFT - 5.0, bottom, "end", &up.from.to_string());
        self.text(f64::midpoint(LEFT, RIGHT), bottom + 14.0, "middle", across.label);
        Panel { plot: self, across, up, top }
    }

    /// The whole plot as an SVG document.
    pub fn svg(mut self) -> String {
        let mut x = LEFT;
        let mut y = 20.0 + self.panels as f64 * (PANEL + GAP) + ROW - 10.0;
        for (name, colour) in std::mem::take(&mut self.keys) {
            let width = key_width(&name);
            if x + width > RIGHT && x > LEFT {
                x = LEFT;
                y += ROW;
            }

            let swatch = y - 6.0;
            let _ =
                writeln!(self.body, "<rect x=\"{x:.1}\" y=\"{swatch}\" width=\"12\" height=\"4\" fill=\"{colour}\"/>");
            self.text(x + 16.0, y, "start", &name);
            x += width;
        }

        let height = y + 12.0;
        let body = self.body;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
             font-size=\"12\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{body}</svg>\n"
        )
    }

    fn text(&mut self, x: f64, y: f64, anchor: &str, text: &str) {
        let text = escaped(text);
        let _ = writeln!(self.body, "<text x=\"{x:.1}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>");
    }

    /// Adds `name` to the key, if it is not there yet.
    fn key(&mut self, name: &str, colour: &str) {
        let key = (shortened(name), colour.to_owned());
        if !self.keys.contains(&key) {
            self.keys.push(key);
        }
    }
}

impl Panel<'_> {
    /// Draws a line through `points` (across, up), with its name in the key.
    pub fn line(&mut self, name: &str, colour: &str, points: impl IntoIterator<Item = (f64, f64)>) {
        let mut places = String::new();
        for (x, y) in points.into_iter().map(|point| self.place(point)) {
            let _ = write!(places, "{x:.1},{y:.1} ");
        }
        let title = escaped(name);
        let _ = writeln!(
            self.plot.body,
            "<polyline points=\"{places}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\">\
             <title>{title}</title></polyline>"
        );

        self.plot.key(name, colour);
    }

    /// Draws a line through `values`, spaced by 1 across, from the start of the axis.
    pub fn values(&mut self, name: &str, colour: &str, values: &[f64]) {
        let from = self.across.from;
        self.line(name, colour, values.iter().enumerate().map(|(index, &value)| (from + index as f64, value)));
    }

    /// Draws a dot at each of `points` (across, up), with their name in the key. Points outside the panel are left out.
    pub fn dots(&mut self, name: &str, colour: &str, points: impl IntoIterator<Item = (f64, f64)>) {
        let within = |axis: &Axis<'_>, value: f64| (axis.from..=axis.to).contains(&value);
        let _ = writeln!(self.plot.body, "<g fill=\"{colour}\" fill-opacity=\"0.6\">");
        for point in points {
            if within(&self.across, point.0) && within(&self.up, point.1) {
                let (x, y) = self.place(point);
                let _ = writeln!(self.plot.body, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\"/>");
            }
        }

        self.plot.body.push_str("</g>\n");
        self.plot.key(name, colour);
    }

    /// Draws a horizontal line at `up` across the panel, with its number on the left.
    pub fn level(&mut self, up: f64) {
        let (_, y) = self.place((self.across.from, up));
        let _ = writeln!(
            self.plot.body,
            "<path d=\"M{LEFT} {y:.1}H{RIGHT}\" stroke=\"#dddddd\" stroke-dasharray=\"2 4\"/>"
        );
        self.plot.text(LEFT - 5.0, y + 4.0, "end", &up.to_string());
    }

    /// Draws a thick bar at each of `points` (across, up), with their name in the key. `half` is half the width of a
    /// bar, in units of the horizontal axis.
    pub fn bars(&mut self, name: &str, colour: &str, half: f64, points: impl IntoIterator<Item = (f64, f64)>) {
        for (across, up) in points {
            let (from, y) = self.place((across - half, up));
            let (to, _) = self.place((across + half, up));
            let _ = writeln!(
                self.plot.body,
                "<path d=\"M{from:.1} {y:.1}H{to:.1}\" stroke=\"{colour}\" stroke-width=\"4\"/>"
            );
        }
        self.plot.key(name, colour);
    }

    /// Coordinates of a point in the picture; a point outside the panel is moved to its edge.
    fn place(&self, (across, up): (f64, f64)) -> (f64, f64) {
        let x = LEFT + self.across.share(across) * (RIGHT - LEFT);
        let y = self.top + (1.0 - self.up.share(up)) * PANEL;
        (x, y)
    }
}

/// Room for a key: swatch, gaps, and 7.5 a character, wider than sans-serif letters of 12 are on average.
fn key_width(name: &str) -> f64 {
    30.0 + 7.5 * name.chars().count() as f64
}

/// The name, or only its end if it is too long for a row, as the path of a file deep in folders can be.
fn shortened(name: &str) -> String {
    let extra = name.chars().count().saturating_sub(LONGEST_NAME);
    if extra == 0 { name.to_owned() } else { format!("…{}", name.chars().skip(extra).collect::<String>()) }
}

/// `text` escaped for XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Axis<'static> = Axis { label: "", from: 0.0, to: 1.0 };

    /// Left end, base line and name of each key.
    fn keys(svg: &str) -> Vec<(f64, f64, String)> {
        let lines: Vec<&str> = svg.lines().collect();
        let swatches = lines.windows(2).filter(|pair| pair[0].contains("height=\"4\""));
        let number = |line: &str, name: &str| -> f64 {
            let rest = line.split_once(&format!(" {name}=\"")).unwrap().1;
            rest.split_once('"').unwrap().0.parse().unwrap()
        };

        swatches
            .map(|pair| {
                let name = pair[1].split_once('>').unwrap().1.strip_suffix("</text>").unwrap();
                (number(pair[0], "x"), number(pair[1], "y"), name.to_owned())
            })
            .collect()
    }

    #[test]
    fn keys_continue_in_the_next_row_and_stay_within_the_picture() {
        let names = ["fixed", "mgm-hill-climber", "mlr-hill-climber", "mgm-learned", "mlr-learned", "cnn-learned"];
        let mut plot = Plot::default();
        let mut panel = plot.panel(UNIT, UNIT);
        for name in names.into_iter().chain(["parfocal", "file:my.pt", "optimum"]) {
            panel.values(name, "black", &[0.5]);
        }
        let svg = plot.svg();

        let keys = keys(&svg);
        assert_eq!(keys.len(), 9);
        for (key, next) in keys.iter().zip(&keys[1..]) {
            // At 12 pixels no sans-serif letter of these names is wider than 7 on average.
            let end = key.0 + 7.0 * f64::from(u8::try_from(key.2.len()).unwrap());
            assert!(end <= WIDTH && (next.1 > key.1 || end < next.0 - 16.0), "{key:?} {next:?}");
        }
        let last = keys.last().unwrap();
        assert!(last.1 > 270.0 && svg.contains(&format!("0 0 900 {}", last.1 + 12.0)), "{svg}");
    }

    #[test]
    fn names_are_escaped_and_long_ones_lose_their_beginning() {
        let name = format!("file:{}/a&b<c>.pt", "x".repeat(200));
        let mut plot = Plot::default();
        plot.panel(UNIT, UNIT).values(&name, "black", &[0.5]);
        let svg = plot.svg();
        assert!(svg.contains("<title>file:xxx") && svg.contains("/a&amp;b&lt;c&gt;.pt</title>"), "{svg}");
        assert!(keys(&svg)[0].2.starts_with("…xxx"), "{svg}");
    }

    #[test]
    fn named_places_stand_below_a_panel_and_bars_over_them() {
        let mut plot = Plot::default();
        let names = ["fixed".to_owned(), "a<b".to_owned()];
        let up = Axis { label: "points", from: 1.0, to: 5.0 };
        let mut panel = plot.panel_of("policy", &names, up);
        panel.level(3.0);
        panel.bars("median", "black", 0.25, [(2.0, 3.0)]);
        let svg = plot.svg();

        // Two places over 830: at a quarter and three quarters; the bar is a quarter of 830 long, half way up.
        assert!(svg.contains("<text x=\"262.5\" y=\"264\" text-anchor=\"middle\">fixed</text>"), "{svg}");
        assert!(svg.contains("<text x=\"677.5\" y=\"264\" text-anchor=\"middle\">a&lt;b</text>"), "{svg}");
        assert!(svg.contains("<path d=\"M573.8 135.0H781.2\" stroke=\"black\""), "{svg}");
        assert!(svg.contains("<text x=\"50.0\" y=\"139\" text-anchor=\"end\">3</text>"), "{svg}");
    }

    #[test]
    fn a_point_lies_where_its_axes_say() {
        let mut plot = Plot::default();
        let across = Axis { label: "ms", from: 0.0, to: 40.0 };
        let up = Axis { label: "share", from: -1.0, to: 1.0 };
        let mut panel = plot.panel(across, up);
        panel.dots("seen", "red", [(10.0, 0.0), (50.0, 0.0), (20.0, 2.0)]);
        let svg = plot.svg();

        // A quarter of the way from 55 to 885, and half way down from 20 to 250; the others lie outside.
        assert!(svg.contains("<circle cx=\"262.5\" cy=\"135.0\""), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 1);
    }
}
