//! The policy `parfocal`. It tracks a belief about the optimum and goes to where the picture is most likely in focus.
//! If that is in doubt, it moves to find out more.

use std::sync::{Arc, LazyLock};

use tch::{Device, Kind, Tensor, nn};

use super::networks::{BELIEF_INPUT, BINS, BeliefNetwork, NEAR_INPUT, SEEN_INPUT, WIDER_INPUT};
use super::registration::{CHANGES, changes};
use super::spectrum::{FEATURES, PatchTransform, SHARPNESS, features, spectrum};
use super::tiles::{ViewTrace, count_from_other_end};
use super::weights::{self, WeightsError};
use super::{Decision, FieldOfView, Observation, Policy};
use parfocal_base::{BlurRate, FocalPower, IN_FOCUS};
use parfocal_imaging::{Patch, View, WIDER};

/// Largest change of focal power per frame. The lens could jump, but the surgeon should not see it.
const MAX_MOVE: f64 = 0.2;
/// Smallest change of focal power. Smaller ones would only make the picture restless.
const LEAST_MOVE: f64 = 0.02;
/// Below this probability of being in focus, the tracker searches for the optimum: standing still reveals little.
const ASSURANCE: f64 = 0.85;
/// While it searches, it still goes to the best place if that is at least so far away, which shows as much as a look.
const NEAR: f64 = 0.1;
/// Change of focal power per frame while searching: enough to see a change of blur, too little to leave focus.
const LOOK: f64 = 0.04;
/// While searching, it turns round only where the other side is so many times as likely: to look to and fro shows less
/// than to go on, and a surgeon sees each turn.
const TURNS_FOR: f64 = 4.0;
/// Change of focal power when the belief is tested.
const TEST: f64 = 0.1;

/// Ways of counting focal powers: from either end of the lens's range.
const WAYS: usize = 2;

/// Blur rate, in pixels per unit of focal power, that the network gets as 0: a usual value for optics.
const USUAL_BLUR: f64 = 6.0;

/// Changes of focal power below this do not count as a move.
const STILL: f32 = 0.005;

/// The tracker's memory of the frame before.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// Blur rate of the optics, if known.
    blur: Option<BlurRate>,
    /// The last frame seen.
    last: Option<Box<Frame>>,
    /// The focal power last asked for.
    asked: Option<f32>,
    way: Way,
    stand: SharpnessSinceMove,
    views: ViewTrace,
}

/// Which way the lens was last asked to move.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Way {
    /// It was not.
    #[default]
    Neither,
    Down,
    Up,
}

/// The sharpness of the picture since the lens last moved.
#[derive(Debug, Clone, Copy, Default)]
struct SharpnessSinceMove {
    /// Frames since the lens last moved.
    frames: u32,
    /// The logarithm of the mean gradient magnitude, smoothed over a few frames.
    sharpness: f32,
    /// The greatest such value since the lens last moved.
    sharpest: f32,
}

impl SharpnessSinceMove {
    /// Weight of a new frame in the smoothed sharpness.
    const FRESH: f32 = 0.3;
    /// Frames for which the lens may stand still while the picture gets worse: one second at the 25 frames per second
    /// of scans.
    const PATIENCE: u32 = 25;
    /// Loss of sharpness that counts as worse, as a difference of logarithms.
    const LOSS: f32 = 0.15;

    /// Takes in a frame of `sharpness`. `moved`: whether the lens moved since the frame before.
    fn see(&mut self, sharpness: f32, moved: bool) {
        if moved {
            *self = Self { frames: 0, sharpness, sharpest: sharpness };
            return;
        }
        self.frames += 1;
        self.sharpness += Self::FRESH * (sharpness - self.sharpness);
        self.sharpest = self.sharpest.max(self.sharpness);
    }

    /// Whether the belief should be tested: the lens has stood still long enough, and the picture got worse.
    fn is_doubtful(&self) -> bool {
        self.frames >= Self::PATIENCE && self.sharpest - self.sharpness > Self::LOSS
    }
}

