//! What moves in every simulated scan: time, the optimal focal power, the crop, and the hand's tremor.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::settings::{ScanSettings, Scene};
use crate::scans::reach::corner;
use parfocal_devices::simulation::normal::standard_normal;
use parfocal_devices::simulation::walk::Walk;

/// The course of a scan. It depends only on the scan's seed.
#[derive(Debug, Clone)]
pub struct Course {
    /// Frames since the scan's clip or recording began.
    pub time: usize,
    /// The optimal focal power over scenes without a depth of their own.
    pub focus: Walk,
    /// Where the crop is; over followed stacks some frames ahead.
    pub crop: [Walk; 2],
    /// Blur by the hand's tremor, in pixels.
    pub tremor: f64,
    /// Factor on the picture's contrast.
    pub contrast: f64,
    /// Standard deviations of `tremor` and of the logarithm of `contrast`.
    strengths: (f64, f64),
    /// Every later part of the course is drawn from this.
    pub random: ChaCha8Rng,
}

impl Course {
    /// A course over `scene`, with the blur over flat scenes in pixels a unit of focal power.
    pub fn draw(scene: &Scene, settings: &ScanSettings, seed: u64) -> (Self, f64) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let blur = random.random_range(settings.blur.0..=settings.blur.1);
        let focus = Walk::new((0.0, 1.0), settings.focus, &mut random);
        let crop = scene.room().map(|room| Walk::new(room, settings.crop, &mut random));
        let time = scene.frames().map_or(0, |frames| random.random_range(0..2 * frames));

        let strengths = (settings.tremor, settings.flicker);
        let mut course = Self { time, focus, crop, tremor: 0.0, contrast: 1.0, strengths, random };
        course.shake();
        (course, blur)
    }

    /// Where the crop's corner lies.
    pub fn corner(&self) -> (f64, f64) {
        corner(&self.crop)
    }

    /// Advances to the next frame.
    pub fn advance(&mut self) {
        self.time += 1;
        self.focus.advance(&mut self.random);
        self.crop.iter_mut().for_each(|walk| walk.advance(&mut self.random));
        self.shake();
    }

    /// Draws this frame's tremor and contrast.
    fn shake(&mut self) {
        self.tremor = self.strengths.0 * standard_normal(&mut self.random);
        self.contrast = (self.strengths.1 * standard_normal(&mut self.random)).exp();
    }
}
