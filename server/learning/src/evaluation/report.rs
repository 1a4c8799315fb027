//! An evaluation for people and programs: JSON as in docs/scripting.md, Markdown, CSV, and the paper's figure as SVG.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path as FilePath;
use std::{fs, io};

use serde::{Deserialize, Serialize};

use super::delay::MOST_DELAY;
use super::rollout::Path;
use super::{Comparison, ORACLE, Outcome, Reliance, Row};
use crate::scans::detail::warning;
use crate::scans::recorded::Interpolation;
use parfocal_base::files::replace;
use parfocal_base::plot::{Axis, Plot};
use parfocal_base::statistics::Method;
use parfocal_base::{IN_FOCUS, PolicyName};

/// What was evaluated.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct EvaluatedScans {
    /// Kind of scans: `simulated`, `relief`, `phantom`, or the folder of a recorded scan.
    pub scans: String,
    /// Seed of the scans' courses.
    pub seed: u64,
    /// Number of scans.
    pub count: usize,
    /// Footage scanned, if any.
    pub footage: Vec<String>,
    /// What a recorded scan shows between two of its focal powers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between: Option<Interpolation>,
    /// The optic's blur rate that the policies were told, if any: pixels per unit of focal power.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blur: Option<f64>,
    /// Folder of weights that replace those that ship, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights_folder: Option<String>,
    /// SHA-256 of the weights of each learned policy that was evaluated.
    pub weights: BTreeMap<PolicyName, String>,
}

impl EvaluatedScans {
    /// Names the first difference from `other`; `None` if there is none.
    pub fn difference(&self, other: &Self) -> Option<&'static str> {
        let differences = [
            (self.scans != other.scans, "the scans"),
            (self.seed != other.seed, "the seed"),
            (self.count != other.count, "the number of scans"),
            (self.footage != other.footage, "the footage"),
            (self.between != other.between, "what is shown between two focal powers"),
            (self.blur != other.blur, "the optic's blur rate"),
            (self.weights != other.weights, "the weights"),
            (self != other, "the folder of the weights"),
        ];
        differences.into_iter().find_map(|(differs, what)| differs.then_some(what))
    }
}

/// The result of `evaluate`. docs/scripting.md promises the names of its fields.
#[derive(Debug, Clone, Serialize)]
pub struct EvaluationReport {
    /// What was evaluated.
    #[serde(flatten)]
    pub subject: EvaluatedScans,
    /// Number of scans in which even the sharpest patch shows nothing to focus on.
    pub without_detail: usize,
    /// One row for each policy.
    pub rows: Vec<Row>,
    /// One test for each pair of policies.
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

/// The paper's figures on a scan recorded by a robotic arm.
const ROBOTIC: [PaperRow; 6] = [
    ("fixed", 0.262, 0.161, 26.4),
    ("mgm-hill-climber", 0.146, 0.148, 46.4),
    ("mlr-hill-climber", 0.163, 0.168, 44.1),
    ("mgm-learned", 0.126, 0.118, 50.8),
    ("mlr-learned", 0.156, 0.131, 39.5),
    ("cnn-learned", 0.070, 0.099, 79.1),
];

impl EvaluationReport {
    /// The table as Markdown, beside the paper's figures on scans of the same kind; then the tests,
    /// and what was evaluated.
    pub fn markdown(&self) -> String {
        let mut text = String::from(
            "| policy | MAE ± sd | 95 % CI | in focus | sharpness kept | delay | travel / frame | reversals / s \
             | paper: MAE ± sd | in focus |\n\
             |---|---|---|---|---|---|---|---|---|---|\n",
        );

        // The paper has no scans with relief.
        let paper = match (self.subject.scans.as_str(), self.subject.between) {
            ("simulated", _) => SIMULATED.as_slice(),
            (_, Some(_)) => ROBOTIC.as_slice(),
            (_, None) => &[],
        };
        for row in &self.rows {
            let paper = paper.iter().find(|paper| paper.0 == row.policy);
            let paper = match paper {
                Some((_, mae, sd, share)) => format!("{mae:.3} ± {sd:.3} | {share:.1} %"),
                None => "– | –".to_owned(),
            };
            let _ = writeln!(
                text,
                "| {} | {:.3} ± {:.3} | {:.3}–{:.3} | {:.1} % | {:.3} | {} | {:.4} | {:.2} | {paper} |",
                row.policy,
                row.mae,
                row.sd,
                row.mae_interval.0,
                row.mae_interval.1,
                100.0 * row.in_focus,
                row.sharpness_kept,
                frames_late(row.delay),
                row.travel,
                row.reversals,
            );
        }

        text.push_str(&reliances(&self.rows));
        text.push_str(&self.tests());
        let _ = writeln!(text, "\n{}", self.about());
        text
    }

