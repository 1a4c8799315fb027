//! An evaluation in parts: each part takes some of the scans, in another process or on another
//! machine, and the parts are merged afterwards. A whole evaluation is a single part, so that
//! merged parts give the same figures as one run, to the last digit.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::report::{EvaluatedScans, EvaluationReport};
use super::rollout::Path;
use super::{Outcome, ScanSet, compare};
use crate::LearningError;
use crate::scans::FocalTimeScan;
use crate::scans::detail::warning;
use parfocal_base::SOFTWARE;

const FORMAT: &str = "parfocal-evaluation-shard";
/// Most stretches into which a path is cut.
const MOST_STRETCHES: usize = 1000;

/// One of several parts of a set of scans: with n parts, every n-th scan. So every part has scans of all kinds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Number of this part, from 1.
    index: usize,
    /// Number of parts.
    of: usize,
}

impl Part {
    /// The only part of a whole evaluation: all scans.
    pub const WHOLE: Self = Self { index: 1, of: 1 };

    /// Indices of its scans among `count`, from 0.
    pub fn scans(self, count: usize) -> impl ExactSizeIterator<Item = usize> {
        (self.index.saturating_sub(1)..count).step_by(self.of.max(1))
    }

    /// Name of the file with its results.
    pub fn file_name(self) -> String {
        format!("shard-{}-of-{}.json", self.index, self.of)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match numbers {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index, of }),
            _ => Err("must be like 2/8, the second of eight shards".to_owned()),
        }
    }
}

/// The scans of a [`Part`] of a set.
pub struct PartOf<S> {
    set: S,
    scans: Vec<usize>,
}

impl<S: ScanSet> PartOf<S> {
    /// The scans of `set` that belong to `part`.
    pub fn new(set: S, part: Part) -> Self {
        let scans = part.scans(set.count()).collect();
        Self { set, scans }
    }
}

impl<S: ScanSet> ScanSet for PartOf<S> {
    fn count(&self) -> usize {
        self.scans.len()
    }

    fn scan(&self, index: usize) -> (Box<dyn FocalTimeScan>, usize) {
        self.set.scan(self.scans[index])
    }

    fn parts(&self) -> usize {
        self.set.parts()
    }
}

/// The results of an evaluation on one part of its scans.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Shard {
    format: String,
    software: String,
    /// The part of the scans.
    pub part: Part,
    /// What was evaluated. It is the same for all parts.
    pub subject: EvaluatedScans,
    /// Number of this part's scans without detail.
    pub without_detail: usize,
    /// Each policy's paths over this part's scans, in their order.
    pub outcomes: Vec<Outcome>,
}

impl Shard {
    /// The results on `part` of the scans of `subject`.
    pub fn new(part: Part, subject: EvaluatedScans, without_detail: usize, outcomes: Vec<Outcome>) -> Self {
        Self { format: FORMAT.to_owned(), software: SOFTWARE.to_owned(), part, subject, without_detail, outcomes }
    }

    /// Whether it holds a plausible path for each policy and each of its scans. It may come from another machine and
    /// may be damaged, so this is checked before anything in it is used.
    fn is_whole(&self) -> bool {
        let scans = self.part.scans(self.subject.count).len();
        let Part { index, of } = self.part;
        let is_whole = |outcome: &Outcome| {
            outcome.paths.len() == scans
                && (1..=MOST_STRETCHES).contains(&outcome.parts)
                && outcome.paths.iter().all(Path::is_plausible)
        };
        self.format == FORMAT
            && (1..=of).contains(&index)
            && self.without_detail <= scans
            && self.outcomes.iter().all(is_whole)
    }

    /// Names the first difference between this shard's evaluation and that of `other`; `None` if there is none.
    fn difference(&self, other: &Self) -> Option<&'static str> {
        let policies = |shard: &Self| shard.outcomes.iter().map(|outcome| outcome.policy.clone()).collect::<Vec<_>>();

        if self.software != other.software {
            return Some("the version of parfocal");
        }
        if self.part.of != other.part.of {
            return Some("the number of shards");
        }
        if policies(self) != policies(other) {
            return Some("the policies");
        }

        self.subject.difference(&other.subject)
    }
}

/// The error that the file called `name` is not a shard.
pub fn no_shard(name: &str) -> LearningError {
    LearningError::new(format!(
        "{name} is not a shard of an evaluation; give files that `parfocal evaluate --shard` wrote"
    ))
}

fn incomplete(missing: &str) -> LearningError {
    LearningError::new(format!(
        "shards are missing: {missing}; run `parfocal evaluate --shard` for them, with the same arguments"
    ))
}

