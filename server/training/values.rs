//! A value network as training runs it: on frames in their compact form, and on the processor with the encoder by hand.
#![allow(clippy::cast_possible_wrap, reason = "small counts as tensor sizes")]

use tch::{Device, Kind, Tensor, nn};

use super::encoder::Encoder;
use super::optimiser::{Flat, joined};
use super::replay::Frames;
use crate::autofocus::learned::{Sight, ValueNetwork};
use crate::imaging::PATCH_SIDE;

const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;

/// A network and its variables.
pub(super) struct Values {
    pub store: nn::VarStore,
    pub network: ValueNetwork,
    by_hand: Option<Encoder>,
}

impl Values {
    /// A fresh network on `device`.
    pub fn new(sight: Sight, device: Device) -> Self {
        let store = nn::VarStore::new(device);
        let network = ValueNetwork::new(&store.root(), sight);
        let by_hand = Encoder::of(&store, "encoder");
        Self { store, network, by_hand }
    }

    /// Encodings `[N, width]` of frames. What follows can be differentiated by them even where they are made by hand.
    pub fn encode(&self, frames: &Frames) -> Tensor {
        if let Some(encoder) = &self.by_hand {
            let width = self.network.sight.width() as i64;
            return Tensor::from_slice(&encoder.encode(&frames.patches)).view([-1, width]).set_requires_grad(true);
        }
        let device = self.store.device();
        let frames = if frames.metrics.is_empty() {
            Tensor::from_slice(&frames.patches).to_device(device).view([-1, PIXELS as i64]).to_kind(Kind::Float)
        } else {
            Tensor::from_slice(&frames.metrics).to_device(device).view([-1, 1])
        };
        self.network.encode(&frames)
    }

    /// The gradient of `loss` by all variables, which are `flat`, where `encodings` are what [`Values::encode`] made of
    /// `frames`.
    pub fn gradient(&self, flat: &Flat, loss: &Tensor, encodings: &Tensor, frames: &Frames) -> Tensor {
        let Some(encoder) = &self.by_hand else { return flat.gradient(loss) };
        // By name, the encoder's variables come before the head's.
        let mut inputs = vec![encodings];
        inputs.extend(&flat.variables[Encoder::VARIABLES..]);
        let mut gradients = Tensor::run_backward(&[loss], &inputs, false, false);
        let mut slopes = vec![0.0f32; encodings.numel()];
        gradients[0].contiguous().copy_data(&mut slopes, encodings.numel());
        gradients[0] = Tensor::from_slice(&encoder.gradient(&frames.patches, &slopes));
        joined(&gradients)
    }
}
