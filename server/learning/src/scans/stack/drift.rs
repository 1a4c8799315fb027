//! Focal-time scans over photographed focal stacks: a window drifts over a still scene while the sharpest plane walks
//! through the range, so that a policy sees real pictures, or mixes of two neighbouring ones.
//!
//! The optimum's focal power and the window walk as in simulated scans. At each frame, `planes` neighbouring pictures
//! of the stack become the range 0..=1. They are chosen so that the plane in which the middle patch is sharpest
//! (smoothed over frames) lies at the walking focal power, as nearly as the stack allows. The true optimum is where the
//! patch's mean gradient magnitude peaks.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scans::FocalTimeScan;
use crate::scans::ScanSet;
use crate::scans::planes::PlaneStack;
use parfocal_autofocus::mgm;
use parfocal_base::FocalPower;
use parfocal_devices::simulation::gaussian::smoothed;
use parfocal_devices::simulation::walk::{Motion, Walk};
use parfocal_imaging::{PATCH_SIDE, Patch, View};

/// Frames of a scan: 20 s at 25 a second.
pub const FRAMES: usize = 500;
/// Side of the window that drifts over the stack, in pixels; the patch is its middle.
const WINDOW: usize = 128;
/// How a window drifts along each axis: 5 pixels a frame in all.
pub(in crate::scans) const DRIFT: Motion = Motion { speed: 3.535_533_905_932_737_7, memory: 30.0 };
/// How the optimum's focal power walks.
pub(in crate::scans) const FOCUS: Motion = Motion { speed: 0.012, memory: 60.0 };
/// Range of that walk.
pub(in crate::scans) const FOCUS_RANGE: (f64, f64) = (0.03, 0.97);
/// Standard deviation, in frames, with which the sharpest plane is smoothed before the range is placed around it.
pub(in crate::scans) const SMOOTHING: f64 = 12.0;

/// One scan over a focal stack, prepared: where the patch lies and which planes make the range, frame by frame.
#[derive(Debug)]
pub struct StackCourse {
    stack: Arc<PlaneStack>,
    planes: usize,
    frames: Vec<Moment>,
}

/// One frame of a [`StackCourse`].
#[derive(Debug, Clone, Copy)]
struct Moment {
    corner: (usize, usize),
    first_plane: usize,
    optimum: FocalPower,
}

impl StackCourse {
    /// A course over `stack`, drawn from `seed`. The stack's positions count its planes from 0, and `planes` of them
    /// are the range. `None` if `planes` is below 3, the stack has fewer planes, or it is smaller than the window of
    /// 128 pixels.
    pub fn new(stack: Arc<PlaneStack>, planes: usize, seed: u64) -> Option<Self> {
        let (width, height) = stack.size();
        let available = stack.range().1 as usize + 1;
        if planes < 3 || available < planes || width < WINDOW || height < WINDOW {
            return None;
        }

        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut walk = |range: (f64, f64), motion: Motion, start: Option<f64>| -> Vec<f64> {
            let start = start.unwrap_or_else(|| rng.random_range(range.0..=range.1));
            let mut walk = Walk::starting(start, range, motion, &mut rng);
            let step = |_| {
                let position = walk.position();
                walk.advance(&mut rng);
                position
            };
            (0..FRAMES).map(step).collect()
        };

        let margin = ((WINDOW - PATCH_SIDE) / 2) as f64;
        let down = walk((0.0, (height - WINDOW) as f64), DRIFT, None);
        let along = walk((0.0, (width - WINDOW) as f64), DRIFT, None);
        let focus = walk(FOCUS_RANGE, FOCUS, Some(0.5));

        let corners: Vec<(usize, usize)> = along
            .iter()
            .zip(&down)
            .map(|(x, y)| ((x.floor() + margin) as usize, (y.floor() + margin) as usize))
            .collect();

        let sharpest: Vec<f64> = corners.iter().map(|&corner| stack.sharpest(corner).round()).collect();
        let centre = smoothed(&sharpest, SMOOTHING);
        let steps = (planes - 1) as f64;
        let moment = |frame: usize| {
            let first = (centre[frame] - focus[frame] * steps).round().clamp(0.0, (available - planes) as f64);
            let first_plane = first as usize;
            let corner = corners[frame];
            let sharpness = |plane: &usize| mgm(&stack.patch(corner, (first_plane + plane) as f64));
            let best = (0..planes).max_by(|a, b| sharpness(a).total_cmp(&sharpness(b))).unwrap_or(0);
            Moment { corner, first_plane, optimum: FocalPower::nearest(best as f64 / steps) }
        };

        let frames = (0..FRAMES).map(moment).collect();
        Some(Self { stack, planes, frames })
    }
}

/// A replay of a [`StackCourse`]. It stays at the last frame.
struct Playing {
    course: Arc<StackCourse>,
    frame: usize,
}

impl Playing {
    /// The patch's corner, and the position of the focal plane in the stack.
    fn place(&self, focal_power: FocalPower) -> ((usize, usize), f64) {
        let Moment { corner, first_plane, .. } = self.course.frames[self.frame];
        (corner, first_plane as f64 + focal_power.get() * (self.course.planes - 1) as f64)
    }
}

impl FocalTimeScan for Playing {
    fn observe(&mut self, focal_power: FocalPower) -> View {
        let (corner, position) = self.place(focal_power);
        let mut view = self.course.stack.view(corner, position);
        view.patch.0.iter_mut().for_each(|value| *value = value.round());
        view
    }

    fn patch(&mut self, focal_power: FocalPower) -> Patch {
        let (corner, position) = self.place(focal_power);
        Patch(self.course.stack.patch(corner, position).0.map(f32::round))
    }

    fn optimum(&self) -> FocalPower {
        self.course.frames[self.frame].optimum
    }

    fn advance(&mut self) {
        self.frame = (self.frame + 1).min(self.course.frames.len() - 1);
    }
}

/// Courses over focal stacks to evaluate on.
#[derive(Debug, Clone)]
pub struct StackScans(pub Vec<Arc<StackCourse>>);

impl ScanSet for StackScans {
    fn count(&self) -> usize {
        self.0.len()
    }

    fn scan(&self, index: usize) -> (Box<dyn FocalTimeScan>, usize) {
        (Box::new(Playing { course: Arc::clone(&self.0[index]), frame: 0 }), FRAMES)
    }
}
