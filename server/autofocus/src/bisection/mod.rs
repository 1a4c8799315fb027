//! The policy `mgm-bisection`: a probabilistic bisection on whether the picture became sharper. Nothing in it is
//! learned.
//!
//! Probabilistic bisection keeps a belief about a point and asks on which side of a place it lies; the answers may be
//! wrong (Horstein 1963, IEEE Trans. Inf. Theory 9(3); Waeber, Frazier and Henderson 2013, SIAM J. Control Optim.
//! 51(3)). Here the point is the optimal focal power, and two frames at different focal powers are the question: the
//! sharper one is probably nearer. Only the sign of the change is used, and its size beside the usual one. How fast an
//! optic blurs does not matter.
//!
//! Three things make it work on a scene in motion. Frames are registered, so that the same piece of scene is compared.
//! The belief includes the optimum's velocity, so that it lags less. And it is corrected by the sharpness of the last
//! second. The best place under a belief is found as by `parfocal`.

mod filter;
pub(crate) mod motion;
mod sharpness_memory;

use std::collections::VecDeque;
use std::sync::Arc;

use self::filter::{Comparison, Filter};
use self::motion::ViewTransform;
use self::sharpness_memory::SharpnessMemory;
use super::belief::best;
use super::registration::displacement;
use super::spectrum;
use super::{Decision, FieldOfView, Observation, Policy};
use parfocal_base::IN_FOCUS;
use parfocal_imaging::{PATCH_SIDE, Patch, Surroundings, View};

/// Ages of the frames with which a frame is compared.
const LAGS: [usize; 3] = [1, 2, 4];
/// Frames remembered.
const REMEMBERED: usize = LAGS[LAGS.len() - 1];
/// Least difference of focal power between two frames that are compared.
const LEAST_DIFFERENCE: f64 = 0.015;
/// Least side, in pixels, of a piece of scene that is compared.
const LEAST_PIECE: usize = 16;

/// Weight of a new change of sharpness in the usual one.
const FRESH: f32 = 0.1;
/// The usual change of sharpness before there was any: a difference of logarithms.
const USUAL: f32 = 0.05;
/// Added to the usual change, so that noise in a still picture is not taken for news.
const QUIET: f32 = 0.01;
/// A change of so many times the usual one is as clear as can be.
const CLEAREST: f32 = 2.0;

/// Below this probability of being in focus it looks around.
///
/// We chose the lively form. With 0.7 it turns a fourth less often, and its error is 2 to 7 % greater: the calm form.
/// As a baseline the lower error counts.
const ASSURANCE: f32 = 0.85;
/// Least change of focal power while it looks around.
const LOOK: f64 = 0.04;
/// Largest change of focal power per frame. Twice as much gains nothing here.
const MAX_MOVE: f64 = 0.1;
/// Smaller changes are not made.
const LEAST_MOVE: f64 = 0.005;

/// The policy. Use one instance per scan.
#[derive(Default)]
pub struct Bisection {
    filter: Filter,
    sharpness: SharpnessMemory,
    /// The latest frames, newest first.
    past: VecDeque<Frame>,
    /// The usual change of sharpness at each of [`LAGS`].
    usual: Option<[f32; LAGS.len()]>,
}

/// A frame, and where the scene of the present patch was in it.
struct Frame {
    window: Window,
    focal_power: f64,
    /// Column and row of the present patch's upper left pixel; may lie outside.
    patch: (isize, isize),
}

/// The pixels of a frame that are compared: the patch's surroundings, or the patch alone where there are none.
struct Window {
    levels: Arc<[f32]>,
    side: usize,
    /// Column and row of the patch's upper left pixel.
    patch: (usize, usize),
    phases: Phases,
}

/// What a window is registered by.
enum Phases {
    Surroundings(ViewTransform),
    Patch(Box<spectrum::PatchTransform>),
}

impl Window {
    fn of(view: &View) -> Self {
        match &view.surroundings {
            Some(Surroundings { levels, patch }) => Self {
                levels: Arc::clone(levels),
                side: Surroundings::SIDE,
                patch: *patch,
                phases: Phases::Surroundings(ViewTransform::of(levels)),
            },
            None => Self::of_patch(&view.patch),
        }
    }

    fn of_patch(patch: &Patch) -> Self {
        let phases = Phases::Patch(Box::new(spectrum::spectrum(patch)));
        Self { levels: Arc::from(patch.0.as_slice()), side: PATCH_SIDE, patch: (0, 0), phases }
    }

