//! Recorded focal-time scans, ready to be replayed: each pose has one view for each of several discrete focal powers.

use std::sync::Arc;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::scans::FocalTimeScan;
use crate::scans::ScanSet;
use crate::scans::clip::to_and_fro;
use crate::scans::stack::cropped;
use parfocal_autofocus::mgm;
use parfocal_base::FocalPower;
use parfocal_devices::camera::recorded::{Pose, ScanError, ScanFolder};
use parfocal_devices::simulation::phantom::{Haste, SENSOR_HEIGHT, SENSOR_WIDTH, Still, Trajectory};
use parfocal_imaging::{
    GrayImage, MosaicFrame, PATCH_SIDE, Patch, PatchArea, Reconstructor, Square, Surroundings, View, WIDER,
};

/// Poses of the paper's robotic scan.
pub const POSES: usize = 1184;
/// Focal powers at each pose. They are as far apart as the paper's step.
pub const FOCAL_POWERS: usize = 21;
/// How the hand moves over the phantom; `benches/calibrate_recorded/main.rs` says how it was chosen.
pub const HASTE: Haste = Haste { sideways: 40.0, focus: 3.0 };
/// Stretches into which a replay is cut for confidence intervals and tests: with [`POSES`], 74 poses each.
pub const PARTS: usize = 16;

const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;

/// What is shown between two recorded focal powers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// The picture taken at the nearest focal power.
    #[default]
    Nearest,
    /// A mix of the two neighbouring pictures, by distance.
    Interpolated,
}

/// What is kept in memory of each picture of a recorded scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// The patch and the wider ones: 5 KB.
    Patches,
    /// The patch's surroundings as well: 21 KB, which makes 0.5 GB of a scan of [`POSES`] poses.
    Surroundings,
}

/// A recorded scan's patches.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedScan {
    powers: Vec<FocalPower>,
    poses: Vec<Stack>,
}

/// One pose: its patches, and where it is sharpest.
#[derive(Debug, Clone, PartialEq)]
pub struct Stack {
    /// The focal power at which the patch is sharpest.
    pub optimum: FocalPower,
    /// One patch for each focal power, in rising order.
    patches: Vec<[u8; PIXELS]>,
    /// The wider patches for each focal power; empty if only patches are known.
    wider: Vec<[Option<Coarse>; WIDER.len()]>,
    /// The surroundings for each focal power; empty if they are not kept.
    surroundings: Vec<Option<Around>>,
}

/// A patch's [`Surroundings`], in whole gray levels.
#[derive(Debug, Clone, PartialEq)]
struct Around {
    levels: Box<[u8]>,
    patch: (usize, usize),
}

impl Around {
    fn of(surroundings: &Surroundings) -> Self {
        let levels = surroundings.levels.iter().map(|value| value.round() as u8).collect();
        Self { levels, patch: surroundings.patch }
    }

    fn mixed(&self, high: &Self, part: f32) -> Surroundings {
        let pairs = self.levels.iter().zip(&high.levels);
        let levels = pairs.map(|(low, high)| mixed_level(*low, *high, part)).collect();
        Surroundings { levels, patch: self.patch }
    }
}

/// A wider patch, in steps of 1/256 of a gray level. Its values are means, so they are finer than whole levels.
#[derive(Debug, Clone, PartialEq)]
struct Coarse(Box<[u16; PIXELS]>);

impl Coarse {
    fn of(patch: &Patch) -> Self {
        Self(Box::new(patch.0.map(|value| (256.0 * value).round() as u16)))
    }

    fn patch(&self) -> Patch {
        Patch(self.0.map(|value| f32::from(value) / 256.0))
    }

    fn mixed(&self, high: &Self, part: f32) -> Patch {
        let low = self.patch();
        let high = high.patch();
        Patch(std::array::from_fn(|i| low.0[i] + part * (high.0[i] - low.0[i])))
    }
}

impl Stack {
    /// A stack of what is `kept` of `views`, one for each focal power in rising order.
    pub(super) fn of(views: &[View], optimum: FocalPower, kept: Kept) -> Self {
        let patches = views.iter().map(|view| view.patch.0.map(|value| value.round() as u8)).collect();
        let coarse = |view: &View| view.wider.each_ref().map(|patch| patch.as_ref().map(Coarse::of));
        let around = |view: &View| view.surroundings.as_ref().map(Around::of);
        let surroundings = if kept == Kept::Surroundings { views.iter().map(around).collect() } else { Vec::new() };
        Self { optimum, patches, wider: views.iter().map(coarse).collect(), surroundings }
    }
}

