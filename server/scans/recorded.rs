//! Recorded focal-time scans, ready to be replayed: at each pose one patch for each of some discrete focal powers.

use std::sync::Arc;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::autofocus::mgm;
use crate::camera::recorded::{Pose, ScanError, ScanFolder};
use crate::imaging::{Calibration, GrayImage, MosaicFrame, PATCH_SIDE, Patch, PatchArea, Reconstructor};
use crate::lens::FocalPower;
use crate::scans::FocalTimeScan;
use crate::scans::ScanSet;
use crate::simulation::phantom::{Haste, SENSOR_HEIGHT, SENSOR_WIDTH, Still, Trajectory};

/// Poses of the paper's robotic scan.
pub const POSES: usize = 1184;
/// Focal powers at each pose: as far apart as the paper's step.
pub const FOCAL_POWERS: usize = 21;
/// How the hand moves over the phantom; `benches/calibrate_recorded.rs` tells how it was chosen.
pub const HASTE: Haste = Haste { sideways: 40.0, focus: 3.0 };
/// Stretches that a replay is cut into for intervals and tests: 74 poses each of [`POSES`].
pub const PARTS: usize = 16;

const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;

/// What is shown between two recorded focal powers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// The picture taken at the nearest focal power.
    #[default]
    Nearest,
    /// A mix of the two neighbours', by distance.
    Interpolated,
}

/// A recorded scan's patches.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedScan {
    powers: Vec<FocalPower>,
    poses: Vec<Stack>,
}

/// What is known of one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Stack {
    /// The focal power at which the patch is sharpest.
    pub optimum: FocalPower,
    /// One patch for each focal power, in rising order.
    pub patches: Vec<Box<[u8; PIXELS]>>,
}

impl Stack {
    /// A stack whose optimum is found by global search: the focal power whose patch has the greatest mean gradient
    /// magnitude (Budd et al., MICCAI 2023).
    #[must_use]
    pub fn new(powers: &[FocalPower], patches: Vec<Box<[u8; PIXELS]>>) -> Self {
        let metrics = powers.iter().zip(&patches).map(|(&power, patch)| (power, mgm(&as_patch(patch))));
        let best = metrics.max_by(|a, b| a.1.total_cmp(&b.1));
        Self { optimum: best.map_or(FocalPower::MIDDLE, |(power, _)| power), patches }
    }
}

/// `count` focal powers evenly spread over the lens's range, at least 2.
#[must_use]
pub fn evenly_spread(count: usize) -> Vec<FocalPower> {
    let last = count.max(2) - 1;
    (0..=last).map(|index| FocalPower::nearest(index as f64 / last as f64)).collect()
}

/// Positions `0..count` in the random order in which pose `pose` (from 0) of the scan of `seed` takes its focal powers, so
/// that a lens's hysteresis favours none.
#[must_use]
pub fn capture_order(seed: u64, pose: usize, count: usize) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((1 << 33) + pose as u64);
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut rng);
    order
}

impl RecordedScan {
    /// A scan of `poses`, each with a patch for each of `powers`, which rise.
    #[must_use]
    pub const fn new(powers: Vec<FocalPower>, poses: Vec<Stack>) -> Self {
        Self { powers, poses }
    }

    /// Reads a scan's patches from its folder, checking every picture. `progress` is told after each pose.
    ///
    /// # Errors
    /// When poses are missing, or a picture is damaged.
    pub fn read(folder: &ScanFolder, progress: &(dyn Fn() + Sync)) -> Result<Self, ScanError> {
        let powers = folder.header().focal_powers.clone();
        let poses: Vec<_> = folder.clone().whole()?.poses().values().cloned().collect();
        let read = |pose: Pose| {
            let mut images = pose.images.clone();
            images.sort_by(|a, b| a.focal_power.get().total_cmp(&b.focal_power.get()));
            let patch = |image| folder.picture(&pose, image).map(|p| Box::new(levels_at(&p, pose.patch_area())));
            let patches = images.iter().map(patch).collect::<Result<_, _>>()?;
            progress();
            Ok(Stack { optimum: pose.optimum, patches })
        };
        let poses = poses.into_par_iter().map(read).collect::<Result<_, ScanError>>()?;
        Ok(Self { powers, poses })
    }

    /// The scan of a hand-held trajectory over the phantom, as `parfocal scan record` would store it, of which only the
    /// patches are made. `progress` is told after each pose.
    #[must_use]
    pub fn phantom(trajectory: &Trajectory, seed: u64, powers: usize, progress: &(dyn Fn() + Sync)) -> Self {
        let powers = evenly_spread(powers);
        let reconstructor = Reconstructor::new(&Calibration::default());
        let still = |samples: &mut Vec<u16>, pose| {
            let still = trajectory.still(pose)?;
            let stack = frozen(&still, &reconstructor, samples, (&powers, &capture_order(seed, pose, powers.len())));
            progress();
            Some(stack)
        };
        let blank = || vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
        let poses = (0..trajectory.len()).into_par_iter().map_init(blank, still).flatten().collect();
        Self { powers, poses }
    }

    /// The poses.
    #[must_use]
    pub fn poses(&self) -> &[Stack] {
        &self.poses
    }