    /// By how many pixels (right, down) the scene has moved from this window to `now`; `None` if they cannot be
    /// compared.
    fn motion_to(&self, now: &Self) -> Option<(isize, isize)> {
        match (&self.phases, &now.phases) {
            (Phases::Surroundings(before), Phases::Surroundings(now)) => Some(before.motion_to(now)),
            (Phases::Patch(before), Phases::Patch(now)) => {
                let (right, down) = displacement(before, now);
                Some((-right, -down))
            }
            _ => None,
        }
    }

    /// Logarithm of the mean gradient magnitude of the `width` x `height` pixels from `(x, y)` on.
    fn sharpness(&self, (x, y): (usize, usize), (width, height): (usize, usize)) -> f32 {
        (mean_gradient(&self.levels, self.side, (x, y), (width, height)) + 1e-6).ln()
    }
}

/// Mean length of the 3x3 Sobel gradient over the inner pixels of a rectangle of `levels`, `side` in a row.
fn mean_gradient(levels: &[f32], side: usize, (x, y): (usize, usize), (width, height): (usize, usize)) -> f32 {
    let row = |y: usize| &levels[y * side + x..][..width];
    let mut sum = 0.0;
    for y in y + 1..y + height - 1 {
        let above = row(y - 1);
        let here = row(y);
        let below = row(y + 1);
        for x in 1..width - 1 {
            let across = above[x + 1] - above[x - 1] + 2.0 * (here[x + 1] - here[x - 1]) + below[x + 1] - below[x - 1];
            let down = below[x - 1] - above[x - 1] + 2.0 * (below[x] - above[x]) + below[x + 1] - above[x + 1];
            sum += (across * across + down * down).sqrt();
        }
    }
    sum / ((width - 2) * (height - 2)) as f32
}

/// The part of a patch that lies in a window of `side` pixels when its first pixel is at `from` along an axis: its
/// beginning within the patch, and its length. `None` if too little of it does.
fn part_inside(from: isize, side: usize) -> Option<(usize, usize)> {
    let skipped = usize::try_from(-from).unwrap_or(0);
    let end = usize::try_from(side as isize - from).ok()?.min(PATCH_SIDE);
    let length = end.checked_sub(skipped)?;
    (length >= LEAST_PIECE).then_some((skipped, length))
}

impl Bisection {
    /// Notes in each earlier frame where the scene of the present patch was.
    fn follow(&mut self, now: &Window) {
        let Some(motion) = self.past.front().map(|frame| frame.window.motion_to(now)) else { return };
        let Some((right, down)) = motion else {
            self.past.clear();
            return;
        };

        // The patch itself may have moved within its surroundings, near a border of the picture.
        let before = self.past[0].window.patch;
        let shift_x = now.patch.0 as isize - before.0 as isize - right;
        let shift_y = now.patch.1 as isize - before.1 as isize - down;
        for frame in &mut self.past {
            frame.patch.0 += shift_x;
            frame.patch.1 += shift_y;
        }
    }

    /// Compares `now`, seen at `focal_power`, with the earlier frames.
    fn compare(&mut self, now: &Window, focal_power: f64) -> Vec<Comparison> {
        let mut usual = self.usual.unwrap_or([USUAL; LAGS.len()]);
        let mut comparisons = Vec::with_capacity(LAGS.len());

        for (lag, usual) in LAGS.into_iter().zip(&mut usual) {
            let Some(frame) = self.past.get(lag - 1) else { continue };
            if (focal_power - frame.focal_power).abs() < LEAST_DIFFERENCE {
                continue;
            }
            let Some(change) = change(frame, now) else { continue };

            *usual += FRESH * (change.abs() - *usual);
            let clear = (change.abs() / (*usual + QUIET)).min(CLEAREST);
            let sharper = clear.copysign(change);
            comparisons.push(Comparison { before: frame.focal_power, now: focal_power, lag, sharper });
        }

        self.usual = Some(usual);
        comparisons
    }