/// The optimum by global search: the focal power whose patch has the greatest mean gradient magnitude (Budd et al.,
/// MICCAI 2023). `patches` holds one for each of `powers`.
pub fn sharpest(powers: &[FocalPower], patches: impl Iterator<Item = Patch>) -> FocalPower {
    let metrics = powers.iter().zip(patches).map(|(&power, patch)| (power, mgm(&patch)));
    let best = metrics.max_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or(FocalPower::MIDDLE, |(power, _)| power)
}

/// `count` focal powers evenly spread over the lens's range, at least 2.
pub fn evenly_spread(count: usize) -> Vec<FocalPower> {
    let last = count.max(2) - 1;
    (0..=last).map(|index| FocalPower::nearest(index as f64 / last as f64)).collect()
}

/// The indices `0..count` of the focal powers, in the order in which pose `pose` (from 0) takes them. The order is
/// random, drawn from `seed`, so that a lens's hysteresis favours no focal power.
pub fn capture_order(seed: u64, pose: usize, count: usize) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((1 << 33) + pose as u64);
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut rng);
    order
}

impl RecordedScan {
    /// A scan of `poses`, each with a patch for each of `powers`. These must rise.
    pub const fn new(powers: Vec<FocalPower>, poses: Vec<Stack>) -> Self {
        Self { powers, poses }
    }

    /// Reads what is `kept` of a scan from its folder, checking every picture. `progress` is called after each
    /// pose.
    ///
    /// # Errors
    /// If poses are missing, or a picture is damaged.
    pub fn read(folder: &ScanFolder, kept: Kept, progress: &(dyn Fn() + Sync)) -> Result<Self, ScanError> {
        let powers = folder.header().focal_powers.clone();
        let poses: Vec<_> = folder.clone().whole()?.poses().values().cloned().collect();

        let read = |pose: Pose| {
            let mut images = pose.images.clone();
            images.sort_by(|a, b| a.focal_power.get().total_cmp(&b.focal_power.get()));
            let area = pose.patch_area();
            let view = |image| folder.picture(&pose, image).map(|picture| gray_view(&picture, area));
            let views = images.iter().map(view).collect::<Result<Vec<_>, _>>()?;
            progress();
            Ok(Stack::of(&views, pose.optimum, kept))
        };

        let poses = poses.into_par_iter().map(read).collect::<Result<_, ScanError>>()?;
        Ok(Self { powers, poses })
    }

    /// The scan of a hand-held trajectory over the phantom, as `parfocal scan record` would store it. Makes only
    /// what is `kept`. `progress` is called after each pose.
    pub fn phantom(
        trajectory: &Trajectory,
        seed: u64,
        powers: usize,
        kept: Kept,
        progress: &(dyn Fn() + Sync),
    ) -> Self {
        let powers = evenly_spread(powers);
        let reconstructor = Reconstructor::default();

        let still = |samples: &mut Vec<u16>, pose| {
            let still = trajectory.still(pose)?;
            let order = capture_order(seed, pose, powers.len());
            let stack = frozen(&still, &reconstructor, samples, (&powers, &order), kept);
            progress();
            Some(stack)
        };

        let blank = || vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
        let poses = (0..trajectory.len()).into_par_iter().map_init(blank, still).flatten().collect();
        Self { powers, poses }
    }

    /// The poses.
    pub fn poses(&self) -> &[Stack] {
        &self.poses
    }

    /// The optimum at pose `index`; beyond the last pose, that of the last.
    pub fn optimum(&self, index: usize) -> FocalPower {
        self.poses.get(index).or(self.poses.last()).map_or(FocalPower::MIDDLE, |pose| pose.optimum)
    }

    /// The pose at frame `time` of an endless replay that runs forwards and backwards.
    pub fn pose_at(&self, time: usize) -> usize {
        to_and_fro(time, self.poses.len())
    }

    /// Adds the focal powers, the patches and the wider patches to `hash`. The surroundings are left out; they are cut
    /// from the same pictures.
    pub(crate) fn digest(&self, hash: &mut Sha256) {
        hash.update((self.poses.len() as u64).to_le_bytes());
        self.powers.iter().for_each(|power| hash.update(power.get().to_le_bytes()));
        for pose in &self.poses {
            pose.patches.iter().for_each(|patch| hash.update(patch.as_slice()));
            for coarse in pose.wider.iter().flatten().flatten() {
                let bytes: Vec<u8> = coarse.0.iter().flat_map(|value| value.to_le_bytes()).collect();
                hash.update(bytes);
            }
        }
    }

