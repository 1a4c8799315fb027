//! Which positions of a focal stack a lens reaches, frame by frame.

use std::collections::VecDeque;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::relief::{Distance, StackScene};
use parfocal_devices::simulation::gaussian::kernel;
use parfocal_devices::simulation::normal::standard_normal;
use parfocal_devices::simulation::walk::Walk;

/// How a lens's focal power becomes a position in a focal stack.
#[derive(Debug, Clone, Copy)]
pub struct LensOverStack {
    /// Positions per unit of focal power; below 0 if positions fall when focal power rises.
    pub slope: f64,
    /// Curvature of the response: 0 if it is straight, else the relative change of slope over half a unit.
    bend: f64,
    /// Pixels that the picture moves along each axis when the position changes by one, as
    /// magnification follows focus.
    pub shift: [f64; 2],
    /// Whether the range moves by whole positions of the stack.
    whole: bool,
}

/// What a lens reaches of a focal stack at one frame.
#[derive(Debug, Clone, Copy)]
pub enum Reach {
    /// Position `slope * (off + bend * off^2)`, where `off` is counted from the focal power at which the ground is
    /// sharp.
    Ground {
        /// The focal power at which the ground is sharp.
        focus: f64,
    },
    /// Position `origin + slope * focal_power`.
    View {
        /// The position at focal power 0.
        origin: f64,
    },
}

impl LensOverStack {
    /// Draws the optics for one scan of `scene`.
    pub fn draw(scene: &StackScene, course: &mut ChaCha8Rng) -> Self {
        let (least, most) = scene.slopes;
        let size = least * (most.max(least) / least).powf(course.random::<f64>());
        let slope = if course.random_bool(0.5) { size } else { -size };

        match scene.distance {
            Distance::Following { .. } => Self { slope, bend: 0.0, shift: [0.0; 2], whole: course.random_bool(0.5) },
            Distance::Kept => {
                let bend = course.random_range(-0.3..0.3);
                let shift = [(); 2].map(|()| 0.15 * standard_normal(course));
                Self { slope, bend, shift, whole: false }
            }
        }
    }

    /// What the lens reaches of `scene` at one frame. `focus` is the walking focal power; `anchor` is the sharpest
    /// position, smoothed over frames.
    pub fn reach(&self, scene: &StackScene, focus: f64, anchor: f64) -> Reach {
        let Distance::Following { spacing } = scene.distance else { return Reach::Ground { focus } };

        let (first, last) = scene.planes.range();
        let (low, high) = if self.slope > 0.0 { (first, last - self.slope) } else { (first - self.slope, last) };
        let origin = anchor - self.slope * focus;
        let origin = if self.whole { first + ((origin - first) / spacing).round() * spacing } else { origin };
        Reach::View { origin: origin.clamp(low.min(high), high) }
    }

    /// The position at `focal_power`.
    pub fn position(&self, reach: Reach, focal_power: f64) -> f64 {
        match reach {
            Reach::View { origin } => origin + self.slope * focal_power,
            Reach::Ground { focus } => {
                let off = focal_power - focus;
                self.slope * (off + self.bend * off * off)
            }
        }
    }

    /// The focal power at which `position` is in focus: the inverse of [`LensOverStack::position`].
    pub fn focal_power(&self, reach: Reach, position: f64) -> f64 {
        match reach {
            Reach::View { origin } => (position - origin) / self.slope,
            Reach::Ground { focus } => {
                // Solves off + bend off^2 = place. Takes the root that is 0 where place is 0, in a form that never
                // divides by a small bend.
                let place = position / self.slope;
                let root = (1.0 + 4.0 * self.bend * place).max(0.0).sqrt();
                focus + 2.0 * place / (1.0 + root)
            }
        }
    }

    /// The positions that the lens reaches, lowest and highest.
    pub fn ends(&self, reach: Reach) -> (f64, f64) {
        let [start, end] = [0.0, 1.0].map(|focal_power| self.position(reach, focal_power));
        (start.min(end), start.max(end))
    }
}

/// A hand's distance follows what is in view, smoothed with this standard deviation in frames.
const SMOOTHING: f64 = 12.0;
/// Frames that the smoothing looks ahead and back.
const LEAD: usize = 30;

/// A hand that follows what is in view. It knows its way [`LEAD`] frames ahead.
#[derive(Debug, Clone)]
pub struct Following {
    /// Where the patch's corner lies at this frame and the next [`LEAD`].
    corners: VecDeque<(f64, f64)>,
    /// The sharpest positions from [`LEAD`] frames ago to as many ahead.
    sharpest: VecDeque<f64>,
    weights: Vec<f64>,
}

impl Following {
    /// Begins where `crop` is, and advances `crop` by [`LEAD`] frames.
    pub fn new(stack: &StackScene, crop: &mut [Walk; 2], course: &mut ChaCha8Rng) -> Self {
        let start = stack.planes.sharpest(whole(corner(crop)));
        let mut following = Self {
            corners: VecDeque::from([corner(crop)]),
            sharpest: VecDeque::from(vec![start; LEAD + 1]),
            weights: kernel(SMOOTHING, LEAD),
        };

        for _ in 0..LEAD {
            for walk in crop.iter_mut() {
                walk.advance(course);
            }
            following.push(stack, corner(crop));
        }
        following
    }

    fn push(&mut self, stack: &StackScene, corner: (f64, f64)) {
        self.corners.push_back(corner);
        self.sharpest.push_back(stack.planes.sharpest(whole(corner)));
    }

    /// Advances to the next frame; `ahead` is where the corner lies [`LEAD`] frames after it.
    pub fn advance(&mut self, stack: &StackScene, ahead: (f64, f64)) {
        self.corners.pop_front();
        self.sharpest.pop_front();
        self.push(stack, ahead);
    }

    /// Where the patch's corner lies at this frame.
    pub fn corner(&self) -> (f64, f64) {
        self.corners[0]
    }

    /// The sharpest position, smoothed over the frames around this one.
    pub fn anchor(&self) -> f64 {
        self.sharpest.iter().zip(&self.weights).map(|(position, weight)| position * weight).sum()
    }
}

/// The pixel that holds a place. Coordinates below 0 become 0.
pub fn whole((x, y): (f64, f64)) -> (usize, usize) {
    (x.max(0.0) as usize, y.max(0.0) as usize)
}

/// Where the walks along both axes are now.
pub fn corner(walks: &[Walk; 2]) -> (f64, f64) {
    (walks[0].position(), walks[1].position())
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::scans::pictures::Split;
    use crate::scans::relief::scenes;

    #[test]
    fn focal_power_inverts_position() {
        let stack = StackScene::clone(&scenes(Split::Training, 1).unwrap()[0]);
        let distance = Distance::Following { spacing: 1.0 };
        let followed = StackScene { distance, slopes: (8.0, 8.0), ..stack.clone() };
        let mut rng = ChaCha8Rng::seed_from_u64(1);

        for scene in [stack, followed] {
            for _ in 0..20 {
                let optics = LensOverStack::draw(&scene, &mut rng);
                for (focus, focal_power) in [(0.2, 0.7), (0.5, 0.5), (0.9, 0.1)] {
                    let reach = optics.reach(&scene, focus, 0.3);
                    let position = optics.position(reach, focal_power);
                    assert!((optics.focal_power(reach, position) - focal_power).abs() < 1e-9);
                }
            }
        }
    }
}