    /// The p of each test between two policies, as Markdown; empty if there is only one policy.
    fn tests(&self) -> String {
        let names: Vec<&str> =
            self.rows.iter().map(|row| row.policy.as_str()).filter(|policy| *policy != ORACLE).collect();
        let Some(columns) = names.get(1..).filter(|columns| !columns.is_empty()) else { return String::new() };
        let over = if self.subject.between.is_some() { "stretches of the scans" } else { "scans" };
        let exact = self.comparisons.iter().filter(|test| test.method == Method::Exact).count();
        let method = match exact {
            0 => "by its normal approximation",
            _ if exact == self.comparisons.len() => "exact",
            _ => "exact for at most 50 pairs that differ, else by its normal approximation",
        };
        let corrected = match self.comparisons.len() {
            1 => String::new(),
            count => format!("; after the slash, corrected by Holm's method for {count} comparisons"),
        };

        let mut text = format!("\np of the paired Wilcoxon signed-rank test over {over}, {method}{corrected}:\n\n");
        let _ = writeln!(text, "| | {} |\n|{}", columns.join(" | "), "---|".repeat(names.len()));
        for a in &names[..columns.len()] {
            let cell = |b: &&str| {
                let of = |test: &&Comparison| test.a == *a && test.b == **b;
                self.comparisons.iter().find(of).map_or_else(String::new, |test| self.probabilities(test))
            };
            let cells: Vec<String> = columns.iter().map(cell).collect();
            let _ = writeln!(text, "| {a} | {} |", cells.join(" | "));
        }
        text
    }

    /// A test's p, and the corrected one if there are several tests.
    fn probabilities(&self, test: &Comparison) -> String {
        let p = probability(test.p);
        if self.comparisons.len() == 1 { p } else { format!("{p} / {}", probability(test.p_holm)) }
    }

    /// What was evaluated, in sentences.
    fn about(&self) -> String {
        let mut text = format!("Scans: {}", self.subject.scans);
        if !self.subject.footage.is_empty() {
            let _ = write!(text, " over {}", self.subject.footage.join(", "));
        }
        let _ = write!(text, ", {} of them, seed {}.", self.subject.count, self.subject.seed);
        if let Ok(Some(warning)) = warning(self.without_detail, self.subject.count) {
            let _ = write!(text, " Note that {warning}.");
        }

        text.push_str(match self.subject.between {
            None => "",
            Some(Interpolation::Nearest) => " A frame shows the picture recorded at the nearest focal power.",
            Some(Interpolation::Interpolated) => {
                " A frame shows a mix of the pictures recorded at the two nearest focal powers."
            }
        });

        if let Some(blur) = self.subject.blur {
            let _ = write!(text, " The policies were told that the optic blurs by {blur} px per unit of focal power.");
        }
        if !self.subject.weights.is_empty() {
            let weights: Vec<_> = self.subject.weights.iter().map(|(name, sum)| format!("{name} {sum:.12}")).collect();
            let _ = write!(text, " Weights, by how their SHA-256 begins: {}", weights.join(", "));
            match &self.subject.weights_folder {
                None => text.push('.'),
                Some(folder) => {
                    let _ = write!(text, "; those in {folder} replaced the shipped ones.");
                }
            }
        }

        text
    }

    /// The rows as CSV, each with what was evaluated.
    ///
    /// # Errors
    /// None in practice: it is made in memory.
    pub fn csv(&self) -> io::Result<String> {
        let mut table = csv::Writer::from_writer(Vec::new());
        table.write_record(COLUMNS)?;
        for row in &self.rows {
            let weights = self.subject.weights.get(&PolicyName::new(&row.policy));

            let numbers = [row.mae, row.sd, row.in_focus, row.travel, row.reversals];
            let intervals = [row.mae_interval, row.in_focus_interval].map(|(low, high)| [low, high]);
            let numbers = numbers.iter().chain(intervals.as_flattened()).map(f64::to_string);

            let mut record = vec![row.policy.clone(), row.frames.to_string()];
            record.extend(numbers);
            record.extend([self.subject.scans.clone(), self.subject.seed.to_string(), self.subject.footage.join("; ")]);
            record.push(weights.cloned().unwrap_or_default());

            let belief = row.belief.map(|belief| (Some(belief.sure), belief.right)).unwrap_or_default();
            let numbers = [Some(row.sharpness_kept), row.delay, belief.0, belief.1, self.subject.blur];
            record.extend(numbers.map(|number| number.map_or_else(String::new, |number| number.to_string())));
            table.write_record(record)?;
        }

        let bytes = table.into_inner().map_err(|error| io::Error::other(error.to_string()))?;
        String::from_utf8(bytes).map_err(io::Error::other)
    }

