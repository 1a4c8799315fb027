//! One of the environments that train side by side: a simulated focal-time scan, seen through a lens that may lag.

use std::collections::VecDeque;

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use crate::scans::FocalTimeScan;
use crate::scans::scenery::Scenery;
use crate::scans::simulated::Scan;
use crate::scans::variety::Variety;
use parfocal_base::BlurRate;
use parfocal_base::FocalPower;
use parfocal_imaging::{Patch, View};

/// Largest lag of the lens, in frames. At 50 frames a second this is 40 ms. A real lens settles faster, in about 15 ms
/// after the frame that decided was read out.
const MOST_DELAY: usize = 2;

/// One of the scans that run side by side in training, with its lens.
#[derive(Debug, Clone)]
pub struct Environment {
    scan: Scan,
    focal_power: FocalPower,
    /// Share of the way to its target that the lens covers in one frame.
    response: f64,
    /// The picture is made at the multiple of this nearest to the focal power that the lens reports. It stands for
    /// hysteresis, or for the steps of a recorded focal stack. 0: no such rounding.
    grid: f64,
    /// Targets that have not reached the lens yet, oldest first. Their number is the delay in frames, which stands for
    /// exposure, transfer and settling.
    under_way: VecDeque<f64>,
    /// Whether the policy's target is replaced now and then by a wrong one, so that the policy learns to recover.
    pub wanders: bool,
}

impl Environment {
    /// Draws a scene from `scenery`, then a scan over it and a lens, all with `rng`.
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

    /// The focal power that the lens reports.
    pub const fn focal_power(&self) -> FocalPower {
        self.focal_power
    }

    /// The focal power at which the patch is in focus.
    pub fn optimum(&self) -> FocalPower {
        self.scan.optimum()
    }

    /// How fast blur grows with the focal power error; `None` if the scene has no known rate.
    pub fn blur(&self) -> Option<BlurRate> {
        self.scan.blur()
    }

    /// The patch of this frame.
    pub fn observe(&mut self) -> Patch {
        self.scan.patch(self.shown())
    }

    /// The patch of this frame and the wider ones around it; without surroundings.
    pub fn wide_view(&mut self) -> View {
        self.scan.wide_view(self.shown())
    }

    /// The view of this frame, with surroundings.
    pub fn view(&mut self) -> View {
        self.scan.observe(self.shown())
    }

    /// The focal power at which the picture is made: the reported one, rounded to the grid if there is one.
    fn shown(&self) -> FocalPower {
        let stands = self.focal_power.get();
        FocalPower::nearest(if self.grid > 0.0 { (stands / self.grid).round() * self.grid } else { stands })
    }

    /// Sends the lens to `target` and advances to the next frame. A lens that lags arrives some frames later.
    pub fn advance(&mut self, target: f64) {
        self.under_way.push_back(target);
        let target = self.under_way.pop_front().unwrap_or(target);
        let step = FocalPower::nearest(target).get() - self.focal_power.get();
        self.focal_power = self.focal_power.moved(self.response * step);
        self.scan.advance();
    }
}

/// Returns `target`, or with a probability of 4 % one that differs from it by up to 0.3. For environments that wander.
pub fn lead_astray(target: f64, rng: &mut impl Rng) -> f64 {
    if rng.random_bool(0.04) { target + rng.random_range(-0.3..0.3) } else { target }
}