/// Merges `shards`, each with the name of its file, into one report and each policy's paths.
///
/// # Errors
/// If they belong to several evaluations, some are missing, or there was nothing to focus on.
pub fn merge(mut shards: Vec<(String, Shard)>) -> Result<(EvaluationReport, Vec<Outcome>), LearningError> {
    if let Some((name, _)) = shards.iter().find(|(_, shard)| !shard.is_whole()) {
        return Err(no_shard(name));
    }

    shards.sort_by_key(|(_, shard)| shard.part.index);

    // The shards are sorted by part, so two copies of a part are neighbours.
    for pair in shards.windows(2) {
        let [(first, a), (second, b)] = pair else { continue };
        if let Some(what) = a.difference(b) {
            bail!("{first} and {second} are shards of different evaluations: they differ in {what}");
        }
        if a.part == b.part {
            bail!("{first} and {second} are both shard {}; give each shard once", a.part);
        }
    }

    let Some(Part { of, .. }) = shards.first().map(|(_, shard)| shard.part) else {
        return Err(incomplete("all"));
    };

    let present = |part: &Part| shards.iter().any(|(_, shard)| shard.part == *part);
    let missing = (1..=of).map(|index| Part { index, of }).filter(|part| !present(part));
    let missing: Vec<String> = missing.take(100).map(|part| part.to_string()).collect();
    if !missing.is_empty() {
        return Err(incomplete(&missing.join(", ")));
    }

    let shards: Vec<Shard> = shards.into_iter().map(|(_, shard)| shard).collect();
    let subject = shards[0].subject.clone();
    let without_detail = shards.iter().map(|shard| shard.without_detail).sum();
    warning(without_detail, subject.count)?;

    let outcomes: Vec<Outcome> = (0..shards[0].outcomes.len()).map(|policy| together(&shards, policy)).collect();
    let rows: Vec<_> = outcomes.iter().map(Outcome::row).collect();
    let comparisons = compare(&rows);

    Ok((EvaluationReport { subject, without_detail, rows, comparisons }, outcomes))
}

/// The paths of the policy at `index` over all scans, in the order of the set.
fn together(shards: &[Shard], index: usize) -> Outcome {
    let first = &shards[0];
    let count = first.subject.count;
    let mut paths = vec![Path::default(); count];

    for shard in shards {
        for (scan, path) in shard.part.scans(count).zip(&shard.outcomes[index].paths) {
            paths[scan] = path.clone();
        }
    }

    Outcome { paths, ..first.outcomes[index].clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(text: &str) -> Part {
        text.parse().unwrap()
    }

    #[test]
    fn parts_hold_every_scan_once() {
        let parts = ["1/3", "2/3", "3/3"].map(|text| part(text).scans(7).collect::<Vec<_>>());
        assert_eq!(parts, [vec![0, 3, 6], vec![1, 4], vec![2, 5]]);
        assert_eq!(["1/3", "2/3", "3/3"].map(|text| part(text).scans(7).len()), [3, 2, 2]);
        assert_eq!(part("5/5").scans(3).len(), 0);

        for wrong in ["0/3", "4/3", "1", "1/0", "a/b", ""] {
            assert!(wrong.parse::<Part>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn shards_that_do_not_fit_together_are_rejected() {
        let shard = |text: &str, seed: u64| {
            let part = part(text);
            let subject = EvaluatedScans { scans: "simulated".to_owned(), seed, count: 3, ..EvaluatedScans::default() };
            let path = Path { focal_power: vec![0.5], optimum: vec![0.6], ..Path::default() };
            let paths = vec![path; part.scans(3).len()];
            let outcome = Outcome { policy: "fixed".to_owned(), paths, parts: 1 };
            (format!("{text} of seed {seed}"), Shard::new(part, subject, 0, vec![outcome]))
        };

        let told = |shards: &[(&str, u64)]| {
            let shards = shards.iter().map(|(text, seed)| shard(text, *seed)).collect();
            merge(shards).map_or_else(|error| error.to_string(), |(report, _)| report.rows[0].frames.to_string())
        };

        assert_eq!(told(&[("2/2", 7), ("1/2", 7)]), "3");
        assert_eq!(told(&[("1/3", 7)]).split(';').next(), Some("shards are missing: 2/3, 3/3"));
        assert!(told(&[("1/2", 7), ("1/2", 7)]).contains("are both shard 1/2"));
        assert!(told(&[("1/2", 7), ("2/2", 8)]).contains("1/2 of seed 7 and 2/2 of seed 8 are shards of different"));
        assert!(told(&[("1/2", 7), ("2/2", 8)]).ends_with("differ in the seed"));
        assert!(told(&[("1/2", 7), ("3/3", 7)]).ends_with("differ in the number of shards"));
        assert!(told(&[]).contains("missing: all"));
    }
}
