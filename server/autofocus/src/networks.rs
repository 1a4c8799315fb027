//! The learned policies' networks: the paper's two (Budd et al., MICCAI 2023), and the belief tracker's.

use tch::nn::{self, Module, ModuleT, RNN};
use tch::{Device, Kind, Tensor};

use super::registration::CHANGES;
use super::spectrum::FEATURES;
use super::tiles::VIEW_INPUT;
use parfocal_imaging::{PATCH_SIDE, WIDER};

/// Number of latest frames that the paper's networks see.
pub const HISTORY: usize = 8;
/// Actions of the paper's networks: a step down, none, a step up.
pub const ACTIONS: usize = 3;
/// Length of the encoding that the paper's encoder makes of a patch.
pub const ENCODING: usize = 8;
/// Focal powers, equally spaced from 0 to 1, over which the belief tracker's posterior is given.
pub const BINS: usize = 41;
/// Units of the belief tracker's GRU.
pub const MEMORY: usize = 320;
/// Inputs from the patch and the lens: features, their change since the last frame, and the change of blur over the
/// texture that both frames show; then the focal power spread over [`BINS`], and three numbers on how it moved.
pub const NEAR_INPUT: usize = 2 * FEATURES + CHANGES + BINS + 3;
/// Inputs from a wider patch: features and changes like those of the patch, and whether the wider patch exists.
pub const WIDER_INPUT: usize = 2 * FEATURES + CHANGES + 1;
/// Inputs from a frame's patches: the patch first, then the wider ones.
pub const SEEN_INPUT: usize = NEAR_INPUT + WIDER.len() * WIDER_INPUT;
/// All inputs of the belief tracker: those from the patches, whether the blur rate of the optics is known, the blur
/// rate, and those from the whole view.
pub const BELIEF_INPUT: usize = SEEN_INPUT + 2 + VIEW_INPUT;

const HIDDEN: i64 = 256;
const SIDE: i64 = PATCH_SIDE as i64;

/// Makes libtorch and its matrix libraries compute on the calling thread only. The setting is per thread. So little
/// work costs more to distribute than to do.
pub fn compute_on_this_thread() {
    tch::set_num_threads(1);
}

/// Computes action values: three dense layers, `input` -> 256 -> 256 -> 3, with `ReLU` between.
#[derive(Debug)]
pub struct ValueHead {
    /// The layers, first to last.
    pub layers: [nn::Linear; 3],
}

impl ValueHead {
    /// A head with random weights under `path`.
    pub fn new(path: &nn::Path<'_>, input: usize) -> Self {
        let input = i64::try_from(input).unwrap_or(i64::MAX);
        let dense = |name, from, to| nn::linear(path / name, from, to, nn::LinearConfig::default());
        let layers = [dense("0", input, HIDDEN), dense("2", HIDDEN, HIDDEN), dense("4", HIDDEN, ACTIONS as i64)];
        Self { layers }
    }

    /// Action values `[N, 3]` of states `[N, input]`.
    pub fn forward(&self, state: &Tensor) -> Tensor {
        let hidden = self.layers[0].forward(state).relu();
        self.layers[2].forward(&self.layers[1].forward(&hidden).relu())
    }
}

/// Four convolutions of 8 filters, kernel 3, stride 2, no padding, with `ReLU` between: 32x32 -> 8 numbers.
#[derive(Debug)]
pub struct Encoder {
    convolutions: [nn::Conv2D; 4],
}

impl Encoder {
    /// An encoder with random weights under `path`.
    pub fn new(path: &nn::Path<'_>) -> Self {
        let config = nn::ConvConfig { stride: 2, ..Default::default() };
        let layer = |name, from| nn::conv2d(path / name, from, ENCODING as i64, 3, config);
        Self { convolutions: [layer("0", 1), layer("2", 8), layer("4", 8), layer("6", 8)] }
    }

    /// Encodings `[N, 8]` of patches `[N, 1024]` on the 0..=255 scale. Each patch is first standardised to mean 0 and
    /// about unit deviation, since brightness and contrast say nothing about focus.
    pub fn forward(&self, patches: &Tensor) -> Tensor {
        let patches = patches.view([-1, SIDE * SIDE]);
        let centred = &patches - patches.mean_dim(1, true, Kind::Float);
        // Plus 2 gray levels, so that a patch with noise alone counts as flat.
        let spread = centred.square().mean_dim(1, true, Kind::Float).sqrt() + 2.0;

        let mut x = (centred / spread).view([-1, 1, SIDE, SIDE]);

        for (index, convolution) in self.convolutions.iter().enumerate() {
            x = convolution.forward_t(&x, false);
            if index < 3 {
                x = x.relu();
            }
        }

        x.view([-1, ENCODING as i64])
    }
}

/// The belief tracker's network: a GRU over frames, and a head that gives a posterior over the next frame's optimum.
#[derive(Debug)]
pub struct BeliefNetwork {
    memory: nn::GRU,
    head: [nn::Linear; 2],
}

impl BeliefNetwork {
    /// A network with `inputs` inputs per frame and random weights under `path`.
    pub fn new(path: &nn::Path<'_>, inputs: usize) -> Self {
        let units = MEMORY as i64;
        let dense = |name, from, to| nn::linear(path / name, from, to, nn::LinearConfig::default());
        Self {
            memory: nn::gru(path / "memory", inputs as i64, units, nn::RNNConfig::default()),
            head: [dense("head_0", units, units), dense("head_2", units, BINS as i64)],
        }
    }