    /// The belief about the optimum, after a frame with `view` at `focal_power`.
    fn believe(&mut self, view: &View, focal_power: f64) -> Vec<f32> {
        let now = Window::of(view);
        self.filter.predict();
        self.follow(&now);

        let comparisons = self.compare(&now, focal_power);
        self.filter.see(&comparisons);
        self.sharpness.see(focal_power as f32, now.sharpness(now.patch, (PATCH_SIDE, PATCH_SIDE)));

        let patch = (now.patch.0 as isize, now.patch.1 as isize);
        self.past.truncate(REMEMBERED - 1);
        self.past.push_front(Frame { window: now, focal_power, patch });

        let mut belief = self.filter.outlook();
        self.sharpness.weigh(&mut belief);
        belief.to_vec()
    }
}

/// How much sharper the present patch is than the same piece of scene in `frame`: the difference of the logarithms of
/// the mean gradient magnitude. `None` if too little of it is seen there.
fn change(frame: &Frame, now: &Window) -> Option<f32> {
    let (left, width) = part_inside(frame.patch.0, frame.window.side)?;
    let (top, height) = part_inside(frame.patch.1, frame.window.side)?;
    let then = ((frame.patch.0 + left as isize) as usize, (frame.patch.1 + top as isize) as usize);
    let here = (now.patch.0 + left, now.patch.1 + top);
    Some(now.sharpness(here, (width, height)) - frame.window.sharpness(then, (width, height)))
}

/// Where to go from `focal_power` under `belief`: to the [`best`] place, by at most [`MAX_MOVE`]. If it is not sure of
/// being in focus and would move less than [`LOOK`], it moves by [`LOOK`] to the likelier side, or away from an end.
fn target(focal_power: f64, belief: &[f32]) -> f64 {
    let share = |is_part: &dyn Fn(f64) -> bool| -> f32 {
        let last = (belief.len() - 1) as f64;
        let bins = belief.iter().enumerate();
        bins.filter(|(bin, _)| is_part(*bin as f64 / last - focal_power)).map(|(_, share)| share).sum()
    };

    let mut step = (best(belief) - focal_power).clamp(-MAX_MOVE, MAX_MOVE);
    if step.abs() < LOOK && share(&|distance| distance.abs() < IN_FOCUS) < ASSURANCE {
        let up = share(&|distance| distance > 0.0) > share(&|distance| distance < 0.0);
        step = if up { LOOK } else { -LOOK };
    } else if step.abs() < LEAST_MOVE {
        step = 0.0;
    }

    let stays = (0.0..=1.0).contains(&(focal_power + step));
    if stays { focal_power + step } else { focal_power - step }
}

