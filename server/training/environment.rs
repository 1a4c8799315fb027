//! One of the environments that train side by side: scans, one after another, seen through a lens
//! that may lag.

use std::collections::VecDeque;

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use crate::autofocus::BlurRate;
use crate::imaging::{Patch, View};
use crate::lens::FocalPower;
use crate::scans::scenery::Scenery;
use crate::scans::simulated::Scan;
use crate::scans::variety::Variety;

/// Most frames by which a lens is late: at 50 frames a second 40 ms, more than one settles in (about
/// 15 ms) after the frame that decided was read out.
const MOST_DELAY: usize = 2;

/// One of the many scans that run side by side in training.
#[derive(Debug, Clone)]
pub struct Environment {
    scan: Scan,
    focal_power: FocalPower,
    /// Share of the way to its target that the lens goes within a frame.
    response: f64,
    /// The lens shows multiples of this alone, whatever it says: hysteresis, or a recorded scan's stack. 0: none.
    grid: f64,
    /// Targets on their way to the lens, oldest first: as many as the frames that exposure, transfer and settling take.
    under_way: VecDeque<f64>,
    /// Whether this scan is one on which the policy is now and then led astray, so that it learns to come back.
    pub wanders: bool,
}

impl Environment {
    /// An environment on a scan over a scene that `rng` draws from `scenery`.
    pub fn draw(scenery: &Scenery, variety: Variety, wandering: f64, rng: &mut ChaCha8Rng) -> Self {
        let scene = scenery.draw(rng);
        let settings = variety.draw(&scene, rng);
        let scan = Scan::over(scene, settings, rng.random());

        let slow = rng.random_bool(0.4 * variety.share);
        let response = if slow { rng.random_range(0.4..1.0) } else { 1.0 };

        let late = rng.random_bool(0.25 * variety.share);
        let delay = if late { rng.random_range(1..=MOST_DELAY) } else { 0 };

        let coarse = rng.random_bool(0.4 * variety.share);
        let grid = if coarse { rng.random_range(0.01..0.06) } else { 0.0 };

        let wanders = rng.random_bool(wandering);
        let start = if rng.random_bool(0.5) { rng.random() } else { 0.5 };
        let under_way = VecDeque::from(vec![start; delay]);
        Self { scan, focal_power: FocalPower::nearest(start), response, grid, under_way, wanders }
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

    /// How fast blur grows, where the scene has one rate.
    #[must_use]
    pub fn blur(&self) -> Option<BlurRate> {
        self.scan.blur()
    }

    /// The patch of this frame.
    pub fn observe(&mut self) -> Patch {
        self.scan.observe(self.shown())
    }

    /// The view of this frame.
    pub fn view(&mut self) -> View {
        self.scan.view(self.shown())
    }

    /// The focal power at which the frame is shown, where the lens says it stands or near that.
    fn shown(&self) -> FocalPower {
        let stands = self.focal_power.get();
        FocalPower::nearest(if self.grid > 0.0 { (stands / self.grid).round() * self.grid } else { stands })
    }

    /// Sends the lens to `target`, where it arrives some frames later if it is late, and advances to
    /// the next frame.
    pub fn advance(&mut self, target: f64) {
        self.under_way.push_back(target);
        let target = self.under_way.pop_front().unwrap_or(target);
        let step = FocalPower::nearest(target).get() - self.focal_power.get();
        self.focal_power = self.focal_power.moved(self.response * step);
        self.scan.advance();
    }
}

/// A target in the place of `target` where a wandering environment is led astray: now and then, by up to 0.3.
pub fn lead_astray(target: f64, rng: &mut impl Rng) -> f64 {
    if rng.random_bool(0.04) { target + rng.random_range(-0.3..0.3) } else { target }
}
