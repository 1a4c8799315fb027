//! An evaluation for people and programs: JSON as in the contract, Markdown, CSV, and the paper's figure as SVG.

use std::fmt::Write as _;
use std::path::Path as FilePath;
use std::{fs, io};

use serde::Serialize;

use super::evaluate::{Comparison, ORACLE, Outcome, Row};
use super::rollout::{IN_FOCUS, Path};

/// What `evaluate` gives. The contract fixes the fields' names.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Which scans.
    pub scans: String,
    /// Seed of their courses.
    pub seed: u64,
    /// Number of scans.
    pub count: usize,
    /// Footage scanned, if any.
    pub footage: Vec<String>,
    /// One a policy.
    pub rows: Vec<Row>,
    /// One a pair of policies.
    pub comparisons: Vec<Comparison>,
}

/// The paper's figures on its simulated scans: policy, mean absolute error, its deviation, share in focus (percent).
const PAPER: [(&str, f64, f64, f64); 6] = [
    ("fixed", 0.236, 0.152, 19.0),
    ("mgm-hill-climber", 0.102, 0.138, 67.9),
    ("mlr-hill-climber", 0.092, 0.118, 68.2),
    ("mgm-learned", 0.085, 0.115, 70.4),
    ("mlr-learned", 0.098, 0.120, 66.4),
    ("cnn-learned", 0.049, 0.072, 84.9),
];

impl Report {
    /// The table as Markdown, the paper's simulated figures beside ours.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = String::from(
            "| policy | MAE ± sd | 95 % CI | in focus | travel / frame | reversals / s | paper: MAE ± sd | in focus |\n\
             |---|---|---|---|---|---|---|---|\n",
        );
        for row in &self.rows {
            let paper = PAPER
                .iter()
                .find(|paper| paper.0 == row.policy)
                .map_or_else(|| "– | –".to_owned(), |(_, mae, sd, share)| format!("{mae:.3} ± {sd:.3} | {share:.1} %"));
            let _ = writeln!(
                text,
                "| {} | {:.3} ± {:.3} | {:.3}–{:.3} | {:.1} % | {:.4} | {:.2} | {paper} |",
                row.policy,
                row.mae,
                row.sd,
                row.mae_interval.0,
                row.mae_interval.1,
                100.0 * row.in_focus,
                row.travel,
                row.reversals,
            );
        }
        let _ = writeln!(text, "\nScans: {}, {} of them, seed {}.", self.scans, self.count, self.seed);
        text
    }

    /// The rows as CSV.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = String::from("policy,frames,mae,sd,in_focus,travel,reversals\n");
        for row in &self.rows {
            let Row { policy, frames, mae, sd, in_focus, travel, reversals, .. } = row;
            let _ = writeln!(text, "{policy},{frames},{mae},{sd},{in_focus},{travel},{reversals}");
        }
        text
    }

    /// Writes `results.json`, `results.md`, `results.csv` and `figure.svg` (the first scan's paths) into `folder`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, outcomes: &[Outcome], folder: &FilePath) -> io::Result<()> {
        fs::create_dir_all(folder)?;
        fs::write(folder.join("results.json"), serde_json::to_string_pretty(self)?)?;
        fs::write(folder.join("results.md"), self.markdown())?;
        fs::write(folder.join("results.csv"), self.csv())?;
        fs::write(folder.join("figure.svg"), figure(outcomes, 0))
    }
}

const WIDTH: f64 = 900.0;
const PANEL: f64 = 230.0;
const LEFT: f64 = 55.0;
const COLOURS: [&str; 8] = ["#999999", "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00", "#cc79a7", "#6a3d9a"];

/// Focal path (above) and error (below; moving average of 5 frames) of each policy on scan `index`, the optimum in black.
#[must_use]
pub fn figure(outcomes: &[Outcome], index: usize) -> String {
    let policies: Vec<(&str, &Path)> = outcomes
        .iter()
        .filter(|outcome| outcome.policy != ORACLE)
        .filter_map(|outcome| Some((outcome.policy.as_str(), outcome.paths.get(index)?)))
        .collect();
    let height = 2.0 * PANEL + 110.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    panel(&mut svg, 20.0, "focal power", 1.0);
    panel(&mut svg, PANEL + 50.0, "focal error", 0.5);
    for (colour, (name, path)) in COLOURS.iter().cycle().zip(&policies) {
        line(&mut svg, &path.focal_power, 20.0, 1.0, colour, name);
        line(&mut svg, &moving_average(&path.errors().collect::<Vec<_>>()), PANEL + 50.0, 0.5, colour, name);
    }
    if let Some((_, path)) = policies.first() {
        line(&mut svg, &path.optimum, 20.0, 1.0, "black", "optimum");
        line(&mut svg, &vec![IN_FOCUS; path.optimum.len()], PANEL + 50.0, 0.5, "#bbbbbb", "in focus");
    }
    let mut x = LEFT;
    for (colour, name) in COLOURS.iter().cycle().zip(policies.iter().map(|p| p.0)).chain([(&"black", "optimum")]) {
        let y = height - 12.0;
        let _ = writeln!(svg, "<rect x=\"{x}\" y=\"{}\" width=\"12\" height=\"4\" fill=\"{colour}\"/>", y - 6.0);
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y}\">{name}</text>", x + 16.0);
        x += 105.0;
    }
    svg.push_str("</svg>\n");
    svg
}

fn panel(svg: &mut String, top: f64, label: &str, most: f64) {
    let (right, bottom) = (WIDTH - 15.0, top + PANEL);
    let _ = writeln!(
        svg,
        "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{}\" height=\"{PANEL}\" fill=\"none\" stroke=\"#cccccc\"/>\
         <text x=\"{LEFT}\" y=\"{}\">{label}</text><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{most}</text>\
         <text x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">0</text>\
         <text x=\"{right}\" y=\"{}\" text-anchor=\"end\">frame</text>",
        right - LEFT,
        top - 5.0,
        LEFT - 5.0,
        top + 10.0,
        LEFT - 5.0,
        bottom + 14.0,
    );
}

#[allow(clippy::cast_precision_loss, reason = "frame numbers are small")]
fn line(svg: &mut String, values: &[f64], top: f64, most: f64, colour: &str, name: &str) {
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

/// Mean of up to five values around each.
#[allow(clippy::cast_precision_loss, reason = "at most five values")]
fn moving_average(values: &[f64]) -> Vec<f64> {
    let around = |i: usize| &values[i.saturating_sub(2)..(i + 3).min(values.len())];
    (0..values.len()).map(|i| around(i).iter().sum::<f64>() / around(i).len() as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moving_average_of_a_spike_is_a_plateau() {
        assert_eq!(moving_average(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0]), [0.0, 1.25, 1.0, 1.0, 1.0, 1.25, 0.0]);
    }
}