    /// Writes `results.json`, `results.md`, `results.csv` and `figure.svg` (the first scan's paths) into `folder`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, outcomes: &[Outcome], folder: &FilePath) -> io::Result<()> {
        fs::create_dir_all(folder)?;
        let write = |name: &str, text: String| replace(&folder.join(name), text.as_bytes());
        write("results.json", serde_json::to_string_pretty(self)?)?;
        write("results.md", self.markdown())?;
        write("results.csv", self.csv()?)?;
        write("figure.svg", figure(outcomes, 0))
    }
}

/// Columns of the table as CSV. New ones are added at the end.
const COLUMNS: [&str; 20] = [
    "policy",
    "frames",
    "mae",
    "sd",
    "in_focus",
    "travel",
    "reversals",
    "mae_low",
    "mae_high",
    "in_focus_low",
    "in_focus_high",
    "scans",
    "seed",
    "footage",
    "weights",
    "sharpness_kept",
    "delay",
    "sure",
    "sure_and_right",
    "blur",
];

/// A delay for people: frames, or what it is more than.
pub(super) fn frames_late(delay: Option<f64>) -> String {
    delay.map_or_else(|| format!("> {MOST_DELAY}"), |frames| format!("{frames:.1}"))
}

/// What each policy with a belief knows of how sure it may be, as a sentence; empty if there is none.
fn reliances(rows: &[Row]) -> String {
    let sentence = |row: &Row| {
        let Reliance { sure, right } = row.belief?;
        Some(match right {
            Some(right) => {
                let (sure, right) = (100.0 * sure, 100.0 * right);
                format!("{} in {sure:.1} % of the frames, right in {right:.1} % of them", row.policy)
            }
            None => format!("{} never", row.policy),
        })
    };
    let all: Vec<String> = rows.iter().filter_map(sentence).collect();
    if all.is_empty() { all.concat() } else { format!("\nSure of being in focus (85 %): {}.\n", all.join("; ")) }
}

/// A p for people: `0.030`, or `4e-11` if it is below a thousandth.
fn probability(p: f64) -> String {
    if p < 1e-3 { format!("{p:.0e}") } else { format!("{p:.3}") }
}

const COLOURS: [&str; 9] =
    ["#999999", "#0072b2", "#56b4e9", "#009e73", "#8c564b", "#e69f00", "#d55e00", "#cc79a7", "#6a3d9a"];

/// Focal path (above) and error (below; moving average of 5 frames) of each policy on scan `index`,
/// the optimum in black.
pub fn figure(outcomes: &[Outcome], index: usize) -> String {
    let policies: Vec<(&str, &Path)> = outcomes
        .iter()
        .filter(|outcome| outcome.policy != ORACLE)
        .filter_map(|outcome| Some((outcome.policy.as_str(), outcome.paths.get(index)?)))
        .collect();

    let frames = policies.first().map_or(0, |(_, path)| path.optimum.len());
    let across = Axis { label: "frame", from: 1.0, to: frames.max(1) as f64 };
    let coloured = || COLOURS.iter().cycle().zip(&policies);
    let mut plot = Plot::default();

    let mut panel = plot.panel(across, Axis { label: "focal power", from: 0.0, to: 1.0 });
    for (colour, (name, path)) in coloured() {
        panel.values(name, colour, &path.focal_power);
    }
    if let Some((_, path)) = policies.first() {
        panel.values("optimum", "black", &path.optimum);
    }

    let mut panel = plot.panel(across, Axis { label: "focal error", from: 0.0, to: 0.5 });
    for (colour, (name, path)) in coloured() {
        panel.values(name, colour, &moving_average(&path.errors().collect::<Vec<_>>()));
    }
    panel.values("limit of in focus", "#bbbbbb", &vec![IN_FOCUS; frames]);
    plot.svg()
}