    /// What is seen at pose `index` (the last, beyond it) through a lens at `focal_power`.
    #[must_use]
    pub fn see(&self, index: usize, focal_power: FocalPower, between: Between) -> Patch {
        let Some(pose) = self.poses.get(index).or(self.poses.last()) else { return Patch([0.0; PIXELS]) };
        let above = self.powers.partition_point(|&power| power <= focal_power).clamp(1, self.powers.len() - 1);
        let (low, high) = (self.powers[above - 1], self.powers[above]);
        let part = (low.distance(focal_power) / low.distance(high)).min(1.0);
        match between {
            Between::Nearest => as_patch(&pose.patches[if part < 0.5 { above - 1 } else { above }]),
            Between::Interpolated => mixed(&pose.patches[above - 1], &pose.patches[above], part),
        }
    }
}

/// The stack of one pose of the phantom, its exposures numbered by the order in which they are taken.
fn frozen(
    still: &Still,
    reconstructor: &Reconstructor,
    samples: &mut Vec<u16>,
    (powers, order): (&[FocalPower], &[usize]),
) -> Stack {
    let mut patches = vec![Box::new([0; PIXELS]); powers.len()];
    for (number, &position) in (0..).zip(order) {
        still.expose_patch(number, powers[position], samples);
        // The size is the sensor's own.
        let Ok(mosaic) = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, std::mem::take(samples)) else { continue };
        *patches[position] = as_levels(&reconstructor.gray_patch(&mosaic, still.patch()));
        *samples = mosaic.into_samples();
    }
    Stack::new(powers, patches)
}

/// The patch of a gray picture at `area`, rounded; black where `area` leaves the picture.
#[must_use]
pub fn levels_at(picture: &GrayImage, area: PatchArea) -> [u8; PIXELS] {
    std::array::from_fn(|i| {
        let (x, y) = (area.x + i % PATCH_SIDE, area.y + i / PATCH_SIDE);
        let value = if x < picture.width { picture.data.get(y * picture.width + x) } else { None };
        value.map_or(0, |value| value.round() as u8)
    })
}

/// Gray levels as a patch.
#[must_use]
pub fn as_patch(levels: &[u8; PIXELS]) -> Patch {
    Patch(levels.map(f32::from))
}

/// Rounded; what is beyond 0..=255 becomes its end.
fn as_levels(patch: &Patch) -> [u8; PIXELS] {
    patch.0.map(|value| value.round() as u8)
}

fn mixed(low: &[u8; PIXELS], high: &[u8; PIXELS], part: f64) -> Patch {
    let part = part as f32;
    Patch(std::array::from_fn(|i| (f32::from(low[i]) + part * (f32::from(high[i]) - f32::from(low[i]))).round()))
}

/// A recorded scan being replayed, a pose a frame; at the last one it stays.
#[derive(Debug, Clone)]
pub struct Playing {
    scan: Arc<RecordedScan>,
    between: Between,
    pose: usize,
}

impl FocalTimeScan for Playing {
    fn observe(&mut self, focal_power: FocalPower) -> Patch {
        self.scan.see(self.pose, focal_power, self.between)
    }

    fn optimum(&self) -> FocalPower {
        self.scan.poses.get(self.pose).map_or(FocalPower::MIDDLE, |pose| pose.optimum)
    }

    fn advance(&mut self) {
        self.pose = (self.pose + 1).min(self.scan.poses.len() - 1);
    }
}

/// Recorded scans to evaluate on.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// The scans, each of at least one pose.
    pub scans: Vec<Arc<RecordedScan>>,
    /// What is shown between two focal powers.
    pub between: Between,
}

impl ScanSet for Recorded {
    fn count(&self) -> usize {
        self.scans.len()
    }

    fn scan(&self, index: usize) -> (Box<dyn FocalTimeScan>, usize) {
        let scan = Arc::clone(&self.scans[index]);
        let frames = scan.poses.len();
        (Box::new(Playing { scan, between: self.between, pose: 0 }), frames)
    }

    fn parts(&self) -> usize {
        PARTS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One pose at focal powers 0, 0.5 and 1 whose patches are even: 0, 100 and 200.
    fn ramp() -> RecordedScan {
        let patches = [0, 100, 200].map(|level| Box::new([level; PIXELS])).to_vec();
        RecordedScan::new(evenly_spread(3), vec![Stack { optimum: FocalPower::MIDDLE, patches }])
    }

    #[test]
    #[allow(clippy::float_cmp, reason = "whole gray levels")]
    fn between_two_focal_powers_the_nearest_or_a_mix_is_seen() {
        let seen = |power, between| ramp().see(0, FocalPower::nearest(power), between).0[500];
        for (power, nearest, mixed) in [
            (0.0, 0.0, 0.0),
            (0.2, 0.0, 40.0),
            (0.3, 100.0, 60.0),
            (0.5, 100.0, 100.0),
            (0.9, 200.0, 180.0),
            (1.0, 200.0, 200.0),
        ] {
            assert_eq!(seen(power, Between::Nearest), nearest, "{power}");
            assert_eq!(seen(power, Between::Interpolated), mixed, "{power}");
        }
    }

    #[test]
    fn the_optimum_is_where_the_gradient_is_greatest() {
        let stripes = |contrast: u8| Box::new(std::array::from_fn(|i| if i % 4 < 2 { 100 } else { 100 + contrast }));
        let stack = Stack::new(&evenly_spread(5), [10, 30, 90, 60, 20].map(stripes).to_vec());
        assert_eq!(stack.optimum, FocalPower::MIDDLE);
    }

    #[test]
    fn every_focal_power_is_taken_once_and_in_another_order_at_another_pose() {
        let (first, second) = (capture_order(1, 0, 21), capture_order(1, 1, 21));
        assert_ne!(first, second);
        assert_eq!(capture_order(1, 0, 21), first);
        let mut sorted = first;
        sorted.sort_unstable();
        assert_eq!(sorted, (0..21).collect::<Vec<_>>());
    }
}
