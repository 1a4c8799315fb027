//! The benchmark of real glass: photographed focal stacks, each at two scales and three seeds, and
//! how each policy does there compared with the MGM hill-climber.

use std::fmt::Write as _;
use std::path::{Component, Path};
use std::str::FromStr;
use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;

use super::delay::delay_of;
use super::report::{figure, frames_late};
use super::{ORACLE, Outcome, Reliance, Row, evaluate};
use crate::LearningError;
use crate::scans::stack::drift::{StackCourse, StackScans};
use crate::scans::stack::source::{ScaledStack, StackSource};
use parfocal_autofocus::Registry;
use parfocal_base::files::replace;
use parfocal_base::notices::tell;
use parfocal_base::statistics::bootstrap_statistic;
use parfocal_base::{BlurRate, PolicyName};

/// The policy that all others are compared with.
pub const BASELINE: &str = "mgm-hill-climber";
/// The strongest policy without training, with which all others are compared too.
pub const STRONG_BASELINE: &str = "mgm-bisection";
/// Seeds of the courses, one scan each.
pub const SEEDS: usize = 3;
/// First of the seeds by default.
pub const FIRST_SEED: u64 = 31;

/// A stack at one scale, ready to be scanned.
#[derive(Debug)]
struct Item {
    stack: String,
    scale: &'static str,
    planes: usize,
    scans: StackScans,
    /// The optic's blur rate that the policies get, if any.
    blur: Option<BlurRate>,
}

/// The blur rate of the optic that the policies are told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Blur {
    /// The same rate for all scans.
    Rate(BlurRate),
    /// The rate measured on each focal stack.
    Measured,
}

impl FromStr for Blur {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "measured" { Ok(Self::Measured) } else { text.parse().map(Self::Rate) }
    }
}

/// A name for each of `sources`: its folder's. Where others have the same, as `pose0001` of several scans, the folders
/// around it are named too, as far as it takes to tell them apart.
fn names(sources: &[StackSource]) -> Vec<String> {
    let folders: Vec<Vec<String>> = sources.iter().map(folders).collect();
    let tail = |folders: &[String], length: usize| folders[folders.len().saturating_sub(length)..].join("-");

    let name = |own: &Vec<String>| {
        let is_clear = |length: &usize| {
            let alike = |other: &&Vec<String>| tail(other, *length) == tail(own, *length);
            folders.iter().filter(alike).all(|other| other == own)
        };
        tail(own, (1..own.len()).find(is_clear).unwrap_or(own.len()))
    };
    folders.iter().map(name).collect()
}

/// The folders that lead to a stack, and its own.
fn folders(source: &StackSource) -> Vec<String> {
    let named = |part: Component<'_>| match part {
        Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
        _ => None,
    };
    let path = std::path::absolute(&source.folder).unwrap_or_else(|_| source.folder.clone());
    path.components().filter_map(named).collect()
}

/// Makes [`SEEDS`] courses over `source`, which is called `name`, at each scale.
fn items(name: &str, source: &StackSource, first_seed: u64, blur: Option<Blur>) -> Result<Vec<Item>, LearningError> {
    let item = |scaled: ScaledStack| {
        let course = |seed| StackCourse::new(Arc::clone(&scaled.pictures), scaled.planes, seed).map(Arc::new);
        let courses: Option<Vec<_>> = (0..SEEDS).map(|index| course(first_seed.wrapping_add(index as u64))).collect();
        let scans = StackScans(courses.ok_or_else(|| source.too_small(scaled.planes))?);
        let blur = match blur {
            None => None,
            Some(Blur::Rate(rate)) => Some(rate),
            Some(Blur::Measured) => scaled.blur_rate(),
        };
        Ok(Item { stack: name.to_owned(), scale: scaled.scale, planes: scaled.planes, scans, blur })
    };

    let (scaled, doubts) = source.at_scales()?;
    for doubt in doubts {
        tell(format_args!("note: {doubt}"));
    }
    scaled.into_iter().map(item).collect()
}

/// How the policies did on one stack at one scale.
#[derive(Debug, Clone, Serialize)]
pub struct StackResult {
    /// The stack's name: its folder's, and with that of folders around it where other stacks have the same.
    pub stack: String,
    /// `s` or `l`: about 500 or 1000 pixels wide.
    pub scale: &'static str,
    /// Number of planes in the range.
    pub planes: usize,
    /// The optic's blur rate that the policies got, if any: pixels per unit of focal power.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blur: Option<f64>,
    /// One row for each policy, the oracle first.
    pub rows: Vec<Row>,
}

