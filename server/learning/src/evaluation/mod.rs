//! Evaluation: every policy on the same focal-time scans, figures over all of them, and tests between any two.

pub mod report;
pub mod rollout;
pub mod shard;
pub mod stacks;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::scans::ScanSet;
use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_autofocus::{PolicyError, Registry};
use parfocal_base::PolicyName;
use parfocal_base::statistics::{Method, SignedRank, bootstrap_interval, deviation, holm, mean, wilcoxon};
use rollout::{NoTarget, Path, PathFigures, roll_out, roll_out_oracle};

/// Name of the policy that knows the next optimum.
pub const ORACLE: &str = "oracle";

/// One policy's paths over the scans of a set.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Outcome {
    /// The policy, or [`ORACLE`].
    pub policy: String,
    /// Its path over each scan.
    pub paths: Vec<Path>,
    /// See [`ScanSet::parts`].
    pub parts: usize,
}

/// A policy's figures over all scans.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The policy, or [`ORACLE`].
    pub policy: String,
    /// Number of frames over all scans.
    pub frames: usize,
    /// Mean absolute focal power error over all frames.
    pub mae: f64,
    /// Standard deviation of the absolute error over all frames.
    pub sd: f64,
    /// Share of frames in focus, 0..1.
    pub in_focus: f64,
    /// Mean absolute change of focal power a frame.
    pub travel: f64,
    /// Changes of direction a second.
    pub reversals: f64,
    /// 95 % bootstrap interval of `mae` over scans, or their parts.
    pub mae_interval: (f64, f64),
    /// 95 % bootstrap interval of `in_focus` over scans, or their parts.
    pub in_focus_interval: (f64, f64),
    /// Each scan's, or part's, mean absolute error.
    pub scan_mae: Vec<f64>,
}

/// A paired test between two policies, over scans.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// One policy.
    pub a: String,
    /// The other.
    pub b: String,
    /// The test's name.
    pub test: &'static str,
    /// How p was computed.
    pub method: Method,
    /// The test's two-sided p.
    pub p: f64,
    /// `p`, corrected by Holm's method for all comparisons of the evaluation.
    pub p_holm: f64,
}

/// Why an evaluation ended without figures.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// A policy is unknown or cannot run.
    #[error(transparent)]
    Policy(#[from] PolicyError),
    /// A policy gave up.
    #[error("policy '{policy}' failed on scan {scan}: {error}; repair it, or evaluate without it")]
    NoTarget {
        /// The policy.
        policy: PolicyName,
        /// The scan, from 1.
        scan: usize,
        /// When, and what it answered.
        error: NoTarget,
    },
}

/// Runs the oracle and then the named policies over `scans`, several scans at once if there are cores for it.
/// `progress` is called after each policy's scan.
///
/// # Errors
/// If a policy is unknown or cannot run, or returns an invalid focal power.
pub fn evaluate(
    registry: &Registry,
    policies: &[PolicyName],
    scans: &dyn ScanSet,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Vec<Outcome>, EvaluateError> {
    let count = scans.count();
    let parts = scans.parts();

    let perfect = |index| {
        let (mut scan, frames) = scans.scan(index);
        roll_out_oracle(scan.as_mut(), frames)
    };

    let paths = (0..count).into_par_iter().map(perfect).collect();
    let mut outcomes = vec![Outcome { policy: ORACLE.to_owned(), paths, parts }];

    for name in policies {
        let run = |index| {
            compute_on_this_thread();
            let (mut scan, frames) = scans.scan(index);
            let path = roll_out(registry.build(name)?.as_mut(), scan.as_mut(), frames);
            progress(name.as_str());
            path.map_err(|error| EvaluateError::NoTarget { policy: name.clone(), scan: index + 1, error })
        };

        // All results are collected first. So if several scans fail, the first of them is reported, in whatever order
        // the cores ran them.
        let paths: Vec<Result<_, EvaluateError>> = (0..count).into_par_iter().map(run).collect();
        let paths = paths.into_iter().collect::<Result<_, _>>()?;
        outcomes.push(Outcome { policy: name.to_string(), paths, parts });
    }

    Ok(outcomes)
}

impl Outcome {
    /// The figures over all paths.
    #[must_use]
    pub fn row(&self) -> Row {
        // These figures are of whole paths, because what happens from one part to the next counts, and parts differ in
        // length.
        let whole: Vec<PathFigures> = self.paths.iter().map(Path::figures).collect();
        let parts = self.paths.iter().flat_map(|path| path.parts(self.parts));
        let parts: Vec<PathFigures> = parts.map(|part| part.figures()).collect();
        let column = |of: &[PathFigures], value: fn(&PathFigures) -> f64| of.iter().map(value).collect::<Vec<_>>();
        let errors: Vec<f64> = self.paths.iter().flat_map(Path::errors).collect();
        let scan_mae = column(&parts, |f| f.mae);

        Row {
            policy: self.policy.clone(),
            frames: errors.len(),
            mae: mean(&errors),
            sd: deviation(&errors),
            in_focus: mean(&column(&whole, |f| f.in_focus)),
            travel: mean(&column(&whole, |f| f.travel)),
            reversals: mean(&column(&whole, |f| f.reversals)),
            mae_interval: bootstrap_interval(&scan_mae, 1),
            in_focus_interval: bootstrap_interval(&column(&parts, |f| f.in_focus), 2),
            scan_mae,
        }
    }
}

/// Tests each pair of rows, without the oracle.
#[must_use]
pub fn compare(rows: &[Row]) -> Vec<Comparison> {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.policy != ORACLE).collect();
    let pairs = rows.iter().enumerate().flat_map(|(index, a)| rows[index + 1..].iter().map(move |b| (*a, *b)));
    let pairs: Vec<(&Row, &Row)> = pairs.collect();

    let tests: Vec<SignedRank> = pairs.iter().map(|(a, b)| wilcoxon(&a.scan_mae, &b.scan_mae)).collect();
    let corrected = holm(&tests.iter().map(|test| test.p).collect::<Vec<_>>());

    let comparison = |(((a, b), test), p_holm): (((&Row, &Row), SignedRank), f64)| Comparison {
        a: a.policy.clone(),
        b: b.policy.clone(),
        test: "wilcoxon-signed-rank",
        method: test.method,
        p: test.p,
        p_holm,
    };
    pairs.into_iter().zip(tests).zip(corrected).map(comparison).collect()
}

#[cfg(test)]
mod tests;
