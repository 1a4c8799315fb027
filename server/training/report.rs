//! An evaluation for people and programs: JSON as in the contract, Markdown, CSV, and the paper's figure as SVG.

use std::fmt::Write as _;
use std::path::Path as FilePath;
use std::{fs, io};

use serde::Serialize;

use super::evaluate::{Comparison, ORACLE, Outcome, Row};
use super::plot::{PANEL, begin, legend, line, panel};
use super::recorded::Between;
use super::rollout::Path;
use crate::autofocus::IN_FOCUS;

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
    /// What a recorded scan shows between two of its focal powers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between: Option<Between>,
    /// One a policy.
    pub rows: Vec<Row>,
    /// One a pair of policies.
    pub comparisons: Vec<Comparison>,
}

/// One of the paper's results: policy, mean absolute error, its deviation, share in focus (percent).
type PaperRow = (&'static str, f64, f64, f64);

/// The paper's figures on its simulated scans.
const SIMULATED: [PaperRow; 6] = [
    ("fixed", 0.236, 0.152, 19.0),
    ("mgm-hill-climber", 0.102, 0.138, 67.9),
    ("mlr-hill-climber", 0.092, 0.118, 68.2),
    ("mgm-learned", 0.085, 0.115, 70.4),
    ("mlr-learned", 0.098, 0.120, 66.4),
    ("cnn-learned", 0.049, 0.072, 84.9),
];

/// Its figures on a scan recorded by a robotic arm.
const ROBOTIC: [PaperRow; 6] = [
    ("fixed", 0.262, 0.161, 26.4),
    ("mgm-hill-climber", 0.146, 0.148, 46.4),
    ("mlr-hill-climber", 0.163, 0.168, 44.1),
    ("mgm-learned", 0.126, 0.118, 50.8),
    ("mlr-learned", 0.156, 0.131, 39.5),
    ("cnn-learned", 0.070, 0.099, 79.1),
];

impl Report {
    /// The table as Markdown, beside the paper's figures on scans of the same kind.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = String::from(
            "| policy | MAE ± sd | 95 % CI | in focus | travel / frame | reversals / s | paper: MAE ± sd | in focus |\n\
             |---|---|---|---|---|---|---|---|\n",
        );
        let paper = if self.between.is_some() { ROBOTIC } else { SIMULATED };
        for row in &self.rows {
            let paper = paper
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
        let _ = write!(text, "\nScans: {}, {} of them, seed {}.", self.scans, self.count, self.seed);
        text.push_str(match self.between {
            None => "\n",
            Some(Between::Nearest) => " A frame shows the picture recorded at the nearest focal power.\n",
            Some(Between::Interpolated) => {
                " A frame shows a mix of the pictures recorded at the two focal powers around.\n"
            }
        });
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
    let mut svg = begin(height);
    panel(&mut svg, 20.0, "focal power", 1.0, "frame");
    panel(&mut svg, PANEL + 50.0, "focal error", 0.5, "frame");
    for (colour, (name, path)) in COLOURS.iter().cycle().zip(&policies) {
        line(&mut svg, &path.focal_power, 20.0, 1.0, colour, name);
        line(&mut svg, &moving_average(&path.errors().collect::<Vec<_>>()), PANEL + 50.0, 0.5, colour, name);
    }
    if let Some((_, path)) = policies.first() {
        line(&mut svg, &path.optimum, 20.0, 1.0, "black", "optimum");
        line(&mut svg, &vec![IN_FOCUS; path.optimum.len()], PANEL + 50.0, 0.5, "#bbbbbb", "in focus");
    }
    let names = policies.iter().map(|policy| policy.0);
    legend(&mut svg, height - 12.0, names.zip(COLOURS.into_iter().cycle()).chain([("optimum", "black")]));
    svg.push_str("</svg>\n");
    svg
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