/// A policy compared with the MGM hill-climber, over all stacks and scales.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OverallRow {
    /// The policy.
    pub policy: String,
    /// Geometric mean of its mean absolute error divided by the hill-climber's.
    pub ratio: f64,
    /// 95 % bootstrap interval of that over stacks.
    pub ratio_interval: (f64, f64),
    /// Number of stacks and scales on which its error is greater than the hill-climber's.
    pub worse_on: usize,
    /// Mean share in focus.
    pub in_focus: f64,
    /// Its changes of direction a second divided by the hill-climber's.
    pub turns: f64,
    /// The stack and scale where it does worst compared with the hill-climber.
    pub worst: String,
    /// Geometric mean of its mean absolute error divided by that of `mgm-bisection`.
    pub beside_bisection: f64,
    /// Mean of the rows' sharpness kept.
    pub sharpness_kept: f64,
    /// How many frames late somebody would have the same `ratio` who knows every optimum exactly; see [`Row::delay`].
    pub delay: Option<f64>,
    /// How far its belief can be relied on, over all frames; `None` if it has none.
    pub belief: Option<Reliance>,
}

/// The benchmark's figures.
#[derive(Debug, Clone, Serialize)]
pub struct StackReport {
    /// First of the seeds.
    pub seed: u64,
    /// One result for each stack and scale.
    pub stacks: Vec<StackResult>,
    /// One standing for each policy.
    pub standings: Vec<OverallRow>,
}

/// `policies`, and before them the baselines that are not among them: every evaluation on stacks runs these, too.
pub fn with_baselines(policies: &[PolicyName]) -> Vec<PolicyName> {
    let mut all = policies.to_vec();
    for baseline in [STRONG_BASELINE, BASELINE].map(PolicyName::new) {
        if !all.contains(&baseline) {
            all.insert(0, baseline);
        }
    }
    all
}

