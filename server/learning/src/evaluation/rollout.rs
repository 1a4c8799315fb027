//! Runs one policy on one focal-time scan, and rates its path.

use serde::{Deserialize, Serialize};

use crate::LearningError;
use crate::scans::FocalTimeScan;
use parfocal_autofocus::belief::{SURE, Sides, best};
use parfocal_autofocus::networks::BINS;
use parfocal_autofocus::{Observation, Policy, STEP, mgm};
use parfocal_base::FocalPower;
use parfocal_base::IN_FOCUS;

/// Frames a second of simulated scans: the paper's clips hold 250 frames in 10 s.
pub const FRAMES_A_SECOND: f64 = 25.0;

/// The focal power of the lens and the optimum, frame by frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Path {
    /// Focal power of each frame.
    pub focal_power: Vec<f64>,
    /// Optimal focal power of each frame.
    pub optimum: Vec<f64>,
    /// Mean gradient magnitude of each frame's patch, divided by that at the optimum; empty if nobody looked.
    pub sharpness_kept: Vec<f64>,
    /// What the policy claimed about the frame after each frame; empty if it has no belief.
    pub claims: Vec<Claim>,
}

/// What a policy's belief says: where the picture will be in focus most likely, and how likely.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Claim {
    /// The focal power.
    pub place: f64,
    /// Probability that the optimum is within [`IN_FOCUS`] of it.
    pub probability: f64,
}

impl Claim {
    /// The claim of `belief`; `None` if that is not a probability for each of [`BINS`] bins.
    fn of(belief: &[f32]) -> Option<Self> {
        let are_probabilities = belief.iter().all(|probability| (0.0..=1.01).contains(probability));
        let sum: f32 = belief.iter().sum();
        if belief.len() != BINS || !are_probabilities || (sum - 1.0).abs() > 0.01 {
            return None;
        }

        let place = best(belief);
        Some(Self { place, probability: Sides::of(belief, place).here })
    }
}

/// How often a policy was sure of being in focus, and right.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sureness {
    /// Claims about a frame of the path.
    pub claims: usize,
    /// Those of at least [`SURE`].
    pub sure: usize,
    /// Those of them for which the optimum was within [`IN_FOCUS`].
    pub right: usize,
}

/// How good a [`Path`] is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathFigures {
    /// Mean absolute focal power error.
    pub mae: f64,
    /// Share of frames with an error below [`IN_FOCUS`]. On a grid of focal powers, rounding decides whether an error
    /// of exactly this limit counts. `docs/notebook.md` says how much depends on it.
    pub in_focus: f64,
    /// Mean absolute change of focal power a frame.
    pub travel: f64,
    /// Changes of direction a second.
    pub reversals: f64,
}

impl Path {
    /// Absolute error of each frame.
    pub fn errors(&self) -> impl Iterator<Item = f64> + '_ {
        self.focal_power.iter().zip(&self.optimum).map(|(f, best)| (f - best).abs())
    }

    /// Whether it has an optimum for each focal power, and all values are within 0..=1.
    pub(super) fn is_plausible(&self) -> bool {
        let are_powers = |values: &[f64]| values.iter().all(|value| (0.0..=1.0).contains(value));
        let frames = self.focal_power.len();
        let is_whole = |length: usize| length == frames || length == 0;
        let is_claim = |claim: &Claim| are_powers(&[claim.place]) && (0.0..=1.01).contains(&claim.probability);

        self.optimum.len() == frames
            && are_powers(&self.focal_power)
            && are_powers(&self.optimum)
            && is_whole(self.sharpness_kept.len())
            && self.sharpness_kept.iter().all(|kept| kept.is_finite() && *kept >= 0.0)
            && is_whole(self.claims.len())
            && self.claims.iter().all(is_claim)
    }

    /// How often its claims were sure, and right. A claim is about the frame after the one at which it was made.
    pub fn sureness(&self) -> Sureness {
        let mut out = Sureness::default();
        for (claim, optimum) in self.claims.iter().zip(self.optimum.iter().skip(1)) {
            out.claims += 1;
            if claim.probability >= SURE {
                out.sure += 1;
                out.right += usize::from((claim.place - optimum).abs() < IN_FOCUS);
            }
        }
        out
    }

    /// This path cut into `count` stretches of the same length, to within a frame.
    pub fn parts(&self, count: usize) -> Vec<Self> {
        let frames = self.focal_power.len();
        let part = |index: usize| {
            let range = frames * index / count..frames * (index + 1) / count;
            Self {
                focal_power: self.focal_power[range.clone()].to_vec(),
                optimum: self.optimum[range.clone()].to_vec(),
                sharpness_kept: self.sharpness_kept.get(range.clone()).unwrap_or_default().to_vec(),
                claims: self.claims.get(range).unwrap_or_default().to_vec(),
            }
        };
        (0..count).map(part).filter(|part| !part.focal_power.is_empty()).collect()
    }

    /// Figures of this path; all zero for an empty one.
    pub fn figures(&self) -> PathFigures {
        let count = self.focal_power.len().max(1) as f64;
        let steps: Vec<f64> =
            self.focal_power.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| step.abs() > 1e-9).collect();
        let turns = steps.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();

        PathFigures {
            mae: self.errors().sum::<f64>() / count,
            in_focus: self.errors().filter(|&error| error < IN_FOCUS).count() as f64 / count,
            travel: steps.iter().fold(0.0, |sum, step| sum + step.abs()) / (count - 1.0).max(1.0),
            reversals: turns as f64 / (count / FRAMES_A_SECOND),
        }
    }
}

