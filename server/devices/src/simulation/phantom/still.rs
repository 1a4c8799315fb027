//! Poses held still: a hand-held trajectory over the phantom. It stops at each of its poses for any number of
//! exposures, as an arm that replays a trajectory does.

use std::time::Duration;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::sensor::AutoExposure;
use super::view::{self, Mapping, Region};
use super::{Hand, Haste, Phantom, Pose};
use parfocal_base::FocalPower;
use parfocal_imaging::{PATCH_SIDE, PatchArea, Square, WIDER};

/// Seed of the first brain for recorded scans. Training and its benchmark use none of these brains.
const FIRST_BRAIN: u64 = 3 << 32;
/// Streams of the random source from here on belong to exposures of still poses.
const FIRST_STREAM: u64 = 1 << 32;
/// Time between two poses: 25 a second.
pub const INTERVAL: Duration = Duration::from_millis(40);
/// Cells between two points of metering, in both directions.
const METERED: usize = 7;

/// A phantom and the poses of a hand over it, evenly spaced in time.
pub struct Trajectory {
    phantom: Phantom,
    poses: Vec<Pose>,
    seed: u64,
}

impl Trajectory {
    /// The poses of the hand of `seed`, moving with `haste`, at `poses` moments [`INTERVAL`] apart.
    /// Takes about a fifth of a second.
    pub fn new(seed: u64, poses: usize, haste: Haste) -> Self {
        let brain = FIRST_BRAIN.wrapping_add(seed);
        let mut hand = Hand::moving(brain, haste);
        let mut time = Duration::ZERO;

        let poses = (0..poses).map(|_| {
            let pose = hand.pose_at(time);
            time += INTERVAL;
            pose
        });

        Self { poses: poses.collect(), phantom: Phantom::new(brain), seed: brain }
    }

    /// Number of poses.
    pub const fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no pose.
    pub const fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Pose `index`, from 0, held still; `None` beyond the last.
    pub fn still(&self, index: usize) -> Option<Still<'_>> {
        let pose = self.poses.get(index)?;
        let best = self.phantom.optimal(pose);
        let gain = self.phantom.settled_gain(pose, best);
        Some(Still { phantom: &self.phantom, pose, gain, seed: self.seed, index: index as u64, best })
    }
}

/// One pose held still. All its exposures have the same gain, at which auto-exposure settles there. Each has its own
/// noise, which depends only on its number.
pub struct Still<'a> {
    phantom: &'a Phantom,
    pose: &'a Pose,
    gain: f32,
    seed: u64,
    index: u64,
    best: FocalPower,
}

impl Still<'_> {
    /// The focal power at which the patch is sharpest: see [`Phantom::optimal`].
    pub const fn optimal(&self) -> FocalPower {
        self.best
    }

    /// The patch's place, in pixels of a band.
    pub fn patch(&self) -> PatchArea {
        let area = self.phantom.content_area();
        // The fallback is never used: the sensor is larger than a patch.
        PatchArea::central(view::WIDTH, view::HEIGHT, Some(&area)).unwrap_or(PatchArea {
            x: 0,
            y: 0,
            width: PATCH_SIDE,
            height: PATCH_SIDE,
        })
    }

    /// Exposure `number` of this pose (below 2^16), at `focal_power`, into `samples`; see [`Phantom::expose`].
    pub fn expose(&self, number: u16, focal_power: FocalPower, samples: &mut [u16]) {
        self.render(number, focal_power, &Region::WHOLE, samples);
    }

    /// The square that the widest patch of the policies covers, in pixels of a band.
    pub fn seen(&self) -> Square {
        let PatchArea { x, y, width, .. } = self.patch();
        let widest = WIDER[WIDER.len() - 1];
        // The fallback is never used: the sensor is larger than the widest patch too.
        Square::around((x, y), widest, (view::WIDTH, view::HEIGHT)).unwrap_or(Square { x, y, side: width })
    }

    /// Makes the same exposure, but only the samples of [`Still::seen`].
    pub fn expose_view(&self, number: u16, focal_power: FocalPower, samples: &mut [u16]) {
        let Square { x, y, side } = self.seen();
        self.render(number, focal_power, &Region { columns: x..x + side, rows: y..y + side }, samples);
    }

    fn render(&self, number: u16, focal_power: FocalPower, region: &Region, samples: &mut [u16]) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(FIRST_STREAM + (self.index << 16) + u64::from(number));

        let noise = self.phantom.sensor.noise_of(&mut rng);
        self.phantom.render((self.pose, focal_power), self.gain, &noise, region, samples);
    }
}

impl Phantom {
    /// The gain at which auto-exposure settles at a pose, metered without noise at every [`METERED`]th
    /// cell.
    fn settled_gain(&self, pose: &Pose, focal_power: FocalPower) -> f32 {
        let mapping = Mapping::new(&self.optics, pose);
        let surface = (&self.stack, &self.relief);
        let mut counts = Vec::new();

        for y in (0..view::HEIGHT).step_by(METERED) {
            for x in self.optics.span(y).step_by(METERED) {
                let light = view::look_at(x, y, &self.optics, &mapping, surface, focal_power.get() as f32);
                counts.extend(self.bands.counts(light));
            }
        }

        AutoExposure::settled(counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::phantom::{SENSOR_HEIGHT, SENSOR_WIDTH};
    use parfocal_imaging::{MosaicFrame, Reconstructor};

    #[test]
    fn a_view_alone_equals_that_of_the_whole_exposure() {
        let trajectory = Trajectory::new(1, 2, Haste::default());
        let still = trajectory.still(1).unwrap();
        let reconstructor = Reconstructor::default();

        let seen = |whole: bool| {
            let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
            let power = FocalPower::nearest(0.3);
            if whole {
                still.expose(3, power, &mut samples);
            } else {
                still.expose_view(3, power, &mut samples);
            }

            let mosaic = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, samples).unwrap();
            reconstructor.gray_view(&mosaic, still.patch())
        };

        assert!(seen(true) == seen(false));
    }

    #[test]
    fn a_still_has_the_exposure_at_which_auto_exposure_settles() {
        let mut phantom = Phantom::new(5);
        let pose = Hand::new(5).pose_at(Duration::from_secs(2));
        let best = phantom.optimal(&pose);

        let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
        for _ in 0..40 {
            phantom.expose(&pose, best, &mut samples);
            phantom.adjust_exposure(&samples);
        }

        let settled = phantom.settled_gain(&pose, best);
        let rested = phantom.exposure.gain();
        assert!((settled / rested - 1.0).abs() < 0.08, "{settled} {rested}");
    }

    #[test]
    fn every_exposure_has_its_own_noise_and_the_same_one_the_same() {
        let trajectory = Trajectory::new(1, 1, Haste::default());
        let still = trajectory.still(0).unwrap();

        let seen = |number| {
            let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
            still.expose_view(number, still.optimal(), &mut samples);
            samples
        };

        assert!(seen(0) == seen(0) && seen(0) != seen(1));
    }
}
