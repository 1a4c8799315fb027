//! Runs one policy on one focal-time scan, and rates its path.

use serde::{Deserialize, Serialize};

use crate::scans::FocalTimeScan;
use parfocal_autofocus::{Observation, Policy, STEP};
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
        self.focal_power.len() == self.optimum.len() && are_powers(&self.focal_power) && are_powers(&self.optimum)
    }

    /// This path cut into `count` stretches of the same length, to within a frame.
    #[must_use]
    pub fn parts(&self, count: usize) -> Vec<Self> {
        let frames = self.focal_power.len();
        let part = |index: usize| {
            let range = frames * index / count..frames * (index + 1) / count;
            Self { focal_power: self.focal_power[range.clone()].to_vec(), optimum: self.optimum[range].to_vec() }
        };
        (0..count).map(part).filter(|part| !part.focal_power.is_empty()).collect()
    }

    /// Figures of this path; all zero for an empty one.
    #[must_use]
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

/// A policy's answer that is not a finite number.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("at frame {frame} it returned {target}, which is not a focal power")]
pub struct NoTarget {
    /// The frame, from 1.
    pub frame: usize,
    /// The answer.
    pub target: f64,
}

/// Runs `policy` over `frames` frames of `scan`, starting in the middle of the lens's range. The next frame is seen at
/// the focal power that the policy returns.
///
/// # Errors
/// If the policy returns something that is not a finite number. In the live loop the watchdog would then take over, and
/// the rest of the path would not be the policy's.
pub fn roll_out(policy: &mut dyn Policy, scan: &mut dyn FocalTimeScan, frames: usize) -> Result<Path, NoTarget> {
    let mut focal_power = FocalPower::MIDDLE;
    let mut course = Path::default();
    for frame in 1..=frames {
        let view = scan.observe(focal_power);
        course.focal_power.push(focal_power.get());
        course.optimum.push(scan.optimum().get());

        let target = policy.step(&Observation { view: &view, focal_power }).target;
        if !target.is_finite() {
            return Err(NoTarget { frame, target });
        }

        focal_power = FocalPower::nearest(target);
        scan.advance();
    }
    Ok(course)
}

/// Runs the oracle: the best that a policy with the paper's steps could do if it knew the next
/// frame's optimum.
pub fn roll_out_oracle(scan: &mut dyn FocalTimeScan, frames: usize) -> Path {
    let mut focal_power = FocalPower::MIDDLE;
    let mut course = Path::default();
    for _ in 0..frames {
        course.focal_power.push(focal_power.get());
        course.optimum.push(scan.optimum().get());
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
        let path = Path { focal_power: vec![0.5, 0.55, 0.55, 0.5, 0.55], optimum: vec![0.5, 0.5, 0.7, 0.5, 0.5] };
        let figures = path.figures();
        assert!((figures.mae - 0.05).abs() < 1e-12);
        assert!((figures.in_focus - 0.8).abs() < 1e-12);
        assert!((figures.travel - 0.0375).abs() < 1e-12);
        // Up, down, up: two turns in a fifth of a second.
        assert!((figures.reversals - 10.0).abs() < 1e-12);
    }

    #[test]
    fn parts_hold_every_frame_once() {
        let path = Path { focal_power: (0..7).map(f64::from).collect(), optimum: vec![0.5; 7] };
        let parts: Vec<_> = path.parts(3).into_iter().map(|part| part.focal_power).collect();
        assert_eq!(parts, [vec![0.0, 1.0], vec![2.0, 3.0], vec![4.0, 5.0, 6.0]]);
        assert_eq!(path.parts(9).len(), 7);
    }
}
