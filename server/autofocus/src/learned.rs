//! The paper's learned policies: a network gives action values for the latest eight frames, and the best action is
//! taken.

use tch::{Device, Tensor, nn};

use super::networks::{ACTIONS, ENCODING, Encoder, HISTORY, ValueHead};
use super::weights::{self, WeightsError};
use super::{Decision, FieldOfView, Observation, Policy, STEP, mgm, mlr};
use parfocal_imaging::Patch;

/// What a learned policy sees of each frame besides the focal power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// The mean gradient magnitude.
    Mgm,
    /// The mean local ratio.
    Mlr,
    /// The whole patch, through the encoder.
    Patch,
}

impl Input {
    /// Numbers per frame in the head's input, without the focal power.
    pub const fn width(self) -> usize {
        match self {
            Self::Mgm | Self::Mlr => 1,
            Self::Patch => ENCODING,
        }
    }

    /// The focus metric of `patch`; `None` if this input is the whole patch.
    pub fn metric(self, patch: &Patch) -> Option<f64> {
        match self {
            Self::Mgm => Some(mgm(patch)),
            Self::Mlr => Some(mlr(patch)),
            Self::Patch => None,
        }
    }

    /// A metric as an input of the network: its logarithm, centred and scaled to the order of 1.
    pub fn scaled(self, metric: f64) -> f32 {
        match self {
            Self::Mgm => ((metric + 0.5).ln() - 3.5) as f32,
            Self::Mlr | Self::Patch => (0.5 * ((metric - 1.0).max(0.0) + 1e-4).ln() + 1.75) as f32,
        }
    }
}

/// The change of focal power of an action: 0 is a step down, 1 none, 2 a step up.
pub const fn action_step(action: usize) -> f64 {
    match action {
        0 => -STEP,
        1 => 0.0,
        _ => STEP,
    }
}

/// A focal power as an input of the networks: from -1 to 1.
pub const fn scaled_focal_power(focal_power: f64) -> f32 {
    2.0 * (focal_power as f32 - 0.5)
}

/// A policy's network: the head, and an encoder if the policy sees patches.
#[derive(Debug)]
pub struct ValueNetwork {
    /// What the policy sees of each frame.
    pub input: Input,
    encoder: Option<Encoder>,
    /// Computes action values from the histories.
    pub head: ValueHead,
}

impl ValueNetwork {
    /// A network with random weights under `path`.
    pub fn new(path: &nn::Path<'_>, input: Input) -> Self {
        let encoder = (input == Input::Patch).then(|| Encoder::new(&(path / "encoder")));
        let head = ValueHead::new(&(path / "head"), HISTORY * (input.width() + 1));
        Self { input, encoder, head }
    }

    /// Encodes frames, `[N, 1024]` (gray) or `[N, 1]` (scaled metric), as inputs of the head: `[N, width]`.
    pub fn encode(&self, frames: &Tensor) -> Tensor {
        self.encoder.as_ref().map_or_else(|| frames.shallow_clone(), |encoder| encoder.forward(frames))
    }

    /// Action values `[N, 3]` from the histories' encodings `[N, 8 * width]` and scaled focal powers `[N, 8]`, oldest
    /// first.
    pub fn values(&self, encodings: &Tensor, focal_powers: &Tensor) -> Tensor {
        self.head.forward(&Tensor::cat(&[encodings, focal_powers], 1))
    }
}

/// The latest eight frames of a scan, oldest first. Before there are eight, the first fills the places of those missing.
#[derive(Debug, Default)]
pub struct History {
    /// All frames' values, as many of each frame.
    pub frames: Vec<f32>,
    /// The focal power of each frame.
    pub focal_powers: Vec<f32>,
}

impl History {
    /// Remembers the values of another frame and its focal power, in place of the oldest.
    pub fn push(&mut self, frame: &[f32], focal_power: f32) {
        if self.focal_powers.is_empty() {
            self.frames = frame.repeat(HISTORY);
            self.focal_powers = vec![focal_power; HISTORY];
            return;
        }

        self.frames.drain(..frame.len());
        self.frames.extend_from_slice(frame);
        self.focal_powers.remove(0);
        self.focal_powers.push(focal_power);
    }
}

/// A learned policy with its memory of eight frames.
pub struct Learned {
    network: ValueNetwork,
    history: History,
    // Keeps alive the variables that the network's layers use.
    _store: nn::VarStore,
}

impl Learned {
    /// A policy with the weights in `bytes` (safetensors).
    ///
    /// # Errors
    /// If the weights are damaged or belong to another network.
    pub fn new(input: Input, bytes: &[u8]) -> Result<Self, WeightsError> {
        let store = nn::VarStore::new(Device::Cpu);
        let network = ValueNetwork::new(&store.root(), input);
        weights::load(&store, bytes)?;
        Ok(Self { network, history: History::default(), _store: store })
    }

    fn encode(&self, patch: &Patch, metric: Option<f64>) -> Vec<f32> {
        if let Some(metric) = metric {
            return vec![self.network.input.scaled(metric)];
        }

        let encoding = self.network.encode(&Tensor::from_slice(&patch.0).view([1, -1]));
        let mut values = vec![0.0; ENCODING];
        encoding.view([-1]).copy_data(&mut values, ENCODING);
        values
    }
}

impl Policy for Learned {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Patch
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        tch::no_grad(|| {
            let metric = self.network.input.metric(&seen.view.patch);
            let encoding = self.encode(&seen.view.patch, metric);
            self.history.push(&encoding, scaled_focal_power(seen.focal_power.get()));

            let row = |values: &[f32]| Tensor::from_slice(values).view([1, -1]);
            let mut values = [0.0f32; ACTIONS];
            let found = self.network.values(&row(&self.history.frames), &row(&self.history.focal_powers));
            found.view([-1]).copy_data(&mut values, ACTIONS);

            let step = action_step(best_action(&values));
            Decision { target: seen.focal_power.moved(step).get(), metric, belief: None }
        })
    }

    fn forget(&mut self) {
        self.history = History::default();
    }
}

/// The action of highest value. Standing still wins a tie with a move.
pub fn best_action(values: &[f32]) -> usize {
    [1, 0, 2].into_iter().reduce(|best, other| if values[other] > values[best] { other } else { best }).unwrap_or(1)
}
