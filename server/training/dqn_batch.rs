//! A batch of windows of consecutive frames, and what the action values of its states are fitted to.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    reason = "small counts as tensor sizes and shares"
)]

use tch::{Device, Tensor};

use super::replay::{Frames, Step};
use crate::autofocus::STEP;
use crate::autofocus::learned::{action_step, scaled_focal_power};
use crate::autofocus::networks::{ACTIONS, HISTORY};
use crate::lens::FocalPower;

/// Windows as tensors, and the states in them that have a next frame.
pub(super) struct Batch {
    /// All windows' frames.
    pub frames: Frames,
    /// `[8 S]`: of each state its latest eight frames, oldest first; before eight were seen, the first for those missing.
    pub history: Tensor,
    /// `[S, 8]`: the scaled focal powers at these.
    pub focal_powers: Tensor,
    pub steps: Vec<Step>,
    /// Frames that are states: their history lies in their window.
    pub states: Vec<usize>,
}

impl Batch {
    /// A batch of `frames`, `window` of them in each window, for a network on `device`.
    pub fn new(frames: Frames, steps: Vec<Step>, window: usize, device: Device) -> Self {
        let states: Vec<usize> = (0..steps.len()).filter(|&at| at % window >= reach(&steps[at])).collect();
        let latest = |&at: &usize| {
            let reach = reach(&steps[at]);
            (0..HISTORY).rev().map(move |back| at - back.min(reach))
        };
        let history: Vec<usize> = states.iter().flat_map(latest).collect();
        let focal_powers: Vec<f32> =
            history.iter().map(|&at| scaled_focal_power(f64::from(steps[at].focal_power))).collect();
        let history: Vec<i64> = history.into_iter().map(|at| at as i64).collect();
        let history = Tensor::from_slice(&history).to_device(device);
        let focal_powers = Tensor::from_slice(&focal_powers).view([-1, HISTORY as i64]).to_device(device);
        Self { frames, history, focal_powers, steps, states }
    }
}

/// Frames of its own scan that a step's state reaches back.
fn reach(step: &Step) -> usize {
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
