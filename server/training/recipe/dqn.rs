//! How a DQN policy is trained: what a recipe's `[dqn]` section holds.

use serde::{Deserialize, Serialize};

use crate::training::optimiser::Rule;

/// What the action values are fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum Target {
    /// Bellman's equation, from the action taken: rewards of `steps` frames, then the target network's value.
    Bellman {
        /// Discount a frame.
        discount: f64,
        /// Frames whose rewards are summed.
        steps: usize,
        /// Whether the online network picks the action that the target network values.
        double: bool,
        /// Whether rewards are counted in steps a frame and against what an oracle would get from the
        /// same place. The policy that is best stays the same, since that is shaping by a potential
        /// (Ng, Harada, Russell 1999), but how far away the optimum is, which no policy can know, no
        /// longer drowns what an action changes.
        #[serde(default)]
        regret: bool,
    },
    /// What each of the three actions would have gained over standing still at the next frame, in steps; known in
    /// simulation for all three whichever was taken.
    Lookahead {
        /// What moving earns by itself where the picture is well out of focus, in steps: standing
        /// still does not show on which side the optimum lies.
        #[serde(default)]
        restless: f64,
        /// Share of that which a move against the last one earns: below 1, a policy that looks for
        /// the optimum sweeps rather than trembles.
        #[serde(default = "whole")]
        turning: f64,
    },
}

const fn whole() -> f64 {
    1.0
}

/// How a DQN policy is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DqnRecipe {
    /// Scans side by side.
    pub scans: usize,
    /// Frames of a scan.
    pub frames_a_scan: u16,
    /// Frames played between updates, over all scans together a multiple of `scans`.
    pub frames_an_update: usize,
    /// Frames played before the first update.
    pub warm_up: u64,
    /// Most frames remembered.
    pub replay: usize,
    /// Windows in a batch.
    pub windows: usize,
    /// Consecutive frames in a window.
    pub window: usize,
    /// Updates in all.
    pub updates: u64,
    /// What values are fitted to.
    pub target: Target,
    /// Optimiser.
    pub optimiser: Rule,
    /// Largest norm of a gradient.
    pub clip: f64,
    /// Share of the learning rate left at the end; the way there is a half cosine. 1: constant.
    pub final_rate: f64,
    /// Share of random actions at first.
    pub first_epsilon: f64,
    /// Share of random actions at last.
    pub last_epsilon: f64,
    /// Frames over which the first decays exponentially to the last, or straight where one of them is 0.
    pub epsilon_frames: u64,
    /// Share of the online network that the target network takes over an update.
    pub target_share: f64,
    /// Share of scans that differ from the reference in speed, spot, noise, exposure, lens.
    pub variety: f64,
    /// Share of scans on which the policy is led astray.
    pub wandering: f64,
}

impl DqnRecipe {
    /// Share of random actions after `frames` frames.
    #[must_use]
    pub fn epsilon(&self, frames: u64) -> f64 {
        let done = (frames as f64 / self.epsilon_frames.max(1) as f64).min(1.0);
        let first = self.first_epsilon;
        let last = self.last_epsilon;

        if first.min(last) > 0.0 {
            // Rounding must not lead beyond what is a share.
            (first * (last / first).powf(done)).min(1.0)
        } else {
            // Nothing decays to or from 0 exponentially.
            first + (last - first) * done
        }
    }
}