/// Mean of up to five values around each.
fn moving_average(values: &[f64]) -> Vec<f64> {
    let around = |i: usize| &values[i.saturating_sub(2)..(i + 3).min(values.len())];
    (0..values.len()).map(|i| around(i).iter().sum::<f64>() / around(i).len() as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(errors: [f64; 4]) -> Vec<Path> {
        errors.map(|error| Path { focal_power: vec![0.5], optimum: vec![0.5 + error], ..Path::default() }).to_vec()
    }

    fn report() -> EvaluationReport {
        let outcome = |(name, paths): (&str, Vec<Path>)| Outcome { policy: name.to_owned(), paths, parts: 1 };
        let outcomes = [
            (ORACLE, path([0.0; 4])),
            ("near", path([0.01, 0.02, 0.03, 0.04])),
            ("file:far,b.pt", path([0.11, 0.12, 0.13, 0.14])),
        ];
        let rows: Vec<Row> = outcomes.map(outcome).iter().map(Outcome::row).collect();
        let subject = EvaluatedScans {
            scans: "simulated".to_owned(),
            seed: 7,
            count: 4,
            footage: vec!["endo.mp4".to_owned()],
            between: None,
            blur: Some(6.5),
            weights_folder: Some("runs/x".to_owned()),
            weights: [(PolicyName::new("near"), "0123456789abcdef".repeat(4))].into(),
        };
        EvaluationReport { subject, without_detail: 1, comparisons: crate::evaluation::compare(&rows), rows }
    }

    #[test]
    fn what_was_evaluated_and_the_tests_stand_below_the_table() {
        let text = report().markdown();
        // All four pairs differ alike: two of the sixteen patterns of signs are as extreme.
        assert!(text.contains("| | file:far,b.pt |\n|---|---|\n| near | 0.125 |\n"), "{text}");
        assert!(text.contains("signed-rank test over scans, exact:\n"), "{text}");
        assert!(
            text.contains(
                "Scans: simulated over endo.mp4, 4 of them, seed 7. Note that in 25.0 % of the scans (1 of 4) even"
            ),
            "{text}"
        );
        let blur = "The policies were told that the optic blurs by 6.5 px per unit of focal power.";
        assert!(text.contains(&format!("shows no detail. {blur} Weights, by ")), "{text}");
        assert!(text.contains("near 0123456789ab; those in runs/x replaced"), "{text}");
    }

    #[test]
    fn several_comparisons_are_corrected_for_their_number() {
        let outcome = |name: &str, errors| Outcome { policy: name.to_owned(), paths: path(errors), parts: 1 };
        let outcomes = [
            outcome("a", [0.01, 0.02, 0.03, 0.04]),
            outcome("b", [0.11, 0.13, 0.15, 0.17]),
            outcome("c", [0.10, 0.14, 0.14, 0.18]),
        ];
        let rows: Vec<Row> = outcomes.iter().map(Outcome::row).collect();
        let report = EvaluationReport { comparisons: crate::evaluation::compare(&rows), rows, ..report() };
        let text = report.markdown();
        assert!(text.contains("exact; after the slash, corrected by Holm's method for 3 comparisons:\n"), "{text}");
        assert!(text.contains("| a | 0.125 / 0.375 | 0.125 / 0.375 |\n"), "{text}");
        let json = serde_json::to_value(&report).unwrap();
        let first = &json["comparisons"][0];
        assert_eq!((&first["test"], &first["method"]), (&"wilcoxon-signed-rank".into(), &"exact".into()));
        assert_eq!((&first["p"], &first["p_holm"]), (&0.125.into(), &0.375.into()));
    }

    #[test]
    fn the_table_as_csv_has_intervals_footage_and_weights() {
        let text = report().csv().unwrap();
        let mut table = csv::Reader::from_reader(text.as_bytes());
        let records: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
        let cell = |row: usize, column: &str| &records[row][COLUMNS.iter().position(|name| *name == column).unwrap()];
        assert_eq!((cell(2, "policy"), cell(2, "footage"), cell(2, "weights")), ("file:far,b.pt", "endo.mp4", ""));
        assert_eq!((cell(1, "weights"), cell(1, "blur")), ("0123456789abcdef".repeat(4).as_str(), "6.5"));
        let [low, mae, high] = ["mae_low", "mae", "mae_high"].map(|column| cell(1, column).parse::<f64>().unwrap());
        assert!(0.01 <= low && low < mae && mae < high && high <= 0.04, "{text}");
    }

    #[test]
    fn the_moving_average_of_a_spike_is_a_plateau() {
        assert_eq!(moving_average(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0]), [0.0, 1.25, 1.0, 1.0, 1.0, 1.25, 0.0]);
    }
}