#[derive(Debug, Clone)]
struct Frame {
    near: Look,
    wider: [Option<Look>; WIDER.len()],
    focal_power: f32,
}

/// One patch and the measurements on it.
#[derive(Debug, Clone)]
struct Look {
    patch: Patch,
    spectrum: PatchTransform,
    features: [f32; FEATURES],
}

impl Look {
    fn at(patch: &Patch) -> Self {
        let spectrum = spectrum(patch);
        Self { patch: *patch, features: features(patch, &spectrum), spectrum }
    }

    /// Writes to `input` the features of this patch, their change since the patch `before`, and the change of blur over
    /// the texture that both show. Returns the rest of `input`.
    fn describe<'a>(&self, before: &Self, input: &'a mut [f32]) -> &'a mut [f32] {
        let (appearance, rest) = input.split_at_mut(FEATURES);
        appearance.copy_from_slice(&self.features);

        let (difference, rest) = rest.split_at_mut(FEATURES);
        for (index, change) in difference.iter_mut().enumerate() {
            *change = 4.0 * (self.features[index] - before.features[index]);
        }

        let (registered, rest) = rest.split_at_mut(CHANGES);
        registered.copy_from_slice(&changes((&before.patch, &before.spectrum), (&self.patch, &self.spectrum)));

        rest
    }
}

impl Frame {
    /// Whether the patch of at least one scale shows something to focus on.
    fn shows_detail(&self) -> bool {
        let mut looks = std::iter::once(&self.near).chain(self.wider.iter().flatten());
        looks.any(|look| look.spectrum.shows_detail())
    }
}

impl Trace {
    /// An empty trace. `blur` is the blur rate of the optics, if known.
    pub fn knowing(blur: Option<BlurRate>) -> Self {
        Self { blur, ..Self::default() }
    }

    /// Takes in a frame with `view`, seen at `focal_power`, and returns the network's input for it.
    pub fn input(&mut self, view: &View, focal_power: f64) -> [f32; BELIEF_INPUT] {
        let focal_power = focal_power as f32;
        let wider = view.wider.each_ref().map(|patch| patch.as_ref().map(Look::at));
        let now = Box::new(Frame { near: Look::at(&view.patch), wider, focal_power });

        let before = self.last.as_ref().unwrap_or(&now);
        let moved = self.last.is_none() || (focal_power - before.focal_power).abs() > STILL;
        self.stand.see(now.near.features[SHARPNESS], moved);

        let mut input = [0.0; BELIEF_INPUT];
        let (seen, rest) = input.split_at_mut(SEEN_INPUT);
        let (known, around) = rest.split_at_mut(2);
        around.copy_from_slice(&self.views.see(view.surroundings.as_ref(), focal_power));
        let (near, wider) = seen.split_at_mut(NEAR_INPUT);
        let rest = now.near.describe(&before.near, near);
        let (stands, moved) = rest.split_at_mut(BINS);
        spread_over_bins(f64::from(focal_power), stands);
        moved[0] = 2.0 * (focal_power - 0.5);
        moved[1] = 10.0 * (focal_power - before.focal_power);
        moved[2] = 10.0 * (self.asked.unwrap_or(focal_power) - focal_power);

        for (index, part) in wider.chunks_exact_mut(WIDER_INPUT).enumerate() {
            // Without such a patch all inputs are 0, as in some scans of the training.
            if let Some(look) = &now.wider[index] {
                let before = before.wider[index].as_ref().unwrap_or(look);
                let rest = look.describe(before, part);
                rest[0] = 1.0;
            }
        }

        if let Some(blur) = self.blur {
            known[0] = 1.0;
            known[1] = (blur.get() / USUAL_BLUR).ln() as f32;
        }

        self.last = Some(now);
        input
    }