/// Evaluates `policies`, the oracle and the baselines on the stacks of `sources`. `seed` is the first of the courses'
/// seeds.
///
/// # Errors
/// If a stack cannot be read or scanned, or a policy cannot run.
pub fn evaluate_stacks(
    registry: &Registry,
    policies: &[PolicyName],
    sources: &[StackSource],
    seed: u64,
    blur: Option<Blur>,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<(StackReport, Vec<Vec<Outcome>>), LearningError> {
    let policies = with_baselines(policies);
    let named: Vec<(String, &StackSource)> = names(sources).into_iter().zip(sources).collect();
    let read = |(name, source): &(String, &StackSource)| items(name, source, seed, blur);
    let items: Vec<Vec<Item>> = named.par_iter().map(read).collect::<Result<_, _>>()?;
    let mut stacks = Vec::new();
    let mut all = Vec::new();

    for item in items.into_iter().flatten() {
        let registry = if item.blur.is_some() { registry.clone().knowing(item.blur) } else { registry.clone() };
        let outcomes = evaluate(&registry, &policies, &item.scans, progress)?;

        let rows = outcomes.iter().map(Outcome::row).collect();
        let blur = item.blur.map(BlurRate::get);
        stacks.push(StackResult { stack: item.stack, scale: item.scale, planes: item.planes, blur, rows });
        all.push(outcomes);
    }

    let standings = policies.iter().filter_map(|policy| standing(policy.as_str(), &stacks, &all)).collect();
    Ok((StackReport { seed, stacks, standings }, all))
}

/// The standing of `policy` over `stacks`, with each stack's `outcomes`; `None` if a row is missing.
fn standing(policy: &str, stacks: &[StackResult], outcomes: &[Vec<Outcome>]) -> Option<OverallRow> {
    let rows = |name: &str| -> Option<Vec<&Row>> {
        stacks.iter().map(|result| result.rows.iter().find(|row| row.policy == name)).collect()
    };
    let own = rows(policy)?;
    let strong = rows(STRONG_BASELINE)?;
    let pairs: Vec<(&Row, &Row)> = own.iter().copied().zip(rows(BASELINE)?).collect();

    let logs: Vec<f64> = pairs.iter().map(|(own, base)| (own.mae / base.mae).ln()).collect();
    let count = logs.len().max(1) as f64;
    let ratio = (logs.iter().sum::<f64>() / count).exp();

    let beside_strong: f64 = own.iter().zip(&strong).map(|(own, strong)| (own.mae / strong.mae).ln()).sum();
    let late_ratio = |late: usize| {
        let errors = outcomes.iter().filter_map(|outcomes| outcomes.first()).map(|outcome| outcome.late_error(late));
        let logs = errors.zip(&pairs).map(|(error, (_, base))| (error / base.mae).ln());
        (logs.sum::<f64>() / count).exp()
    };
    let paths = outcomes.iter().flatten().filter(|outcome| outcome.policy == policy);

    let worst = (0..logs.len()).max_by(|&a, &b| logs[a].total_cmp(&logs[b]))?;
    let turns = |which: fn(&(&Row, &Row)) -> f64| pairs.iter().map(which).sum::<f64>();

    Some(OverallRow {
        policy: policy.to_owned(),
        ratio,
        ratio_interval: ratio_interval(stacks, &logs),
        worse_on: logs.iter().filter(|log| **log > 0.0).count(),
        in_focus: pairs.iter().map(|(own, _)| own.in_focus).sum::<f64>() / count,
        turns: turns(|pair| pair.0.reversals) / turns(|pair| pair.1.reversals).max(1e-9),
        worst: format!("{}-{}", stacks[worst].stack, stacks[worst].scale),
        beside_bisection: (beside_strong / count).exp(),
        sharpness_kept: own.iter().map(|row| row.sharpness_kept).sum::<f64>() / count,
        delay: delay_of(ratio, late_ratio),
        belief: Reliance::of(paths.flat_map(|outcome| &outcome.paths)),
    })
}

/// The 95 % percentile-bootstrap interval of the geometric mean, drawing whole stacks: the two scales
/// of a stack are not independent.
fn ratio_interval(stacks: &[StackResult], logs: &[f64]) -> (f64, f64) {
    let mut groups: Vec<(&str, Vec<f64>)> = Vec::new();
    for (result, log) in stacks.iter().zip(logs) {
        match groups.iter_mut().find(|group| group.0 == result.stack) {
            Some(group) => group.1.push(*log),
            None => groups.push((&result.stack, vec![*log])),
        }
    }

    let geometric_mean = |drawn: &[usize]| {
        let logs: Vec<f64> = drawn.iter().flat_map(|&group| groups[group].1.iter().copied()).collect();
        Some((logs.iter().sum::<f64>() / logs.len() as f64).exp())
    };

    bootstrap_statistic(groups.len(), 1, geometric_mean).unwrap_or((0.0, 0.0))
}

impl StackReport {
    /// Writes `stacks.json`, `stacks.md`, and a figure of the first scan's paths for each stack and
    /// scale into `folder`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, outcomes: &[Vec<Outcome>], folder: &Path) -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        replace(&folder.join("stacks.json"), serde_json::to_string_pretty(self)?.as_bytes())?;
        replace(&folder.join("stacks.md"), self.markdown().as_bytes())?;

        for (result, outcomes) in self.stacks.iter().zip(outcomes) {
            let name = format!("{}-{}.svg", result.stack, result.scale);
            replace(&folder.join(name), figure(outcomes, 0).as_bytes())?;
        }

        Ok(())
    }

    /// The figures as Markdown: one row for each stack and scale, then each policy compared with the MGM hill-climber.
    pub fn markdown(&self) -> String {
        let Some(first) = self.stacks.first() else { return String::new() };
        let names: Vec<&str> = first.rows.iter().map(|row| row.policy.as_str()).collect();
        let mut text = format!("| MAE / in focus | {} |\n|{}\n", names.join(" | "), "---|".repeat(names.len() + 1));

        for result in &self.stacks {
            let cells: Vec<String> =
                result.rows.iter().map(|row| format!("{:.3} / {:.0} %", row.mae, 100.0 * row.in_focus)).collect();
            let _ = writeln!(text, "| {} {} | {} |", result.stack, result.scale, cells.join(" | "));
        }

        let _ = write!(
            text,
            "\n| compared with {BASELINE} | MAE, geometric mean | 95 % CI over stacks | worse on | worst | \
             beside {STRONG_BASELINE} | in focus, mean | sharpness kept | delay | turns | sure: right |\n\
             |---|---|---|---|---|---|---|---|---|---|---|\n"
        );

        for standing in self.standings.iter().filter(|standing| standing.policy != ORACLE) {
            let _ = writeln!(
                text,
                "| {} | {:.2} | {:.2}–{:.2} | {} of {} | {} | {:.2} | {:.1} % | {:.3} | {} | {:.2} | {} |",
                standing.policy,
                standing.ratio,
                standing.ratio_interval.0,
                standing.ratio_interval.1,
                standing.worse_on,
                self.stacks.len(),
                standing.worst,
                standing.beside_bisection,
                100.0 * standing.in_focus,
                standing.sharpness_kept,
                frames_late(standing.delay),
                standing.turns,
                standing.belief.map_or_else(|| "–".to_owned(), sure_and_right),
            );
        }

        let _ = writeln!(
            text,
            "\nEach stack at two scales (about 500 and 1000 pixels wide), seeds {} to {}; \
             pictures between two planes are mixed. Sure: the share of frames in which the belief says that it is in \
             focus with 85 % or more, and how often that was right.",
            self.seed,
            self.seed.wrapping_add(SEEDS as u64 - 1)
        );
        text
    }
}