    /// What is seen at pose `index` through a lens at `focal_power`; beyond the last pose, at the last.
    pub fn see(&self, index: usize, focal_power: FocalPower, between: Interpolation) -> View {
        let Some(pose) = self.poses.get(index).or(self.poses.last()) else { return Patch([0.0; PIXELS]).into() };
        let above = self.powers.partition_point(|&power| power <= focal_power).clamp(1, self.powers.len() - 1);
        let low = self.powers[above - 1];
        let high = self.powers[above];
        let part = (low.distance(focal_power) / low.distance(high)).min(1.0);
        let nearest = if part < 0.5 { above - 1 } else { above };

        // The nearest picture alone is a mix of it with itself.
        let (low, high, part) = match between {
            Interpolation::Nearest => (nearest, nearest, 0.0),
            Interpolation::Interpolated => (above - 1, above, part as f32),
        };

        let pair = (&pose.patches[low], &pose.patches[high]);
        let patch = Patch(std::array::from_fn(|i| mixed_level(pair.0[i], pair.1[i], part)));

        let coarse = |position: usize, index: usize| pose.wider.get(position)?[index].as_ref();
        let wider = |index: usize| Some(coarse(low, index)?.mixed(coarse(high, index)?, part));

        let around = |position: usize| pose.surroundings.get(position)?.as_ref();
        let surroundings = around(low).zip(around(high)).map(|(low, high)| low.mixed(high, part));

        View { patch, wider: std::array::from_fn(wider), surroundings }
    }
}

/// The stack of one pose of the phantom. Its exposures are numbered in the order in which they are taken.
fn frozen(
    still: &Still,
    reconstructor: &Reconstructor,
    samples: &mut Vec<u16>,
    (powers, order): (&[FocalPower], &[usize]),
    kept: Kept,
) -> Stack {
    let mut views = vec![View::from(Patch([0.0; PIXELS])); powers.len()];

    for (number, &position) in (0..).zip(order) {
        still.expose_view(number, powers[position], samples);

        // Cannot fail: the size is the sensor's own.
        let Ok(mosaic) = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, std::mem::take(samples)) else { continue };
        let mut picture = GrayImage { width: mosaic.band_width(), height: mosaic.band_height(), data: Vec::new() };
        picture.data.resize(picture.width * picture.height, 0.0);
        put_square(&mut picture, still.seen(), &reconstructor.gray_square(&mosaic, still.seen()));

        // As it would be stored: in whole gray levels.
        picture.data.iter_mut().for_each(|value| *value = value.round());
        views[position] = gray_view(&picture, still.patch());
        *samples = mosaic.into_samples();
    }

    Stack::of(&views, sharpest(powers, views.iter().map(|view| view.patch)), kept)
}

/// Writes `levels` into `square`, which must lie within `picture`.
pub(super) fn put_square(picture: &mut GrayImage, square: Square, levels: &[f32]) {
    let lines = picture.data.chunks_exact_mut(picture.width).skip(square.y);
    for (line, levels) in lines.zip(levels.chunks_exact(square.side)) {
        line[square.x..square.x + square.side].copy_from_slice(levels);
    }
}

/// The patch of a gray picture at `area`, in whole gray levels; black where `area` leaves the picture.
pub fn patch_at(picture: &GrayImage, area: PatchArea) -> Patch {
    Patch(std::array::from_fn(|i| {
        let x = area.x + i % PATCH_SIDE;
        let y = area.y + i / PATCH_SIDE;
        let value = if x < picture.width { picture.data.get(y * picture.width + x) } else { None };
        value.map_or(0.0, |value| f32::from(value.round() as u8))
    }))
}

/// What policies see of a gray picture with the patch at `area`: its patch has whole gray levels.
fn gray_view(picture: &GrayImage, area: PatchArea) -> View {
    View::around(patch_at(picture, area), (area.x, area.y), (picture.width, picture.height), |Square { x, y, side }| {
        cropped(picture, (x, y), (side, side)).data
    })
}

fn mixed_level(low: u8, high: u8, part: f32) -> f32 {
    let low = f32::from(low);
    (low + part * (f32::from(high) - low)).round()
}

/// A replay of a recorded scan, one pose a frame. It stays at the last pose.
#[derive(Debug, Clone)]
pub struct Playing {
    scan: Arc<RecordedScan>,
    between: Interpolation,
    pose: usize,
}