    /// Where to go from `focal_power` under `belief` (see [`target`]). Stays while the latest frame shows nothing to
    /// judge focus by, such as a glove or glare.
    pub fn aim(&self, focal_power: f64, belief: &[f32]) -> f64 {
        let blind = self.last.as_ref().is_some_and(|frame| !frame.shows_detail());
        if blind {
            return focal_power;
        }

        let aim = target(focal_power, belief, self.way);
        let stands = (aim - focal_power).abs() < f64::from(STILL);
        if stands && self.stand.is_doubtful() { look_aside(focal_power, belief) } else { aim }
    }

    /// Records the focal power that was asked for after the frame.
    pub fn ask(&mut self, target: f64) {
        let target = target as f32;
        let change = self.last.as_ref().map_or(0.0, |frame| target - frame.focal_power);
        if change.abs() > STILL {
            self.way = if change > 0.0 { Way::Up } else { Way::Down };
        }
        self.asked = Some(target);
    }
}

/// What [`Trace::input`] would have returned instead of `input` if focal powers were counted from the other end of the
/// lens's range.
fn from_other_end(input: &[f32; BELIEF_INPUT]) -> [f32; BELIEF_INPUT] {
    let mut other = *input;
    let (stands, moved) = other[2 * FEATURES + CHANGES..NEAR_INPUT].split_at_mut(BINS);
    stands.reverse();
    for change in moved {
        *change = -*change;
    }

    count_from_other_end(&mut other[SEEN_INPUT + 2..]);
    other
}

/// Adds one unit to the two bins around `place` (0..=1), divided so that its mean is `place`.
pub fn spread_over_bins(place: f64, bins: &mut [f32]) {
    let last = bins.len() - 1;
    let at = place.clamp(0.0, 1.0) * last as f64;
    let lower = (at as usize).min(last.saturating_sub(1));
    bins[lower] += (1.0 - (at - lower as f64)) as f32;
    bins[lower + 1] += (at - lower as f64) as f32;
}

/// Places per width of a bin that [`best`] considers.
const FINENESS: usize = 10;
const PLACES: usize = (BINS - 1) * FINENESS + 1;

/// Value of being `distance` from the optimum: about 1 in focus and 0 out of focus, with a soft edge. It also falls
/// slightly with distance, so that a tracker that does not know the optimum goes to the middle of where it may be.
fn worth(distance: f64) -> f64 {
    const SOFTNESS: f64 = 0.08;
    const SLOPE: f64 = 0.3;
    1.0 / (1.0 + ((distance - IN_FOCUS) / SOFTNESS).exp()) - SLOPE * distance
}

/// [`worth`] at each place, from a whole range below the optimum to a whole range above it.
static WORTH: LazyLock<[f32; 2 * PLACES - 1]> = LazyLock::new(|| {
    std::array::from_fn(|index| {
        let distance = index.abs_diff(PLACES - 1) as f64 / (PLACES - 1) as f64;
        worth(distance) as f32
    })
});

/// The focal power with the highest expected `worth` under `belief`, whose bin `i` of [`BINS`] stands for
/// `i / (BINS - 1)`. Compared with the belief's median, it reverses less often and is in focus at least as often: if
/// the belief has two peaks, it goes to one of them.
pub fn best(belief: &[f32]) -> f64 {
    let mut values = [0.0f32; PLACES];
    for (bin, share) in belief.iter().enumerate().take(BINS) {
        let worth = &WORTH[PLACES - 1 - bin * FINENESS..][..PLACES];
        for (value, worth) in values.iter_mut().zip(worth) {
            *value += share * worth;
        }
    }

    let top = (0..PLACES).max_by(|&a, &b| values[a].total_cmp(&values[b]));
    top.unwrap_or(PLACES / 2) as f64 / (PLACES - 1) as f64
}

/// A belief that gives at least this probability to a place is sure of it.
pub const SURE: f64 = 0.85;

/// How much of a belief lies below the depth of focus around a place, within it, and above it.
#[derive(Debug, Clone, Copy)]
pub struct Sides {
    /// At a lower focal power.
    pub below: f64,
    /// Within [`IN_FOCUS`].
    pub here: f64,
    /// At a higher focal power.
    pub above: f64,
}