/// How often a policy was sure, and how often it was right then, in percent.
fn sure_and_right(Reliance { sure, right }: Reliance) -> String {
    let right = right.map_or_else(|| "–".to_owned(), |right| format!("{:.0} %", 100.0 * right));
    format!("{:.0} %: {right}", 100.0 * sure)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::rollout::Path as Course;

    fn result(stack: &str, scale: &'static str, maes: [f64; 2]) -> StackResult {
        let row = |policy: &str, mae: f64| Row {
            policy: policy.to_owned(),
            frames: 1,
            mae,
            sd: 0.0,
            in_focus: 0.5,
            travel: 0.0,
            reversals: 6.0,
            mae_interval: (mae, mae),
            in_focus_interval: (0.5, 0.5),
            scan_mae: vec![mae],
            sharpness_kept: 0.9,
            delay: None,
            belief: None,
        };
        StackResult {
            stack: stack.to_owned(),
            scale,
            planes: 9,
            blur: None,
            rows: vec![row(BASELINE, maes[0]), row("own", maes[1]), row(STRONG_BASELINE, 0.8 * maes[0])],
        }
    }

    #[test]
    fn stacks_in_folders_of_the_same_name_are_told_apart() {
        let named = |texts: &[&str]| {
            let sources: Vec<_> = texts.iter().map(|text| StackSource::parse(text, None)).collect();
            names(&sources)
        };

        assert_eq!(named(&["a/board:21", "/b/tissue", "cone.tif"]), ["board", "tissue", "cone.tif"]);
        assert_eq!(named(&["s-1/pose0001:41", "s-2/pose0001:41", "c/d"]), ["s-1-pose0001", "s-2-pose0001", "d"]);
        assert_eq!(named(&["/a/x/p", "/b/x/p"]), ["a-x-p", "b-x-p"]);
        // The same stack twice is one stack, however it is named.
        assert_eq!(named(&["/a/board:21", "/a/./board:13"]), ["board", "board"]);
    }

    #[test]
    fn a_standing_is_the_geometric_mean_of_ratios() {
        let stacks = [
            result("a", "s", [0.1, 0.05]),
            result("a", "l", [0.1, 0.2]),
            result("b", "s", [0.2, 0.1]),
            result("b", "l", [0.2, 0.1]),
        ];
        // The optimum is 0.02 further each frame, so who is n frames late is 0.02 n behind once it has gone so far. Over
        // 25 frames that is (0.02 (0 + 1 + 2 + 3 + 4) + 20 * 0.1) / 25 = 0.088 for five, and 0.1032 for six.
        let optimum: Vec<f64> = (0..25).map(|frame| 0.5 + 0.02 * f64::from(frame)).collect();
        let path = Course { focal_power: optimum.clone(), optimum, ..Course::default() };
        let outcome = Outcome { policy: ORACLE.to_owned(), paths: vec![path], parts: 1 };
        let own = standing("own", &stacks, &vec![vec![outcome]; 4]).unwrap();
        // The baseline's errors have the geometric mean sqrt(0.1 * 0.2), and 0.1 is sqrt(0.5) of it.
        assert!((own.delay.unwrap() - (5.0 + 0.012 / 0.0152)).abs() < 1e-9, "{:?}", own.delay);
        assert!((own.beside_bisection - 0.5f64.sqrt() / 0.8).abs() < 1e-12 && (own.sharpness_kept - 0.9).abs() < 1e-12);
        // Ratios 1/2, 2, 1/2, 1/2.
        assert!((own.ratio - 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!((own.worse_on, own.worst.as_str()), (1, "a-l"));
        assert!((own.turns - 1.0).abs() < 1e-12);
        // Whole stacks are drawn: the least mean is that of b alone, the greatest that of a alone.
        assert!((own.ratio_interval.0 - 0.5).abs() < 1e-12 && (own.ratio_interval.1 - 1.0).abs() < 1e-12);
    }
}