    /// The initial memory of `count` scans: zeros `[1, count, MEMORY]`.
    pub fn blank(&self, count: usize, device: Device) -> Tensor {
        Tensor::zeros([1, i64::try_from(count).unwrap_or(i64::MAX), MEMORY as i64], (Kind::Float, device))
    }

    /// Processes `inputs` (`[N, T, inputs]`), beginning with `memory` (`[1, N, MEMORY]`). Returns logits `[N, T, BINS]`
    /// and the memory after the last frame.
    pub fn forward(&self, inputs: &Tensor, memory: &Tensor) -> (Tensor, Tensor) {
        let (units, state) = self.memory.seq_init(inputs, &nn::GRUState(memory.shallow_clone()));
        let hidden = self.head[0].forward(&units).relu();
        (self.head[1].forward(&hidden), state.value())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters(store: &nn::VarStore) -> usize {
        store.trainable_variables().iter().map(Tensor::numel).sum()
    }

    #[test]
    fn the_papers_networks_have_its_shapes_and_sizes() {
        let encoder_store = nn::VarStore::new(Device::Cpu);
        let head_store = nn::VarStore::new(Device::Cpu);
        let encoder = Encoder::new(&encoder_store.root());
        let head = ValueHead::new(&head_store.root(), HISTORY * (ENCODING + 1));
        assert_eq!(parameters(&encoder_store), 1_832);
        assert_eq!(parameters(&head_store), 85_251);
        let encodings = encoder.forward(&Tensor::zeros([5, 1024], (Kind::Float, Device::Cpu)));
        assert_eq!(encodings.size(), [5, 8]);
        assert_eq!(head.forward(&Tensor::zeros([5, 72], (Kind::Float, Device::Cpu))).size(), [5, 3]);
    }

    /// The values that `tests/vectors/pytorch.py` wrote under `name`.
    fn from_pytorch(name: &str) -> Tensor {
        let vectors: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/vectors/pytorch.json")).unwrap();
        let values: Vec<f64> = serde_json::from_value(vectors[name].clone()).unwrap();
        Tensor::from_slice(&values).to_kind(Kind::Float)
    }

    /// The same sines as in `tests/vectors/pytorch.py`.
    fn wave(count: usize, rate: f64, scale: f64, offset: f64) -> Tensor {
        let values: Vec<f64> = (0..count).map(|index| offset + scale * (rate * index as f64).sin()).collect();
        Tensor::from_slice(&values).to_kind(Kind::Float)
    }

    fn fill(store: &nn::VarStore) {
        let mut variables: Vec<_> = store.variables().into_iter().collect();
        variables.sort_by(|a, b| a.0.cmp(&b.0));
        for (k, (_, mut variable)) in variables.into_iter().enumerate() {
            let values = wave(variable.numel(), 0.01f64.mul_add(k as f64, 0.37), 0.2, 0.0).view_as(&variable);
            tch::no_grad(|| variable.copy_(&values));
        }
    }

    #[test]
    fn the_cnn_gives_what_pytorch_gives() {
        let store = nn::VarStore::new(Device::Cpu);
        let encoder = Encoder::new(&(store.root() / "encoder"));
        let head = ValueHead::new(&(store.root() / "head"), HISTORY * (ENCODING + 1));
        fill(&store);
        let encodings = encoder.forward(&wave(8 * 1024, 0.113, 100.0, 128.0).view([8, 1024])).view([-1]);
        assert!(encodings.allclose(&from_pytorch("cnn_encodings"), 1e-4, 1e-5, false));
        let state = Tensor::cat(&[encodings, wave(8, 0.7, 1.0, 0.0)], 0).view([1, -1]);
        assert!(head.forward(&state).view([-1]).allclose(&from_pytorch("cnn_values"), 1e-4, 1e-5, false));
    }

    #[test]
    fn the_belief_tracker_gives_what_pytorch_gives() {
        /// As many as in `tests/vectors/pytorch.py`. The network is the same for any number of inputs.
        const INPUTS: usize = 177;
        let store = nn::VarStore::new(Device::Cpu);
        let network = BeliefNetwork::new(&store.root(), INPUTS);
        fill(&store);

        let inputs = wave(2 * 5 * INPUTS, 0.29, 1.0, 0.0).view([2, 5, INPUTS as i64]);
        let (logits, _) = network.forward(&inputs, &network.blank(2, Device::Cpu));
        let found = logits.select(1, 4).contiguous().view([-1]);
        assert!(found.allclose(&from_pytorch("belief_logits"), 1e-4, 1e-5, false));
    }

    #[test]
    fn the_belief_tracker_goes_frame_by_frame_as_over_a_whole_scan() {
        tch::manual_seed(1);
        let store = nn::VarStore::new(Device::Cpu);
        let network = BeliefNetwork::new(&store.root(), BELIEF_INPUT);
        let inputs = Tensor::randn([2, 6, BELIEF_INPUT as i64], (Kind::Float, Device::Cpu));
        let (whole, _) = network.forward(&inputs, &network.blank(2, Device::Cpu));
        let mut memory = network.blank(2, Device::Cpu);
        let mut last = Tensor::new();
        for t in 0..6 {
            (last, memory) = network.forward(&inputs.narrow(1, t, 1), &memory);
        }
        assert!(last.allclose(&whole.narrow(1, 5, 1), 1e-4, 1e-5, false));
    }
}