impl Sides {
    /// The sides of `belief` around the focal power `place`. Value `i` of `n` stands for the focal power `i / (n - 1)`.
    pub fn of(belief: &[f32], place: f64) -> Self {
        let last = belief.len().saturating_sub(1).max(1) as f64;
        let mut sides = Self { below: 0.0, here: 0.0, above: 0.0 };
        for (bin, share) in belief.iter().enumerate() {
            let distance = bin as f64 / last - place;
            let side = if distance.abs() < IN_FOCUS {
                &mut sides.here
            } else if distance < 0.0 {
                &mut sides.below
            } else {
                &mut sides.above
            };
            *side += f64::from(*share);
        }
        sides
    }
}

/// A place at which to test the belief, [`TEST`] away from `focal_power`. It is on the side where the optimum is
/// likelier under `belief`, or on the other side if the range ends there.
fn look_aside(focal_power: f64, belief: &[f32]) -> f64 {
    let mut below = 0.0;
    let mut above = 0.0;
    for (bin, share) in belief.iter().enumerate() {
        let side = if (bin as f64 / (BINS - 1) as f64) < focal_power { &mut below } else { &mut above };
        *side += f64::from(*share);
    }

    let fits = |up: bool| if up { focal_power + TEST <= 1.0 } else { focal_power >= TEST };
    let likelier = above > below;
    let up = if fits(likelier) { likelier } else { !likelier };
    if up { focal_power + TEST } else { focal_power - TEST }
}

/// Where to go from `focal_power` under `belief`: to the [`best`] place, by at most [`MAX_MOVE`] per frame, and not at
/// all for less than [`LEAST_MOVE`]. If the tracker is not sure enough of being in focus and that place is nearer than
/// [`NEAR`], it moves by [`LOOK`] instead: on the `way` that it went last, or to the other side if that is much
/// likelier.
fn target(focal_power: f64, belief: &[f32], way: Way) -> f64 {
    let step = (best(belief) - focal_power).clamp(-MAX_MOVE, MAX_MOVE);
    if step.abs() < NEAR {
        let Sides { below, here, above } = Sides::of(belief, focal_power);
        if here < ASSURANCE {
            let up = match way {
                Way::Neither => above > below,
                Way::Up => above * TURNS_FOR > below,
                Way::Down => above > below * TURNS_FOR,
            };
            let look = if up { LOOK } else { -LOOK };
            return (focal_power + look).clamp(0.0, 1.0);
        }
    }
    if step.abs() < LEAST_MOVE { focal_power } else { focal_power + step }
}

/// The belief tracker as a policy. Use one instance per scan.
///
/// The network sees each frame twice: as it is, and with focal powers counted [from the other end](from_other_end).
/// Blur is the same on both sides of the optimum, so both beliefs should be the same, mirrored. They err differently,
/// and pooled they err less than either.
pub struct BeliefTracker {
    network: BeliefNetwork,
    /// That of both ways of counting, `[1, WAYS, MEMORY]`.
    memory: Tensor,
    trace: Trace,
    // Keeps alive the variables that the network's layers use.
    _store: nn::VarStore,
}

impl BeliefTracker {
    /// A tracker with the weights in `bytes` (safetensors).
    ///
    /// # Errors
    /// If the weights are damaged or belong to another network.
    pub fn new(bytes: &[u8]) -> Result<Self, WeightsError> {
        let store = nn::VarStore::new(Device::Cpu);
        let network = BeliefNetwork::new(&store.root(), BELIEF_INPUT);
        weights::load(&store, bytes)?;
        let memory = network.blank(WAYS, Device::Cpu);
        Ok(Self { network, memory, trace: Trace::default(), _store: store })
    }

