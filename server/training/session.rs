//! Scans for training, one after another, seen through a lens that may lag: what one of many side by side does.

use std::sync::Arc;

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use super::clip::Clip;
use super::scan::{Scan, Variety};
use crate::imaging::Patch;
use crate::lens::FocalPower;

/// One of the many scans that run side by side in training.
#[derive(Debug, Clone)]
pub struct Session {
    scan: Scan,
    focal_power: FocalPower,
    /// Share of the way to its target that the lens goes within a frame.
    response: f64,
    /// Whether this scan is one on which the policy is now and then led astray, so that it learns to come back.
    pub wanders: bool,
}

impl Session {
    /// A session on a scan drawn by `rng` from `clips`, which must not be empty.
    pub fn draw(clips: &[Arc<Clip>], variety: Variety, wandering: f64, rng: &mut ChaCha8Rng) -> Self {
        let clip = Arc::clone(&clips[rng.random_range(0..clips.len())]);
        let settings = variety.draw(rng);
        let scan = Scan::new(clip, settings, rng.random());
        let slow = rng.random_bool(0.4 * variety.share);
        let response = if slow { rng.random_range(0.4..1.0) } else { 1.0 };
        let wanders = rng.random_bool(wandering);
        let start = if rng.random_bool(0.5) { rng.random() } else { 0.5 };
        Self { scan, focal_power: FocalPower::nearest(start), response, wanders }
    }

    /// Where the lens stands.
    #[must_use]
    pub const fn focal_power(&self) -> FocalPower {
        self.focal_power
    }

    /// Where it should stand.
    #[must_use]
    pub fn optimum(&self) -> FocalPower {
        self.scan.optimum()
    }

    /// The patch of this frame.
    pub fn observe(&mut self) -> Patch {
        self.scan.observe(self.focal_power)
    }

    /// Sends the lens to `target` and goes on to the next frame.
    pub fn advance(&mut self, target: f64) {
        let step = FocalPower::nearest(target).get() - self.focal_power.get();
        self.focal_power = self.focal_power.moved(self.response * step);
        self.scan.advance();
    }
}

/// A target in the place of `target` where a wandering session is led astray: now and then, by up to 0.3.
pub fn lead_astray(target: f64, rng: &mut impl Rng) -> f64 {
    if rng.random_bool(0.04) { target + rng.random_range(-0.3..0.3) } else { target }
}