/// The mean gradient magnitude of the patch at the optimum, for each of `frames` frames of `scan`.
pub fn sharpest(scan: &mut dyn FocalTimeScan, frames: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(frames);
    for _ in 0..frames {
        let optimum = scan.optimum();
        out.push(mgm(&scan.patch(optimum)));
        scan.advance();
    }
    out
}

/// `sharpness` divided by that at the optimum. Nothing is lost where there is nothing to focus on.
fn kept(sharpness: f64, at_optimum: f64) -> f64 {
    if at_optimum > 0.0 { sharpness / at_optimum } else { 1.0 }
}

/// Runs `policy` over `scan`, starting in the middle of the lens's range. The next frame is seen at the focal power
/// that the policy returns. `sharpest` has the sharpness of each frame at its optimum, and so their number.
///
/// # Errors
/// If the policy returns something that is not a focal power. The live loop would then hold the lens, and the rest of
/// the path would not be the policy's.
pub fn roll_out(
    policy: &mut dyn Policy,
    scan: &mut dyn FocalTimeScan,
    sharpest: &[f64],
) -> Result<Path, LearningError> {
    let mut focal_power = FocalPower::MIDDLE;
    let mut course = Path::default();
    for (frame, at_optimum) in (1..).zip(sharpest) {
        let view = scan.observe(focal_power);
        course.focal_power.push(focal_power.get());
        course.optimum.push(scan.optimum().get());
        course.sharpness_kept.push(kept(mgm(&view.patch), *at_optimum));

        let decision = policy.step(&Observation { view: &view, focal_power });
        course.claims.extend(decision.belief.as_deref().and_then(Claim::of));
        let target = decision.target;
        focal_power = FocalPower::new(target).map_err(|_| {
            LearningError::new(match policy.fault() {
                Some(fault) => format!("at frame {frame}, {fault}"),
                None => format!("at frame {frame} it returned {target}, which is not a focal power"),
            })
        })?;
        scan.advance();
    }

    // A policy without a belief in some frames makes no claims that could be laid beside the frames.
    if course.claims.len() != course.focal_power.len() {
        course.claims.clear();
    }
    Ok(course)
}

/// Runs the oracle: the best that a policy with the paper's steps could do if it knew the next
/// frame's optimum.
pub fn roll_out_oracle(scan: &mut dyn FocalTimeScan, sharpest: &[f64]) -> Path {
    let mut focal_power = FocalPower::MIDDLE;
    let mut course = Path::default();
    for at_optimum in sharpest {
        course.focal_power.push(focal_power.get());
        course.optimum.push(scan.optimum().get());
        course.sharpness_kept.push(kept(mgm(&scan.patch(focal_power)), *at_optimum));
        scan.advance();

        let best = scan.optimum();
        focal_power = [0.0, -STEP, STEP]
            .map(|step| focal_power.moved(step))
            .into_iter()
            .min_by(|a, b| a.distance(best).total_cmp(&b.distance(best)))
            .unwrap_or(focal_power);
    }
    course
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_a_hand_worked_path() {
        let path = Path {
            focal_power: vec![0.5, 0.55, 0.55, 0.5, 0.55],
            optimum: vec![0.5, 0.5, 0.7, 0.5, 0.5],
            ..Path::default()
        };
        let figures = path.figures();
        assert!((figures.mae - 0.05).abs() < 1e-12);
        assert!((figures.in_focus - 0.8).abs() < 1e-12);
        assert!((figures.travel - 0.0375).abs() < 1e-12);
        // Up, down, up: two turns in a fifth of a second.
        assert!((figures.reversals - 10.0).abs() < 1e-12);
    }

    #[test]
    fn parts_hold_every_frame_once() {
        let path = Path { focal_power: (0..7).map(f64::from).collect(), optimum: vec![0.5; 7], ..Path::default() };
        let parts: Vec<_> = path.parts(3).into_iter().map(|part| part.focal_power).collect();
        assert_eq!(parts, [vec![0.0, 1.0], vec![2.0, 3.0], vec![4.0, 5.0, 6.0]]);
        assert_eq!(path.parts(9).len(), 7);
    }

    #[test]
    fn a_claim_is_the_best_place_and_the_belief_around_it() {
        let mut belief = [0.0; BINS];
        // Bins are 0.025 apart: 17 and 23 are 0.075 from the middle, 10 is 0.25 away.
        for (bin, share) in [(20, 0.6), (17, 0.1), (23, 0.1), (10, 0.2)] {
            belief[bin] = share;
        }
        let Claim { place, probability } = Claim::of(&belief).unwrap();
        assert!((place - 0.5).abs() < 0.02 && (probability - 0.8).abs() < 1e-6, "{place} {probability}");
        assert_eq!(Claim::of(&[0.5, 0.5]), None);
    }

    #[test]
    fn a_claim_is_about_the_frame_after_it() {
        let claim = |place, probability| Claim { place, probability };
        let path = Path {
            focal_power: vec![0.5; 4],
            optimum: vec![0.1, 0.5, 0.9, 0.5],
            // Sure and right of the second frame, unsure of the third, sure and wrong of the fourth; the last is of no
            // frame.
            claims: vec![claim(0.55, 0.9), claim(0.9, 0.8), claim(0.7, 0.86), claim(0.5, 1.0)],
            ..Path::default()
        };
        assert_eq!(path.sureness(), Sureness { claims: 3, sure: 2, right: 1 });
    }
}
