//! How a DQN policy is trained: a recipe's `[dqn]` section.

use serde::{Deserialize, Serialize};

use crate::training::optimiser::Rule;

/// What the action values are fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Target {
    /// Bellman's equation for the action taken: the rewards of some frames plus the target network's value after them.
    Bellman(Bellman),
    /// What each of the three actions would have gained over standing still at the next frame, in steps. The simulation
    /// knows it for all three, not only for the action taken.
    Lookahead(Lookahead),
}

/// How Bellman's equation is applied.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bellman {
    /// Discount per frame.
    pub discount: f64,
    /// Frames whose rewards are summed.
    pub steps: usize,
    /// Double DQN: whether the online network chooses the next action that the target network values.
    pub double: bool,
    /// Whether rewards are measured in steps per frame, relative to what an oracle would get from the same place. This
    /// is shaping by a potential (Ng, Harada, Russell 1999), so the best policy stays the same. Without it, the distance
    /// to the optimum, which no policy can know, hides the small difference that an action makes.
    #[serde(default)]
    pub regret: bool,
}

/// Rewards for moving at all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lookahead {
    /// Reward for moving at all while the picture is well out of focus, in steps. A policy that stands still does not
    /// see on which side the optimum lies.
    #[serde(default)]
    pub restless: f64,
    /// Share of that reward for a move that reverses the last one. Below 1, a policy that searches for the optimum
    /// sweeps instead of trembling.
    #[serde(default = "whole")]
    pub turning: f64,
}

const fn whole() -> f64 {
    1.0
}

/// How a DQN policy is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DqnRecipe {
    /// Scans that run side by side.
    pub scans: usize,
    /// Frames of a scan.
    pub frames_a_scan: u16,
    /// Frames played between two updates, over all scans together; rounded up to a multiple of `scans`.
    pub frames_an_update: usize,
    /// Frames played before the first update.
    pub warm_up: u64,
    /// Capacity of the replay memory, in frames.
    pub replay: usize,
    /// Windows of a batch.
    pub windows: usize,
    /// Consecutive frames of a window.
    pub window: usize,
    /// Updates of the whole training.
    pub updates: u64,
    /// What the action values are fitted to.
    pub target: Target,
    /// The optimiser and its learning rate.
    pub optimiser: Rule,
    /// Largest norm of the gradient; a larger gradient is scaled down to it.
    pub clip: f64,
    /// Share of the learning rate that is left at the end. It falls along a half cosine. 1: constant.
    pub final_rate: f64,
    /// Share of random actions at the start.
    pub first_epsilon: f64,
    /// Share of random actions at the end.
    pub last_epsilon: f64,
    /// Frames over which `first_epsilon` decays to `last_epsilon`: exponentially, or linearly if one of them is 0.
    pub epsilon_frames: u64,
    /// How far the target network moves towards the online network at each update: 0 not at all, 1 all the way.
    pub target_share: f64,
    /// Share of scans that differ from the reference in speed, spot, noise, exposure, lens.
    pub variety: f64,
    /// Share of scans on which the policy's target is replaced now and then by a wrong one.
    pub wandering: f64,
}

impl DqnRecipe {
    /// Share of random actions after `frames` frames.
    pub fn epsilon(&self, frames: u64) -> f64 {
        let done = (frames as f64 / self.epsilon_frames.max(1) as f64).min(1.0);
        let first = self.first_epsilon;
        let last = self.last_epsilon;

        if first.min(last) > 0.0 {
            // Rounding must not lead above 1.
            (first * (last / first).powf(done)).min(1.0)
        } else {
            // An exponential decay cannot begin or end at 0.
            first + (last - first) * done
        }
    }
}
