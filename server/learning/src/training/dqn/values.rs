//! A value network as training runs it: on frames in their compact form. The gradient of its head is written by hand,
//! and on the CPU that of its encoder too.

use tch::{Device, Kind, Tensor, nn};

use super::batch::Batch;
use super::encoder::Encoder;
use super::head::Pass;
use super::replay::Frames;
use crate::training::optimiser::{Flat, parts};
use parfocal_autofocus::learned::{Input, ValueNetwork};
use parfocal_autofocus::networks::HISTORY;
use parfocal_autofocus::weights::floats;
use parfocal_imaging::PATCH_SIDE;

const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;

/// A network and its variables.
pub(super) struct Values {
    pub store: nn::VarStore,
    pub network: ValueNetwork,
    /// The encoder with gradients by hand, on the CPU; `None` elsewhere, and for policies without an encoder.
    by_hand: Option<Encoder>,
}

impl Values {
    /// A network with random weights on `device`.
    pub fn new(input: Input, device: Device) -> Self {
        let store = nn::VarStore::new(device);
        let network = ValueNetwork::new(&store.root(), input);
        let by_hand = Encoder::of(&store, "encoder");
        Self { store, network, by_hand }
    }

    /// Encodings `[N, width]` of frames. Unless the encoder is by hand, libtorch records them for its own gradients.
    pub fn encode(&self, frames: &Frames) -> Tensor {
        if let Some(encoder) = &self.by_hand {
            let width = self.network.input.width() as i64;
            return Tensor::from_slice(&encoder.encode(&frames.patches)).view([-1, width]);
        }

        let device = self.store.device();
        let frames = if frames.metrics.is_empty() {
            Tensor::from_slice(&frames.patches).to_device(device).view([-1, PIXELS as i64]).to_kind(Kind::Float)
        } else {
            Tensor::from_slice(&frames.metrics).to_device(device).view([-1, 1])
        };

        self.network.encode(&frames)
    }

    /// Runs the head on all states of the batch, from the encodings of its frames.
    pub fn pass(&self, batch: &Batch, encodings: &Tensor) -> Pass {
        let states = tch::no_grad(|| {
            let histories = encodings.index_select(0, &batch.history).view([batch.states.len() as i64, -1]);
            Tensor::cat(&[&histories, &batch.focal_powers], 1)
        });
        Pass::through(&self.network.head, &states)
    }

    /// The gradient of a loss with respect to all variables (`flat`). `grad_output` (`[S, 3]`) is the loss's gradient
    /// with respect to the values of `pass`.
    pub fn gradient(&self, flat: &Flat, batch: &Batch, encodings: &Tensor, pass: Pass, grad_output: &Tensor) -> Tensor {
        let gradient = flat.values.empty_like();
        let parts = parts(&gradient, &flat.variables);

        // In the order of names, the encoder's variables come before the head's. Each layer has a bias and a weight.
        let (encoder, head) = parts.split_at(parts.len() - 2 * self.network.head.layers.len());
        let by_states = pass.back(grad_output, head);
        if encoder.is_empty() {
            return gradient;
        }

        let width = self.network.input.width() as i64;
        let by_histories = by_states.narrow(1, 0, HISTORY as i64 * width).reshape([-1, width]);
        let by_encodings = encodings.zeros_like().index_add_(0, &batch.history, &by_histories);

        if let Some(by_hand) = &self.by_hand {
            let found = by_hand.gradient(&batch.frames.patches, &floats(&by_encodings));
            gradient.narrow(0, 0, found.len() as i64).copy_(&Tensor::from_slice(&found));
        } else {
            // A loss whose gradient with respect to the encodings is `by_encodings`.
            let loss = (encodings * by_encodings).sum(Kind::Float);
            let found = Tensor::run_backward(&[loss], &flat.variables[..encoder.len()], false, false);
            for (part, found) in encoder.iter().zip(&found) {
                part.shallow_clone().copy_(found);
            }
        }

        gradient
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::training::dqn::drawn::{draw_variables, drawn};
    use crate::training::dqn::replay::Transition;
    use parfocal_autofocus::networks::compute_on_this_thread;

    /// Windows of twelve frames of noise. Every other window begins a scan; the others begin in the middle of one, so
    /// the histories of their first frames are incomplete.
    fn batch(windows: u16, rng: &mut ChaCha8Rng) -> Batch {
        const WINDOW: u16 = 12;
        let mut frames = Frames::default();
        frames.patches.extend((0..usize::from(windows * WINDOW) * PIXELS).map(|_| rng.random_range(20..220u8)));
        let transition = |age| Transition { focal_power: f32::from(age) / 50.0, next_optimum: 0.5, action: 1, age };
        let begins = (0..windows).map(|window| 30 * (window % 2));
        let transitions = begins.flat_map(|begin| (begin..begin + WINDOW).map(transition)).collect();
        Batch::new(frames, transitions, usize::from(WINDOW), Device::Cpu)
    }

    #[test]
    fn gradients_by_hand_are_those_that_libtorch_records() {
        compute_on_this_thread();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let batch = batch(2, &mut rng);
        assert!(batch.states.len() > 12, "the first window's states reach back as far as the scan goes");
        let mut values = Values::new(Input::Patch, Device::Cpu);
        draw_variables(&values.store, &mut rng);
        let flat = Flat::of(&values.store);
        let grad_output = drawn(&mut rng, &[batch.states.len() as i64, 3]);

        let histories = values.network.encode(&as_floats(&batch)).index_select(0, &batch.history);
        let found = values.network.values(&histories.view([batch.states.len() as i64, -1]), &batch.focal_powers);
        let expected = flat.gradient(&(&grad_output * found).sum(Kind::Float));

        for by_hand in [true, false] {
            if !by_hand {
                values.by_hand = None;
            }
            let encodings = values.encode(&batch.frames);
            let pass = values.pass(&batch, &encodings);
            let gradient = values.gradient(&flat, &batch, &encodings, pass, &grad_output);
            let difference = (&gradient - &expected).abs().max().double_value(&[]);
            let scale = expected.abs().max().double_value(&[]);
            assert!(difference < 1e-4 * scale, "encoder by hand {by_hand}: {difference} of {scale}");
        }
    }

    #[test]
    fn gradients_do_not_depend_on_how_many_cores_share_them() {
        let gradient = |threads| {
            let work = || {
                compute_on_this_thread();
                let mut rng = ChaCha8Rng::seed_from_u64(3);
                let batch = batch(80, &mut rng);
                let values = Values::new(Input::Patch, Device::Cpu);
                draw_variables(&values.store, &mut rng);
                let flat = Flat::of(&values.store);
                let encodings = values.encode(&batch.frames);
                let pass = values.pass(&batch, &encodings);
                let grad_output = pass.values.shallow_clone();
                floats(&values.gradient(&flat, &batch, &encodings, pass, &grad_output))
            };
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
        };

        let alone = gradient(1);
        assert!(alone.iter().any(|&slope| slope.abs() > 1e-3));
        assert!([2, 5].into_iter().all(|threads| gradient(threads) == alone));
    }

    fn as_floats(batch: &Batch) -> Tensor {
        Tensor::from_slice(&batch.frames.patches).view([-1, PIXELS as i64]).to_kind(Kind::Float)
    }
}
