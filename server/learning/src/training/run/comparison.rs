//! Compares trainings by the content of their run folders, for sweeps of recipes and seeds.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::checkpoint::{CHECKPOINT, Checkpoint};
use super::curves;
use super::folder::LOCK;
use crate::LearningError;
use crate::evaluation::Row;
use crate::training::recipe::Recipe;

/// File in a run folder with its recipe, which is there before anything is trained, once all pictures are drawn.
pub const RECIPE: &str = "recipe.toml";
/// File in a run folder with the figures of its weights on the reference benchmark.
pub const BENCHMARK: &str = "benchmark.json";
/// The recipe's key that always has a column.
const POLICY: &str = "policy";

/// The figures of a training's weights on the reference benchmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkFigures {
    /// Number of scans.
    pub scans: usize,
    /// Mean absolute focal power error.
    pub mae: f64,
    /// Standard deviation of the absolute focal power error over frames.
    pub sd: f64,
    /// Share of frames in focus, 0..1.
    pub in_focus: f64,
    /// Mean absolute change of focal power per frame.
    pub travel: f64,
    /// Changes of direction per second.
    pub reversals: f64,
}

impl BenchmarkFigures {
    /// The figures of `row`, measured on `scans` scans.
    pub fn new(row: &Row, scans: usize) -> Self {
        let Row { mae, sd, in_focus, travel, reversals, .. } = *row;
        Self { scans, mae, sd, in_focus, travel, reversals }
    }
}

/// A training, as read from its run folder.
#[derive(Debug, Clone, Serialize)]
pub struct TrainedRun {
    /// The run folder.
    pub run: PathBuf,
    /// The recipe's values by `section.key`.
    pub recipe: BTreeMap<String, toml::Value>,
    /// Seed of everything random.
    pub seed: u64,
    /// Updates done so far.
    pub updates: u64,
    /// Updates of the whole training.
    pub of: u64,
    /// Lowest mean absolute error of any validation; `None` before the first.
    pub best_validation: Option<f64>,
    /// Figures of the best weights on the reference benchmark, once the training is complete.
    pub benchmark: Option<BenchmarkFigures>,
}

impl TrainedRun {
    /// Reads the training in `folder`, which may still be running; `None` if it has saved nothing yet.
    ///
    /// # Errors
    /// If it holds no training, or the training cannot be read.
    pub fn read(folder: &Path) -> Result<Option<Self>, LearningError> {
        let file = folder.join(CHECKPOINT);
        if !file.is_file() {
            if [LOCK, RECIPE].iter().any(|name| folder.join(name).is_file()) {
                return Ok(None);
            }
            bail!("{} holds no saved training; give run folders of `parfocal train`", folder.display());
        }

        let checkpoint = Checkpoint::read_notes(&file)?;

        let note = |name: &str| checkpoint.notes.get(name).map_or("", String::as_str);
        let recipe =
            Recipe::parse(note("recipe")).map_err(|error| checkpoint.damaged(format!("its recipe: {error}")))?;

        let best: f64 = checkpoint.number("best")?;
        let curve = curves::parse(note("curve"));

        Ok(Some(Self {
            run: folder.to_owned(),
            seed: checkpoint.number("seed")?,
            updates: curve.last().map_or(0, |point| point.0),
            of: recipe.updates(),
            best_validation: best.is_finite().then_some(best),
            benchmark: benchmark(&folder.join(BENCHMARK))?,
            recipe: flat(&recipe),
        }))
    }
}

fn benchmark(path: &Path) -> Result<Option<BenchmarkFigures>, LearningError> {
    let unreadable = |reason: String| {
        let path = path.display();
        LearningError::new(format!(
            "cannot read {path}: {reason}; delete it, then `parfocal train --resume` makes it again"
        ))
    };
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|error| unreadable(error.to_string())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(unreadable(error.to_string())),
    }
}

