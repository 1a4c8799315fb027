//! Focal-time scans: a scene over time, seen at any focal power, with the optimum known at every
//! frame. Simulated, recorded at a bench, or made from a focal stack.

pub mod bench;
pub mod benchmark;
pub mod clip;
pub mod detail;
pub mod footage;
pub mod mosaics;
mod photography;
pub mod pictures;
pub mod planes;
mod reach;
pub mod recorded;
pub mod recording;
pub mod relief;
pub mod scenery;
pub mod simulated;
pub mod stack;
pub mod variety;

use parfocal_base::FocalPower;
use parfocal_imaging::{Patch, View};

/// A focal-time scan that a policy can be run on, frame by frame.
pub trait FocalTimeScan {
    /// What the camera sees at this frame through a lens at `focal_power`; the patch has whole gray levels, 0..=255.
    fn observe(&mut self, focal_power: FocalPower) -> View;

    /// The patch of what [`FocalTimeScan::observe`] shows, without what lies around it.
    fn patch(&mut self, focal_power: FocalPower) -> Patch {
        self.observe(focal_power).patch
    }

    /// The optimal focal power at this frame.
    fn optimum(&self) -> FocalPower;

    /// Advances to the next frame; at the last one it may stay.
    fn advance(&mut self);
}

/// Several focal-time scans on which a policy is evaluated.
pub trait ScanSet: Sync {
    /// Number of scans.
    fn count(&self) -> usize;

    /// Scan `index`, from 0, at its beginning, and the number of its frames.
    fn scan(&self, index: usize) -> (Box<dyn FocalTimeScan>, usize);

    /// Number of stretches into which each scan is cut for confidence intervals and tests. These need many independent
    /// figures.
    fn parts(&self) -> usize {
        1
    }
}
