//! How the belief tracker is trained: what a recipe's `[belief]` section holds.

use serde::{Deserialize, Serialize};

use crate::training::optimiser::Rule;

/// How a belief tracker is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeliefRecipe {
    /// Scans side by side.
    pub scans: usize,
    /// Frames that a gradient goes back.
    pub window: usize,
    /// Windows until a scan is replaced by another.
    pub windows_a_scan: usize,
    /// Updates in all.
    pub updates: u64,
    /// Optimiser.
    pub optimiser: Rule,
    /// Largest norm of a gradient.
    pub clip: f64,
    /// Share of the learning rate that is left at the end; the way there is a half cosine.
    pub final_rate: f64,
    /// Share of scans that differ from the reference in speed, spot, noise, exposure, lens.
    pub variety: f64,
    /// Share of scans on which the tracker is led astray.
    pub wandering: f64,
}
