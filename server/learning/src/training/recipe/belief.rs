//! How the belief tracker is trained: a recipe's `[belief]` section.

use serde::{Deserialize, Serialize};

use crate::training::optimiser::Rule;

/// How a belief tracker is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeliefRecipe {
    /// Scans that run side by side.
    pub scans: usize,
    /// Frames of a window, through which the gradient is propagated back.
    pub window: usize,
    /// Windows after which a scan is replaced by a new one.
    pub windows_a_scan: usize,
    /// Updates of the whole training.
    pub updates: u64,
    /// The optimiser and its learning rate.
    pub optimiser: Rule,
    /// Largest norm of the gradient; a larger gradient is scaled down to it.
    pub clip: f64,
    /// Share of the learning rate that is left at the end. It falls along a half cosine. 1: constant.
    pub final_rate: f64,
    /// Share of scans that differ from the reference in speed, spot, noise, exposure, lens.
    pub variety: f64,
    /// Share of scans on which the tracker's target is replaced now and then by a wrong one.
    pub wandering: f64,
}
