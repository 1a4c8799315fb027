//! The policy `parfocal`: tracks a belief about where the optimum is, and goes to that belief's median.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "indices of 41 bins"
)]

use tch::{Device, Kind, Tensor, nn};

use super::networks::{BELIEF_INPUT, BINS, BeliefNetwork};
use super::registration::{CHANGES, changes};
use super::spectrum::{FEATURES, Spectrum, features, spectrum};
use super::weights::{self, WeightsError};
use super::{Decision, Observation, Policy};
use crate::imaging::Patch;

/// Most focal power a frame: a lens can jump, but a surgeon should not see it.
pub const MAX_MOVE: f64 = 0.1;
/// Moves below this are not worth the eye's attention.
pub const LEAST_MOVE: f64 = 0.012;

/// What the tracker remembers of the frame before.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    last: Option<Box<Frame>>,
    asked: Option<f32>,
}

#[derive(Debug, Clone)]
struct Frame {
    patch: Patch,
    spectrum: Spectrum,
    features: [f32; FEATURES],
    focal_power: f32,
}

impl Trace {
    /// The network's input for a frame that shows `patch`, seen at `focal_power`.
    pub fn input(&mut self, patch: &Patch, focal_power: f64) -> [f32; BELIEF_INPUT] {
        let spectrum = spectrum(patch);
        let features = features(patch, &spectrum);
        let focal_power = focal_power as f32;
        let now = Box::new(Frame { patch: *patch, spectrum, features, focal_power });
        let before = self.last.as_ref().unwrap_or(&now);
        let mut input = [0.0; BELIEF_INPUT];
        let (appearance, rest) = input.split_at_mut(FEATURES);
        appearance.copy_from_slice(&features);
        let (difference, rest) = rest.split_at_mut(FEATURES);
        for (index, change) in difference.iter_mut().enumerate() {
            *change = 4.0 * (features[index] - before.features[index]);
        }
        let (registered, rest) = rest.split_at_mut(CHANGES);
        registered.copy_from_slice(&changes((&before.patch, &before.spectrum), (&now.patch, &now.spectrum)));
        let (stands, moved) = rest.split_at_mut(BINS);
        spread_over_bins(f64::from(focal_power), stands);
        moved[0] = 2.0 * (focal_power - 0.5);
        moved[1] = 10.0 * (focal_power - before.focal_power);
        moved[2] = 10.0 * (self.asked.unwrap_or(focal_power) - focal_power);
        self.last = Some(now);
        input
    }

    /// Notes the focal power that was asked for after the frame.
    pub const fn ask(&mut self, target: f64) {
        self.asked = Some(target as f32);
    }
}

/// Shares one unit between the two bins around `place` (0..=1), so that the bins' mean is `place`.
pub fn spread_over_bins(place: f64, bins: &mut [f32]) {
    let last = bins.len() - 1;
    let at = place.clamp(0.0, 1.0) * last as f64;
    let lower = (at as usize).min(last.saturating_sub(1));
    bins[lower] += (1.0 - (at - lower as f64)) as f32;
    bins[lower + 1] += (at - lower as f64) as f32;
}

/// Median of a belief whose bin `i` stands for `i / (bins - 1)` and whose mass lies evenly between neighbours' middles.
#[must_use]
pub fn median(belief: &[f32]) -> f64 {
    let half = 0.5 * belief.iter().map(|&p| f64::from(p)).sum::<f64>();
    let mut below = 0.0;
    for (index, &share) in belief.iter().enumerate() {
        let share = f64::from(share);
        if below + share >= half {
            let within = if share > 0.0 { (half - below) / share } else { 0.5 };
            return ((index as f64 - 0.5 + within) / (belief.len() - 1) as f64).clamp(0.0, 1.0);
        }
        below += share;
    }
    0.5
}

/// Where to go from `focal_power` when the optimum is believed at `best`.
#[must_use]
pub fn target(focal_power: f64, best: f64) -> f64 {
    let step = (best - focal_power).clamp(-MAX_MOVE, MAX_MOVE);
    if step.abs() < LEAST_MOVE { focal_power } else { focal_power + step }
}

/// The belief tracker as a policy. One instance follows one scan.
pub struct BeliefTracker {
    network: BeliefNetwork,
    memory: Tensor,
    trace: Trace,
    // Keeps the variables alive that the network's layers share.
    _store: nn::VarStore,
}

impl BeliefTracker {
    /// A tracker with the weights in `bytes` (safetensors).
    ///
    /// # Errors
    /// When the weights are damaged or another network's.
    pub fn new(bytes: &[u8]) -> Result<Self, WeightsError> {
        let store = nn::VarStore::new(Device::Cpu);
        let network = BeliefNetwork::new(&store.root());
        weights::load(&store, bytes)?;
        let memory = network.blank(1, Device::Cpu);
        Ok(Self { network, memory, trace: Trace::default(), _store: store })
    }

    fn believe(&mut self, seen: &Observation<'_>) -> Vec<f32> {
        let input = self.trace.input(seen.patch, seen.focal_power.get());
        let input = Tensor::from_slice(&input).view([1, 1, BELIEF_INPUT as i64]);
        let (logits, memory) = tch::no_grad(|| self.network.forward(&input, &self.memory));
        self.memory = memory;
        let mut belief = vec![0.0; BINS];
        logits.view([-1]).softmax(0, Kind::Float).copy_data(&mut belief, BINS);
        belief
    }
}

impl Policy for BeliefTracker {
    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        let belief = self.believe(seen);
        let target = target(seen.focal_power.get(), median(&belief));
        self.trace.ask(target);
        Decision { target, metric: None, belief: Some(belief.into()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_known_beliefs() {
        let mut belief = [0.0f32; BINS];
        belief[20] = 1.0;
        assert!((median(&belief) - 0.5).abs() < 1e-9);
        // Three quarters at 0.25, a quarter at 0.75: two thirds into the bin at 0.25, which is 0.025 wide.
        let mut belief = [0.0f32; BINS];
        (belief[10], belief[30]) = (0.75, 0.25);
        assert!((median(&belief) - (0.2375 + 0.025 * 2.0 / 3.0)).abs() < 1e-9);
        assert!((median(&[1.0 / 41.0; BINS]) - 0.5).abs() < 1e-6);
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

    #[test]
    fn moves_are_bounded_and_small_ones_left_out() {
        assert!((target(0.5, 0.9) - 0.6).abs() < 1e-12);
        assert!((target(0.5, 0.51) - 0.5).abs() < 1e-12);
        assert!((target(0.5, 0.47) - 0.47).abs() < 1e-12);
    }
}