impl Policy for Bisection {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Surroundings
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        let focal_power = seen.focal_power.get();
        let belief = self.believe(seen.view, focal_power);
        let target = target(focal_power, &belief);
        Decision { target, metric: Some(super::mgm(&seen.view.patch)), belief: Some(belief.into()) }
    }

    fn forget(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::spread_over_bins;
    use crate::networks::BINS;
    use crate::tests::view;
    use parfocal_base::FocalPower;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;

    #[test]
    fn the_gradient_of_a_ramp_is_eight_a_level() {
        // The Sobel operator sums eight times the slope; the border does not count.
        let ramp: Vec<f32> = (0..40 * 40).map(|i| 3.0 * (i % 40) as f32).collect();
        assert!((mean_gradient(&ramp, 40, (4, 7), (20, 16)) - 24.0).abs() < 1e-4);
        // Slopes of 3 across and 4 down: 8 * 5.
        let ramp: Vec<f32> = (0..40 * 40).map(|i| (3 * (i % 40) + 4 * (i / 40)) as f32).collect();
        assert!((mean_gradient(&ramp, 40, (0, 0), (40, 40)) - 40.0).abs() < 1e-3);
    }

    #[test]
    fn only_the_part_of_a_patch_that_is_inside_is_compared() {
        assert_eq!(part_inside(10, 128), Some((0, 32)));
        assert_eq!(part_inside(-10, 128), Some((10, 22)));
        assert_eq!(part_inside(110, 128), Some((0, 18)));
        assert_eq!((part_inside(-17, 128), part_inside(113, 128), part_inside(300, 128)), (None, None, None));
    }

    #[test]
    fn the_same_piece_of_scene_is_compared_while_the_view_moves() {
        let picture = texture(3, 256);
        // The patch wanders, last to the border, where the surroundings no longer centre on it. The second place has
        // another focal power, the same picture: no piece has changed.
        for alone in [false, true] {
            let mut policy = Bisection::default();
            for (frame, place) in [(90, 90), (95, 86), (99, 80), (92, 84), (86, 88)].into_iter().enumerate() {
                let seen = view(&picture, place);
                let seen = if alone { seen.patch.into() } else { seen };
                let now = Window::of(&seen);
                policy.follow(&now);
                for old in &policy.past {
                    let found = change(old, &now).unwrap();
                    assert!(found.abs() < 1e-4, "frame {frame}, alone {alone}: {found}");
                }
                let patch = (now.patch.0 as isize, now.patch.1 as isize);
                policy.past.push_front(Frame { window: now, focal_power: 0.5, patch });
            }
        }

        let mut policy = Bisection::default();
        for place in [(52, 60), (45, 66), (36, 60)] {
            let now = Window::of(&view(&picture, place));
            policy.follow(&now);
            assert!(policy.past.iter().all(|old| change(old, &now).unwrap().abs() < 1e-4), "{place:?}");
            let patch = (now.patch.0 as isize, now.patch.1 as isize);
            policy.past.push_front(Frame { window: now, focal_power: 0.5, patch });
        }
    }

    #[test]
    fn a_piece_that_became_sharper_has_a_positive_change() {
        let sharp = texture(4, 256);
        let blurred = gaussian_blur(&sharp, 1.0);
        let mut policy = Bisection::default();
        let before = Window::of(&view(&blurred, (100, 100)));
        policy.past.push_front(Frame { window: before, focal_power: 0.3, patch: (48, 48) });
        let now = Window::of(&view(&sharp, (104, 97)));
        policy.follow(&now);
        let found = policy.compare(&now, 0.4);
        // The first change is far above the usual one, which then rises by a tenth of it.
        assert_eq!(found, [Comparison { before: 0.3, now: 0.4, lag: 1, sharper: CLEAREST }]);
        assert!(policy.usual.unwrap()[0] > USUAL);
        // Focal powers too near to each other say nothing.
        assert!(policy.compare(&now, 0.31).is_empty());
    }

    /// Runs the policy on a still scene with its optimum at `optimum`. Returns where the lens is at each frame.
    fn run(optimum: f64, alone: bool) -> Vec<f64> {
        let picture = texture(8, 256);
        let mut policy = Bisection::default();
        let mut focal_power = FocalPower::MIDDLE;
        let step = |frame: usize| {
            let blurred = gaussian_blur(&picture, 6.0 * (focal_power.get() - optimum).abs());
            let seen = view(&blurred, (100 + 3 * (frame % 4), 100 - 2 * (frame % 3)));
            let seen = if alone { seen.patch.into() } else { seen };
            let decision = policy.step(&Observation { view: &seen, focal_power });
            let belief = decision.belief.unwrap();
            assert!(belief.len() == BINS && (belief.iter().sum::<f32>() - 1.0).abs() < 1e-4);
            focal_power = FocalPower::nearest(decision.target);
            focal_power.get()
        };
        (0..60).map(step).collect()
    }

    #[test]
    fn it_finds_the_optimum_and_stays_there() {
        for alone in [false, true] {
            for optimum in [0.2, 0.85] {
                let path = run(optimum, alone);
                let off = path[20..].iter().map(|f| (f - optimum).abs()).sum::<f64>() / 40.0;
                assert!(off < 0.06, "optimum {optimum}, alone {alone}: {path:?}");
            }
        }
    }

    #[test]
    fn the_same_frames_give_the_same_path() {
        assert_eq!(run(0.7, false), run(0.7, false));
    }

    #[test]
    fn it_looks_around_where_it_is_not_sure() {
        let certain = |place| {
            let mut belief = [0.0; BINS];
            spread_over_bins(place, &mut belief);
            belief
        };
        assert!((target(0.5, &certain(0.9)) - 0.6).abs() < 1e-9);
        assert!((target(0.5, &certain(0.5)) - 0.5).abs() < 1e-9);
        let mut even = [1.0 / BINS as f32; BINS];
        even[30] += 0.1;
        assert!((target(best(&even), &even) - best(&even)).abs() >= LOOK - 1e-9);
        // At an end it turns instead of leaving the range.
        let mut low = [0.1 / (BINS - 10) as f32; BINS];
        low[..10].fill(0.09);
        let at = target(0.0, &low);
        assert!((LOOK - 1e-9..=MAX_MOVE + 1e-9).contains(&at), "{at}");
    }
}
