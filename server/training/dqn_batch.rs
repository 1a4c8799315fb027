//! A batch of windows of consecutive frames, and what the action values of its states are fitted to.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    reason = "small counts as tensor sizes and shares"
)]

use tch::Tensor;

use super::replay::{Frames, Step};
use crate::autofocus::STEP;
use crate::autofocus::learned::action_step;
use crate::autofocus::networks::{ACTIONS, HISTORY};
use crate::lens::FocalPower;

/// Windows as tensors, and the states in them that have a next frame.
pub(super) struct Batch {
    /// All windows' frames.
    pub frames: Frames,
    /// `[F]`: scaled focal powers.
    pub focal_powers: Tensor,
    pub steps: Vec<Step>,
    /// Frames that are states: their history lies in their window.
    pub states: Vec<usize>,
}

/// Frames of its own scan that a step's state reaches back.
pub(super) fn reach(step: &Step) -> usize {
    usize::from(step.age).min(HISTORY - 1)
}

/// What each action would gain at the next frame over standing still, in steps.
pub(super) fn gains(step: &Step) -> [f32; ACTIONS] {
    let (stands, best) = (FocalPower::nearest(f64::from(step.focal_power)), f64::from(step.next_optimum));
    let error = |action| (stands.moved(action_step(action)).get() - best).abs();
    std::array::from_fn(|action| ((error(1) - error(action)) / STEP) as f32)
}

/// The states whose successors `steps` frames on are in the batch, as (row, action taken), and their targets.
pub(super) fn bellman(
    batch: &Batch,
    next_values: &[f32],
    discount: f64,
    steps: usize,
    window: usize,
) -> (Vec<(i64, i64)>, Vec<f32>) {
    let mut row_of = vec![None; batch.steps.len()];
    for (row, &at) in batch.states.iter().enumerate() {
        row_of[at] = Some(row);
    }
    let (mut taken, mut wanted) = (Vec::new(), Vec::new());
    for (row, &at) in batch.states.iter().enumerate() {
        let end = at + steps;
        let same_scan = end / window == at / window
            && usize::from(batch.steps[end].age) == usize::from(batch.steps[at].age) + steps;
        let Some(last) = same_scan.then(|| row_of[end]).flatten() else { continue };
        let mut sum = discount.powi(steps as i32) * f64::from(next_values[last]);
        for ahead in 0..steps {
            let (now, next) = (&batch.steps[at + ahead], &batch.steps[at + ahead + 1]);
            sum -= discount.powi(ahead as i32) * f64::from((now.next_optimum - next.focal_power).abs());
        }
        taken.push((row as i64, i64::from(batch.steps[at].action)));
        wanted.push(sum as f32);
    }
    (taken, wanted)
}
