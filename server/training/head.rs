//! The value head's gradient by hand: a third of the operations that libtorch records and replays, which it is tested against.

use tch::Tensor;
use tch::nn::Module;

use crate::autofocus::networks::ValueHead;

/// What a head made of states, with all that its gradient needs.
#[derive(Debug)]
pub(super) struct Pass {
    /// What each layer took: `[S, input]`, then twice `[S, 256]`.
    inputs: [Tensor; 3],
    /// Action values `[S, 3]`.
    pub values: Tensor,
}

impl Pass {
    /// Action values of states `[S, input]` by `head`. Nothing is recorded for libtorch's own gradients.
    pub fn through(head: &ValueHead, states: Tensor) -> Self {
        tch::no_grad(|| {
            let [first, second, third] = &head.layers;
            let hidden = first.forward(&states).relu_();
            let later = second.forward(&hidden).relu_();
            let values = third.forward(&later);
            Self { inputs: [states, hidden, later], values }
        })
    }

    /// Writes to `gradient`, which has the shapes of the variables of `head` in the order of their names, the gradient of a
    /// loss whose gradient by the values is `slopes` (`[S, 3]`). Returns its gradient by the first layer's output before its
    /// `ReLU`.
    pub fn back(&self, head: &ValueHead, slopes: Tensor, gradient: &[Tensor]) -> Tensor {
        tch::no_grad(|| {
            let mut slopes = slopes;
            for (index, (layer, input)) in head.layers.iter().zip(&self.inputs).enumerate().rev() {
                let _ = slopes.sum_intlist_out(&gradient[2 * index], 0, false, None);
                let _ = slopes.tr().mm_out(&gradient[2 * index + 1], input);
                if index > 0 {
                    // What a ReLU let through is above zero.
                    slopes = input.threshold_backward(&slopes.mm(&layer.ws), 0);
                }
            }
            slopes
        })
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind, nn};

    use super::*;

    #[test]
    fn values_and_gradients_are_libtorchs() {
        tch::set_num_threads(1);
        tch::manual_seed(7);
        let store = nn::VarStore::new(Device::Cpu);
        let reference = ValueHead::new(&(store.root() / "head"), 16);
        // Fresh biases are zero, which would hide that they are used.
        for mut variable in store.trainable_variables() {
            let _ = tch::no_grad(|| variable.g_add_(&(variable.randn_like() * 0.1)));
        }
        let states = Tensor::randn([34, 16], (Kind::Float, Device::Cpu)).set_requires_grad(true);
        let slopes = Tensor::randn([34, 3], (Kind::Float, Device::Cpu));
        let expected = reference.forward(&states);
        let pass = Pass::through(&reference, states.detach());
        assert!(pass.values.allclose(&expected, 1e-5, 1e-6, false));

        let mut variables: Vec<(String, Tensor)> = store.variables().into_iter().collect();
        variables.sort_by(|a, b| a.0.cmp(&b.0));
        let gradient: Vec<Tensor> = variables.iter().map(|(_, variable)| variable.detach().zeros_like()).collect();
        let by_states = pass.back(&reference, slopes.shallow_clone(), &gradient).mm(&reference.layers[0].ws);
        let mut by: Vec<&Tensor> = variables.iter().map(|(_, variable)| variable).collect();
        by.push(&states);
        let loss = (expected * slopes).sum(Kind::Float);
        let expected = Tensor::run_backward(&[loss], &by, false, false);
        for (found, expected) in gradient.iter().chain([&by_states]).zip(&expected) {
            assert!(found.allclose(expected, 1e-4, 1e-5, false));
        }
    }
}