    fn believe(&mut self, seen: &Observation<'_>) -> Vec<f32> {
        let input = self.trace.input(seen.view, seen.focal_power.get());
        let ways: [_; WAYS] = [input, from_other_end(&input)];
        let inputs = Tensor::from_slice(ways.as_flattened()).view([WAYS as i64, 1, BELIEF_INPUT as i64]);

        let (logits, memory) = tch::no_grad(|| self.network.forward(&inputs, &self.memory));
        self.memory = memory;

        // The geometric mean of both beliefs.
        let logarithms = logits.view([WAYS as i64, -1]).log_softmax(1, Kind::Float);
        let pooled = (logarithms.get(0) + logarithms.get(1).flip([0])) / WAYS as f64;
        let mut belief = vec![0.0; BINS];
        pooled.softmax(0, Kind::Float).copy_data(&mut belief, BINS);
        belief
    }
}

impl Policy for BeliefTracker {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Surroundings
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        let belief = self.believe(seen);
        let target = self.trace.aim(seen.focal_power.get(), &belief);
        self.trace.ask(target);
        Decision { target, metric: None, belief: Some(belief.into()) }
    }

    fn look_on(&mut self, seen: &Observation<'_>, asked: FocalPower) -> Option<Arc<[f32]>> {
        let belief = self.believe(seen);
        self.trace.ask(asked.get());
        Some(belief.into())
    }

    fn learn_of(&mut self, blur: BlurRate) {
        self.trace.blur = Some(blur);
    }

    fn forget(&mut self) {
        self.memory = self.network.blank(WAYS, Device::Cpu);
        self.trace = Trace::knowing(self.trace.blur);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::{PATCH_SIDE, Square};

    /// Views of a texture that drifts and is blurred by how far the lens stands from a walking optimum.
    fn view(frame: usize, focal_power: f64) -> View {
        let optimum = 0.6 + 0.2 * (frame as f64 / 6.0).sin();
        let scene = gaussian_blur(&texture(3, 300), 5.0 * (focal_power - optimum).abs());
        let corner = (100 + 2 * frame, 120 - frame);
        let part = |Square { x, y, side }| -> Vec<f32> {
            (0..side * side).map(|i| scene.data[(y + i / side) * scene.width + x + i % side]).collect()
        };
        let patch = part(Square { x: corner.0, y: corner.1, side: PATCH_SIDE });
        View::around(Patch(patch.try_into().unwrap()), corner, (300, 300), part)
    }

    #[test]
    fn a_lens_that_counts_from_the_other_end_is_believed_to_be_in_the_same_place() {
        let weights = include_bytes!("../../../policies/parfocal.safetensors");
        let mut tracker = BeliefTracker::new(weights).unwrap();
        let mut other = BeliefTracker::new(weights).unwrap();

        let mut stands = 0.3;
        let mut travel = 0.0;
        for frame in 0..24 {
            let view = view(frame, stands);
            let at = |focal_power| Observation { view: &view, focal_power: FocalPower::new(focal_power).unwrap() };
            let Decision { target, belief, .. } = tracker.step(&at(stands));
            let mirrored = other.look_on(&at(1.0 - stands), FocalPower::new(1.0 - target).unwrap());

            let belief = belief.unwrap();
            let mirrored = mirrored.unwrap();
            let differ = belief.iter().zip(mirrored.iter().rev()).any(|(a, b)| (a - b).abs() > 1e-4);
            assert!(!differ, "frame {frame}: {belief:?} {mirrored:?}");
            travel += (target - stands).abs();
            stands = target;
        }
        assert!(travel > 0.3, "it moved: {travel}");
    }

    #[test]
    fn counted_from_the_other_end_the_same_frames_are_told_mirrored() {
        let mut trace = Trace::default();
        let mut other = Trace::default();
        for (frame, focal_power) in [0.3, 0.44, 0.41, 0.9, 0.88, 0.2].into_iter().enumerate() {
            let seen = view(frame, focal_power);
            let expected = from_other_end(&trace.input(&seen, focal_power));
            let found = other.input(&seen, 1.0 - focal_power);
            assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-4), "{frame}");

            trace.ask(focal_power + 0.05);
            other.ask(1.0 - focal_power - 0.05);
        }
    }

    #[test]
    fn the_best_place_of_known_beliefs() {
        let belief = |shares: &[(usize, f32)]| {
            let mut belief = [0.0f32; BINS];
            for &(bin, share) in shares {
                belief[bin] = share;
            }
            best(&belief)
        };

        assert!((belief(&[(20, 1.0)]) - 0.5).abs() < 1e-9);
        // Two equally likely neighbours: every place between them is in focus for both, and the sum of the distances to
        // both is the same.
        assert!((0.5..=0.525).contains(&belief(&[(20, 0.5), (21, 0.5)])));
        // Two places too far apart to be in focus for both: the likelier one.
        assert!((belief(&[(10, 0.6), (30, 0.4)]) - 0.25).abs() < 0.01);
        // All places equally likely: the middle.
        assert!((best(&[1.0 / BINS as f32; BINS]) - 0.5).abs() < 0.01);
    }

    #[test]
    fn spreading_keeps_the_mean() {
        for place in [0.0, 0.013, 0.5, 0.987, 1.0] {
            let mut bins = [0.0; BINS];
            spread_over_bins(place, &mut bins);
            let mean: f64 = bins.iter().enumerate().map(|(i, &p)| f64::from(p) * i as f64 / 40.0).sum();
            assert!((mean - place).abs() < 1e-6);
        }
    }

    /// A belief that is certain of the optimum at `place`.
    fn certain(place: f64) -> [f32; BINS] {
        let mut belief = [0.0; BINS];
        spread_over_bins(place, &mut belief);
        belief
    }

    #[test]
    fn moves_are_bounded_and_small_ones_left_out() {
        assert!((target(0.5, &certain(0.9), Way::Neither) - 0.7).abs() < 1e-12);
        assert!((target(0.5, &certain(0.51), Way::Neither) - 0.5).abs() < 1e-12);
        assert!((target(0.5, &certain(0.45), Way::Neither) - 0.45).abs() < 0.01);
    }

    #[test]
    fn a_belief_is_tested_when_the_picture_gets_worse_while_the_lens_stands() {
        let stripes =
            |contrast: f32| Patch(std::array::from_fn(|i| 128.0 + if i % 8 < 4 { contrast } else { -contrast }));
        let mut trace = Trace::default();
        let mut aims = |contrast: f32, frames: usize| -> Vec<f64> {
            let aim = |_| {
                trace.input(&stripes(contrast).into(), 0.5);
                trace.aim(0.5, &certain(0.5))
            };

            (0..frames).map(aim).collect()
        };

        // While the picture stays sharp, the lens stands still, however long.
        assert!(aims(40.0, 200).iter().all(|aim| (aim - 0.5).abs() < 1e-9));
        // A third less sharp: once the smoothed sharpness shows this, it looks aside.
        let after = aims(27.0, 10);
        assert!((after[0] - 0.5).abs() < 1e-9 && (after[9] - 0.5).abs() > 0.05, "{after:?}");
    }

    #[test]
    fn it_stands_still_only_where_no_scale_shows_anything() {
        let flat = Patch([90.0; 1024]);
        let stripes = Patch(std::array::from_fn(|i| 128.0 + if i % 8 < 4 { 40.0 } else { -40.0 }));
        let stands = |wider| {
            let mut trace = Trace::default();
            trace.input(&View { wider, ..flat.into() }, 0.5);
            (trace.aim(0.5, &certain(0.9)) - 0.5).abs() < 1e-9
        };

        assert!(stands([None; 2]) && stands([Some(flat); 2]));
        assert!(!stands([Some(flat), Some(stripes)]));
    }

    #[test]
    fn an_absent_patch_gives_zeros_and_a_present_one_its_values_scale_by_scale() {
        let stripes = |width: usize| Patch(std::array::from_fn(|i| if i % (2 * width) < width { 90.0 } else { 160.0 }));
        let fine = stripes(2);
        let coarse = stripes(8);
        let input = |wider| Trace::default().input(&View { wider, ..fine.into() }, 0.5);
        let alone = input([None; 2]);
        assert!(alone[NEAR_INPUT..].iter().all(|value| value.abs() < f32::EPSILON));
        let both = input([Some(fine), Some(coarse)]);
        assert_eq!(both[..NEAR_INPUT], alone[..NEAR_INPUT]);
        // The same patch at the middle scale has the same features. Another patch at the coarsest scale has others.
        assert_eq!(both[NEAR_INPUT..][..FEATURES], alone[..FEATURES]);
        let coarsest = &both[NEAR_INPUT + WIDER_INPUT..];
        assert!(coarsest[0] > alone[0] && (coarsest[WIDER_INPUT - 1] - 1.0).abs() < f32::EPSILON);
    }

    #[test]
    fn the_blur_rate_is_an_input_if_it_is_known() {
        let patch = Patch(std::array::from_fn(|i| if i % 4 < 2 { 90.0 } else { 160.0 }));
        let view = View::from(patch);
        let unknown = Trace::default().input(&view, 0.5);
        assert!(unknown[SEEN_INPUT..].iter().all(|value| value.abs() < f32::EPSILON));

        let known = Trace::knowing(BlurRate::new(12.0)).input(&view, 0.5);
        assert_eq!(known[..SEEN_INPUT], unknown[..SEEN_INPUT]);
        assert!((known[SEEN_INPUT] - 1.0).abs() < f32::EPSILON);
        assert!((known[SEEN_INPUT + 1] - std::f32::consts::LN_2).abs() < 1e-6);
    }

    #[test]
    fn a_tracker_that_is_not_assured_looks_on_the_likelier_side() {
        let likelier = |bin: usize| {
            let mut belief = [1.0 / BINS as f32; BINS];
            belief[bin] += 0.02;
            belief
        };

        // The middle is the best place under both beliefs, but nothing would be learned there.
        assert!((target(0.5, &likelier(33), Way::Neither) - 0.54).abs() < 1e-9);
        assert!((target(0.5, &likelier(7), Way::Neither) - 0.46).abs() < 1e-9);
        assert!((0.0..=1.0).contains(&target(0.01, &likelier(7), Way::Neither)));
    }

    #[test]
    fn while_it_looks_it_turns_round_only_for_what_is_much_likelier() {
        // All within a depth of focus of 0.5 except for two places, below and above.
        let beside = |below: f32, above: f32| {
            let mut belief = [0.0f32; BINS];
            belief[20] = 1.0 - below - above;
            belief[14] = below;
            belief[26] = above;
            belief
        };
        let goes_up = |belief: [f32; BINS], way| target(0.5, &belief, way) > 0.5;
        let twice_below = beside(0.2, 0.1);
        assert!(
            !goes_up(twice_below, Way::Neither) && goes_up(twice_below, Way::Up) && !goes_up(twice_below, Way::Down)
        );
        let much_below = beside(0.2, 0.04);
        assert!(!goes_up(much_below, Way::Up));
        assert!(!goes_up(beside(0.1, 0.2), Way::Down) && goes_up(beside(0.04, 0.2), Way::Down));
    }

    #[test]
    fn its_way_is_that_of_its_last_move() {
        let stripes = Patch(std::array::from_fn(|i| if i % 8 < 4 { 90.0 } else { 160.0 }));
        let mut trace = Trace::default();
        let mut way = |stands: f64, asked: f64| {
            trace.input(&stripes.into(), stands);
            trace.ask(asked);
            trace.way
        };
        assert_eq!(way(0.5, 0.5), Way::Neither);
        assert_eq!(way(0.5, 0.54), Way::Up);
        assert_eq!(way(0.54, 0.54), Way::Up, "to stand still is no turn");
        assert_eq!(way(0.54, 0.4), Way::Down);
    }
}
