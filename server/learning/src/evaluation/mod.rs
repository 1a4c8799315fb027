//! Evaluation: every policy on the same focal-time scans, figures over all of them, and tests between any two.

pub mod delay;
pub mod report;
pub mod rollout;
pub mod shard;
pub mod stacks;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::delay::{delay_of, late_error};
use crate::LearningError;
use crate::scans::ScanSet;
use parfocal_autofocus::Registry;
use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_base::PolicyName;
use parfocal_base::statistics::{Method, SignedRank, bootstrap_interval, deviation, holm, mean, wilcoxon};
use rollout::{Path, PathFigures, Sureness, roll_out, roll_out_oracle, sharpest};

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
    /// Mean gradient magnitude of the patch, divided by that at the optimum; mean over all frames. An optimum that
    /// flickers between two places of equal sharpness does not spoil it.
    pub sharpness_kept: f64,
    /// How many frames late somebody would have the same error who knows every optimum exactly and moves by at most 0.1
    /// a frame; interpolated. `None` if that is more than 50.
    pub delay: Option<f64>,
    /// How far its belief can be relied on; `None` if it has none.
    pub belief: Option<Reliance>,
}

/// How far a policy's belief can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reliance {
    /// Share of frames in which it is sure of being in focus: at least 85 %.
    pub sure: f64,
    /// Share of those in which it was right; `None` if it was never sure.
    pub right: Option<f64>,
}

impl Reliance {
    /// The reliance of several paths together; `None` if they have no claims.
    pub fn of<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Option<Self> {
        let mut all = Sureness::default();
        for Sureness { claims, sure, right } in paths.into_iter().map(Path::sureness) {
            all.claims += claims;
            all.sure += sure;
            all.right += right;
        }

        let right = (all.sure > 0).then(|| all.right as f64 / all.sure as f64);
        (all.claims > 0).then(|| Self { sure: all.sure as f64 / all.claims as f64, right })
    }
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
) -> Result<Vec<Outcome>, LearningError> {
    let count = scans.count();
    let parts = scans.parts();

    // A scan's course does not depend on what is looked at, so it can be gone through once for all policies.
    let look = |index| {
        let (mut scan, frames) = scans.scan(index);
        sharpest(scan.as_mut(), frames)
    };
    let sharpest: Vec<Vec<f64>> = (0..count).into_par_iter().map(look).collect();

    let perfect = |index: usize| roll_out_oracle(scans.scan(index).0.as_mut(), &sharpest[index]);
    let paths = (0..count).into_par_iter().map(perfect).collect();
    let mut outcomes = vec![Outcome { policy: ORACLE.to_owned(), paths, parts }];

    for name in policies {
        let run = |index: usize| {
            compute_on_this_thread();
            let mut scan = scans.scan(index).0;
            let path = roll_out(registry.build(name)?.as_mut(), scan.as_mut(), &sharpest[index]);
            progress(name.as_str());
            path.map_err(|error| {
                let scan = index + 1;
                LearningError::new(format!(
                    "policy '{name}' failed on scan {scan}: {error}; repair it, or evaluate without it"
                ))
            })
        };

        // All results are collected first. So if several scans fail, the first of them is reported, in whatever order
        // the cores ran them.
        let paths: Vec<Result<_, LearningError>> = (0..count).into_par_iter().map(run).collect();
        let paths = paths.into_iter().collect::<Result<_, _>>()?;
        outcomes.push(Outcome { policy: name.to_string(), paths, parts });
    }

    Ok(outcomes)
}

impl Outcome {
    /// The figures over all paths.
    pub fn row(&self) -> Row {
        // These figures are of whole paths, because what happens from one part to the next counts, and parts differ in
        // length.
        let whole: Vec<PathFigures> = self.paths.iter().map(Path::figures).collect();
        let parts = self.paths.iter().flat_map(|path| path.parts(self.parts));
        let parts: Vec<PathFigures> = parts.map(|part| part.figures()).collect();
        let column = |of: &[PathFigures], value: fn(&PathFigures) -> f64| of.iter().map(value).collect::<Vec<_>>();
        let errors: Vec<f64> = self.paths.iter().flat_map(Path::errors).collect();
        let scan_mae = column(&parts, |f| f.mae);
        let mae = mean(&errors);
        let kept: Vec<f64> = self.paths.iter().flat_map(|path| path.sharpness_kept.iter().copied()).collect();

        Row {
            policy: self.policy.clone(),
            frames: errors.len(),
            mae,
            sd: deviation(&errors),
            in_focus: mean(&column(&whole, |f| f.in_focus)),
            travel: mean(&column(&whole, |f| f.travel)),
            reversals: mean(&column(&whole, |f| f.reversals)),
            mae_interval: bootstrap_interval(&scan_mae, 1),
            in_focus_interval: bootstrap_interval(&column(&parts, |f| f.in_focus), 2),
            scan_mae,
            sharpness_kept: mean(&kept),
            delay: delay_of(mae, |late| self.late_error(late)),
            belief: Reliance::of(&self.paths),
        }
    }

    /// Mean absolute error on these scans of an observer who knows every optimum `late` frames late; see
    /// [`late_error`].
    pub fn late_error(&self, late: usize) -> f64 {
        let frames: usize = self.paths.iter().map(|path| path.optimum.len()).sum();
        let sum = self.paths.iter().map(|path| path.optimum.len() as f64 * late_error(&path.optimum, late));
        sum.sum::<f64>() / frames.max(1) as f64
    }
}

/// Tests each pair of rows, without the oracle.
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