/// The recipe's values by `section.key`.
fn flat(recipe: &Recipe) -> BTreeMap<String, toml::Value> {
    fn gather(prefix: &str, table: toml::Table, into: &mut BTreeMap<String, toml::Value>) {
        for (key, value) in table {
            let name = format!("{prefix}{key}");
            match value {
                toml::Value::Table(table) => gather(&format!("{name}."), table, into),
                value => drop(into.insert(name, value)),
            }
        }
    }

    let mut values = BTreeMap::new();
    gather("", toml::Table::try_from(recipe).unwrap_or_default(), &mut values);
    values
}

/// `runs` as a Markdown table, with a column for each value in which their recipes differ. The run with the best
/// validation comes first; runs without a validation come last.
pub fn markdown(runs: &[TrainedRun]) -> String {
    let mut runs: Vec<&TrainedRun> = runs.iter().collect();
    let error = |run: &TrainedRun| run.best_validation.unwrap_or(f64::INFINITY);
    runs.sort_by(|a, b| error(a).total_cmp(&error(b)));

    let keys: BTreeSet<&String> = runs.iter().flat_map(|run| run.recipe.keys()).collect();
    let differs = |key: &&&String| runs.iter().any(|run| run.recipe.get(**key) != runs[0].recipe.get(**key));
    let differing: Vec<&String> = keys.iter().filter(differs).filter(|key| **key != POLICY).copied().collect();

    let mut heads = vec!["run", POLICY];
    heads.extend(differing.iter().map(|key| key.as_str()));
    heads.extend(["seed", "updates", "best validation", "benchmark: MAE ± sd", "in focus"]);

    let mut text = format!("| {} |\n|{}\n", heads.join(" | "), "---|".repeat(heads.len()));

    for run in runs {
        let value = |key: &str| run.recipe.get(key).map_or_else(|| "–".to_owned(), plain);
        let mut cells = vec![run.run.display().to_string(), value(POLICY)];
        cells.extend(differing.iter().map(|key| value(key)));
        cells.push(run.seed.to_string());
        cells.push(if run.updates < run.of { format!("{} of {}", run.updates, run.of) } else { run.of.to_string() });
        cells.push(run.best_validation.map_or_else(|| "–".to_owned(), |mae| format!("{mae:.4}")));

        let benchmark = run.benchmark.as_ref();
        cells.push(benchmark.map_or_else(|| "–".to_owned(), |b| format!("{:.4} ± {:.4}", b.mae, b.sd)));
        cells.push(benchmark.map_or_else(|| "–".to_owned(), |b| format!("{:.1} %", 100.0 * b.in_focus)));

        let _ = writeln!(text, "| {} |", cells.join(" | "));
    }

    text
}

/// A recipe's value in TOML's notation; text without its quotes.
fn plain(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::recipe::shipped;

    #[test]
    fn runs_are_sorted_and_only_what_differs_has_a_column() {
        let run = |name: &str, updates: u64, seed: u64, best_validation: Option<f64>| {
            let recipe = Recipe::parse(shipped("mgm-learned").unwrap()).unwrap().with_updates(updates);
            TrainedRun {
                run: name.into(),
                recipe: flat(&recipe),
                seed,
                updates: updates.min(100),
                of: updates,
                best_validation,
                benchmark: (updates == 100).then_some(BenchmarkFigures {
                    scans: 2,
                    mae: 0.08,
                    sd: 0.07,
                    in_focus: 0.75,
                    travel: 0.0,
                    reversals: 0.0,
                }),
            }
        };

        let text = markdown(&[run("a", 300, 1, None), run("b", 300, 2, Some(0.2)), run("c", 100, 3, Some(0.1))]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "| run | policy | dqn.updates | seed | updates | best validation | benchmark: MAE ± sd | in focus |"
        );
        assert_eq!(lines[2], "| c | mgm-learned | 100 | 3 | 100 | 0.1000 | 0.0800 ± 0.0700 | 75.0 % |");
        assert_eq!(lines[3], "| b | mgm-learned | 300 | 2 | 100 of 300 | 0.2000 | – | – |");
        assert_eq!(lines[4], "| a | mgm-learned | 300 | 1 | 100 of 300 | – | – | – |");
    }
}
