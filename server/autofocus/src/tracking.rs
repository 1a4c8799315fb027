//! Follows a place of the tissue from frame to frame, by registering its surroundings with those of an earlier frame.

use crate::bisection::motion::ViewTransform;
use parfocal_imaging::Surroundings;

/// A peak of the phase correlation that stands out less shows nothing. Unrelated pictures reach 5.
const FAINT: f32 = 7.0;
/// So many frames without a peak are waited for, since the picture may be blurred for a moment.
const PATIENCE: u32 = 25;
/// A frame is compared with the same earlier one for so long, which drifts less than comparing each with the one
/// before. Then the tissue may look different, since it was tilted or deformed.
const RENEWED_AFTER: u32 = 25;
/// The earlier one is also renewed once its surroundings show the tissue so many pixels away, as at the picture's edge,
/// where they cannot go with it.
const FAR: isize = 10;
/// For that the peak must stand out by so much.
const CLEAR: f32 = 10.0;

/// Where the tissue is, in pixels of the picture.
pub type Corner = (isize, isize);

/// What became of the tissue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tracked {
    /// The patch's corner is here.
    At(Corner),
    /// It was not recognised in this frame.
    Unsure,
    /// It was not recognised for so long that it may be anywhere.
    Lost,
}

/// An earlier frame.
struct Reference {
    spectrum: ViewTransform,
    /// The corner of its surroundings in the picture.
    window: Corner,
    /// The corner of the patch that is followed.
    patch: Corner,
    frames: u32,
}

/// Follows the place at which the patch is when it sees its first frame.
#[derive(Default)]
pub struct Tracker {
    reference: Option<Reference>,
    unsure: u32,
}

impl Tracker {
    /// Looks for the tissue in a frame. `around` are the surroundings of the place where it was last, whose patch has
    /// its `corner` there.
    pub fn see(&mut self, around: &Surroundings, corner: (usize, usize)) -> Tracked {
        let patch = signed(corner);
        let window = minus(patch, signed(around.patch));
        let spectrum = ViewTransform::of(&around.levels);

        let Some(reference) = &mut self.reference else {
            self.reference = Some(Reference { spectrum, window, patch, frames: 0 });
            return Tracked::At(patch);
        };

        let (motion, stands_out) = reference.spectrum.registered_to(&spectrum);
        if stands_out < FAINT {
            self.unsure += 1;
            return if self.unsure > PATIENCE { Tracked::Lost } else { Tracked::Unsure };
        }

        self.unsure = 0;
        let patch = plus(plus(window, minus(reference.patch, reference.window)), motion);
        reference.frames += 1;
        let is_far = motion.0.abs().max(motion.1.abs()) > FAR;
        if (is_far || reference.frames >= RENEWED_AFTER) && stands_out >= CLEAR {
            *reference = Reference { spectrum, window, patch, frames: 0 };
        }
        Tracked::At(patch)
    }
}

const fn signed((x, y): (usize, usize)) -> Corner {
    (x.cast_signed(), y.cast_signed())
}

const fn plus(a: Corner, b: Corner) -> Corner {
    (a.0 + b.0, a.1 + b.1)
}

const fn minus(a: Corner, b: Corner) -> Corner {
    (a.0 - b.0, a.1 - b.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::{GrayImage, Scale, Square};

    /// The size of the picture that is seen of a larger scene.
    const SEEN: usize = 256;

    /// The surroundings of the patch at `corner` in a picture that shows `scene` from `origin` on.
    fn around(scene: &GrayImage, origin: (usize, usize), corner: (usize, usize)) -> Surroundings {
        let Square { x, y, side } = Square::around(corner, Scale::Four, (SEEN, SEEN)).unwrap();
        let level = |i: usize| scene.data[(origin.1 + y + i / side) * scene.width + origin.0 + x + i % side].round();
        Surroundings { levels: (0..side * side).map(level).collect(), patch: (corner.0 - x, corner.1 - y) }
    }

    /// Where the view of the scene begins in frame `frame`: it wanders to and fro by some 150 pixels.
    fn wander(frame: usize) -> (usize, usize) {
        let turn = frame as f64 / 30.0;
        ((75.0 + 70.0 * turn.sin()).round() as usize, (75.0 + 60.0 * (1.3 * turn).cos()).round() as usize)
    }

    #[test]
    fn a_place_is_followed_over_seconds_through_changing_blur() {
        for seed in 0..3 {
            let sharp = texture(seed, 420);
            let blurs =
                [0.0, 0.7, 1.5, 2.5].map(|blur| if blur > 0.0 { gaussian_blur(&sharp, blur) } else { sharp.clone() });
            let start = wander(0);
            let mut tracker = Tracker::default();
            let mut corner = (120, 100);
            let place = (start.0 + corner.0, start.1 + corner.1);

            for frame in 0..250 {
                let scene = &blurs[frame / 7 % 4];
                let origin = wander(frame);
                let truth = (place.0 as isize - origin.0 as isize, place.1 as isize - origin.1 as isize);
                let outcome = tracker.see(&around(scene, origin, corner), corner);
                let Tracked::At(found) = outcome else { panic!("seed {seed}, frame {frame}: {outcome:?}") };
                let off = (found.0 - truth.0).abs().max((found.1 - truth.1).abs());
                assert!(off <= 2, "seed {seed}, frame {frame}: {found:?} is not {truth:?}");
                corner = (found.0.max(0) as usize, found.1.max(0) as usize);
            }
        }
    }

    #[test]
    fn another_scene_or_none_is_not_mistaken_for_the_place() {
        let flat = GrayImage::new(420, 420, vec![90.0; 420 * 420]).unwrap();
        for other in [texture(91, 420), texture(92, 420), flat] {
            let scene = texture(5, 420);
            let mut tracker = Tracker::default();
            assert_eq!(tracker.see(&around(&scene, (75, 75), (100, 100)), (100, 100)), Tracked::At((100, 100)));

            for _ in 0..PATIENCE {
                assert_eq!(tracker.see(&around(&other, (75, 75), (100, 100)), (100, 100)), Tracked::Unsure);
            }
            assert_eq!(tracker.see(&around(&other, (75, 75), (100, 100)), (100, 100)), Tracked::Lost);
        }
    }

    #[test]
    fn what_comes_back_in_time_is_found_again() {
        let scene = texture(6, 420);
        let hidden = GrayImage::new(420, 420, vec![20.0; 420 * 420]).unwrap();
        let mut tracker = Tracker::default();
        tracker.see(&around(&scene, (75, 75), (100, 100)), (100, 100));
        for _ in 0..10 {
            assert_eq!(tracker.see(&around(&hidden, (75, 75), (100, 100)), (100, 100)), Tracked::Unsure);
        }
        assert_eq!(tracker.see(&around(&scene, (84, 70), (100, 100)), (100, 100)), Tracked::At((91, 105)));
    }
}
