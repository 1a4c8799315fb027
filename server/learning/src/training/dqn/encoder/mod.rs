//! The paper's CNN encoder for training on the CPU, with gradients written by hand. Its tests compare it with
//! `networks::Encoder`, the reference, which works on every device and in the live loop.

mod kernels;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use tch::{Device, Tensor, nn};

use kernels::{FILTERS, Lanes, TAPS, Weights};

/// Names of the encoder's layers in a store.
const LAYERS: [&str; 4] = ["0", "2", "4", "6"];
/// Patches that a core encodes at a time.
const ENCODED_AT_ONCE: usize = 16;
/// Patches whose gradients a core sums at a time. The sums are added in a fixed order, so the number of cores does not
/// change a digit.
const SUMMED_AT_ONCE: usize = 64;

/// An encoder that uses the present values of a store's variables.
#[derive(Debug)]
pub struct Encoder {
    /// Bias and weight of each layer, shared with the store.
    variables: [[Tensor; 2]; 4],
}

impl Encoder {
    /// The encoder whose variables are under `path` in `store`; `None` if there is none, or it is not on the CPU.
    pub fn of(store: &nn::VarStore, path: &str) -> Option<Self> {
        if store.device() != Device::Cpu {
            return None;
        }

        let mut variables = store.variables();
        let mut take = |layer: &str, part: &str| variables.remove(&format!("{path}.{layer}.{part}"));
        let mut layer = |name: &str| Some([take(name, "bias")?, take(name, "weight")?]);

        let [first, second, third, fourth] = LAYERS;
        Some(Self { variables: [layer(first)?, layer(second)?, layer(third)?, layer(fourth)?] })
    }

    /// Encodings `[N, 8]` of patches `[N, 1024]`, row after row.
    pub fn encode(&self, patches: &[u8]) -> Vec<f32> {
        let weights = self.weights();
        let patches = patches.as_chunks().0;
        let mut encodings = vec![Lanes::default(); patches.len()];

        let parts = patches.par_chunks(ENCODED_AT_ONCE).zip(encodings.par_chunks_mut(ENCODED_AT_ONCE));
        parts.for_each(|(patches, encodings)| kernels::encode(&weights, patches, encodings));
        encodings.into_flattened()
    }

    /// The gradient of a loss with respect to all variables, one after another in the order of their names.
    /// `grad_output` is the loss's gradient with respect to the encodings `[N, 8]` of `patches` (`[N, 1024]`).
    pub fn gradient(&self, patches: &[u8], grad_output: &[f32]) -> Vec<f32> {
        let weights = self.weights();
        let patches = patches.as_chunks().0;
        let grad_output = grad_output.as_chunks().0;

        let parts = patches.par_chunks(SUMMED_AT_ONCE).zip(grad_output.par_chunks(SUMMED_AT_ONCE));
        let sum = |(patches, grad_output): (&[_], &[_])| {
            let mut gradient = Weights::default();
            kernels::add_gradients(&weights, patches, grad_output, &mut gradient);
            flat(&gradient)
        };

        let sums: Vec<Vec<f32>> = parts.map(sum).collect();
        sums.into_iter().reduce(added).unwrap_or_else(|| flat(&Weights::default()))
    }

    fn weights(&self) -> Weights {
        let mut weights = Weights::default();
        for (layer, [bias, weight]) in self.variables.iter().enumerate() {
            bias.copy_data(&mut weights.biases[layer], FILTERS);
            // PyTorch's layout: filter by filter, channel by channel, tap by tap.
            let mut values = [0.0f32; FILTERS * FILTERS * TAPS];
            weight.copy_data(&mut values, weight.numel());
            let channels = weight.numel() / (FILTERS * TAPS);

            for (index, value) in values[..weight.numel()].iter().enumerate() {
                *weights.slot(layer, index, channels) = *value;
            }
        }
        weights
    }
}

fn added(mut sum: Vec<f32>, more: Vec<f32>) -> Vec<f32> {
    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    sum
}

/// All weights in the order of the variables' names, each in `PyTorch`'s layout.
fn flat(weights: &Weights) -> Vec<f32> {
    let mut weights = weights.clone();
    let mut all = Vec::with_capacity(4 * FILTERS + (1 + 3 * FILTERS) * FILTERS * TAPS);
    for layer in 0..LAYERS.len() {
        let channels = if layer == 0 { 1 } else { FILTERS };
        all.extend(weights.biases[layer]);
        all.extend((0..FILTERS * channels * TAPS).map(|index| *weights.slot(layer, index, channels)));
    }
    all
}

impl Weights {
    /// The weight at `index` in `PyTorch`'s layout of a layer with `channels` input channels.
    fn slot(&mut self, layer: usize, index: usize, channels: usize) -> &mut f32 {
        let filter = index / (channels * TAPS);
        let channel = index / TAPS % channels;
        let tap = index % TAPS;

        match layer {
            0 => &mut self.first[tap][filter],
            _ => &mut self.later[layer - 1][tap][channel][filter],
        }
    }
}