impl FocalTimeScan for Playing {
    fn observe(&mut self, focal_power: FocalPower) -> View {
        self.scan.see(self.pose, focal_power, self.between)
    }

    fn optimum(&self) -> FocalPower {
        self.scan.optimum(self.pose)
    }

    fn advance(&mut self) {
        self.pose = (self.pose + 1).min(self.scan.poses.len() - 1);
    }
}

/// Recorded scans to evaluate on.
#[derive(Debug, Clone)]
pub struct RecordedScans {
    /// The scans, each of at least one pose.
    pub scans: Vec<Arc<RecordedScan>>,
    /// What is shown between two focal powers.
    pub between: Interpolation,
}

impl ScanSet for RecordedScans {
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
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::{Scale, block_means};

    /// One pose at focal powers 0, 0.5 and 1 whose patches are even: 0, 100 and 200.
    fn ramp() -> RecordedScan {
        let views = [0.0, 100.0, 200.0].map(|level| View::from(Patch([level; PIXELS])));
        RecordedScan::new(evenly_spread(3), vec![Stack::of(&views, FocalPower::MIDDLE, Kept::Patches)])
    }

    #[test]
    #[allow(clippy::float_cmp, reason = "whole gray levels")]
    fn between_two_focal_powers_the_nearest_or_a_mix_is_seen() {
        let seen = |power, between| ramp().see(0, FocalPower::nearest(power), between).patch.0[500];
        for (power, nearest, mixed) in [
            (0.0, 0.0, 0.0),
            (0.2, 0.0, 40.0),
            (0.3, 100.0, 60.0),
            (0.5, 100.0, 100.0),
            (0.9, 200.0, 180.0),
            (1.0, 200.0, 200.0),
        ] {
            assert_eq!(seen(power, Interpolation::Nearest), nearest, "{power}");
            assert_eq!(seen(power, Interpolation::Interpolated), mixed, "{power}");
        }
    }

    #[test]
    fn wider_patches_are_those_of_the_picture_and_mixed_as_the_patch_is() {
        let picture = |seed| texture(seed, 128);
        let area = PatchArea { x: 48, y: 48, width: 32, height: 32 };
        let views = [1, 2].map(|seed| gray_view(&picture(seed), area));
        let stack = Stack::of(&views, FocalPower::MIDDLE, Kept::Surroundings);
        let scan = RecordedScan::new(evenly_spread(2), vec![stack]);

        let expected = [1, 2].map(|seed| {
            let data = &picture(seed).data;
            [block_means(&data[32 * 128 + 32..], 128, Scale::Two), block_means(data, 128, Scale::Four)]
        });
        for (power, between, share) in [(0.3, Interpolation::Nearest, 0.0), (0.25, Interpolation::Interpolated, 0.25)] {
            let seen = scan.see(0, FocalPower::nearest(power), between);
            for (index, patch) in seen.wider.into_iter().enumerate() {
                let [low, high] = expected.each_ref().map(|patches| &patches[index]);
                for (i, found) in patch.unwrap().0.into_iter().enumerate() {
                    let mixed = low.0[i] + share * (high.0[i] - low.0[i]);
                    assert!((found - mixed).abs() < 0.01, "{index}, {i}: {found} {mixed}");
                }
            }

            let around = seen.surroundings.unwrap();
            let levels = [1, 2].map(|seed| picture(seed).data.iter().map(|value| value.round()).collect::<Vec<_>>());
            assert_eq!(around.patch, (48, 48));
            for (i, found) in around.levels.iter().enumerate() {
                let mixed = levels[0][i] + share * (levels[1][i] - levels[0][i]);
                assert!((found - mixed).abs() <= 0.5, "{i}: {found} {mixed}");
            }
        }
    }

    #[test]
    fn the_optimum_is_where_the_gradient_is_greatest() {
        let stripes = |contrast: f32| Patch(std::array::from_fn(|i| if i % 4 < 2 { 100.0 } else { 100.0 + contrast }));
        let patches = [10.0, 30.0, 90.0, 60.0, 20.0].map(stripes);
        assert_eq!(sharpest(&evenly_spread(5), patches.into_iter()), FocalPower::MIDDLE);
    }

    #[test]
    fn every_focal_power_is_taken_once_and_in_another_order_at_another_pose() {
        let first = capture_order(1, 0, 21);
        let second = capture_order(1, 1, 21);
        assert_ne!(first, second);
        assert_eq!(capture_order(1, 0, 21), first);
        let mut sorted = first;
        sorted.sort_unstable();
        assert_eq!(sorted, (0..21).collect::<Vec<_>>());
    }
}
