//! The value head's gradient, written by hand. It takes a third of the operations that libtorch records and replays.
//! Tests compare it with libtorch's.

use rayon::prelude::*;
use tch::nn::{Linear, Module};
use tch::{Device, Tensor};

use parfocal_autofocus::networks::{ValueHead, compute_on_this_thread};

/// Most states that a core works on at once. Sums over states are made per part first, and the parts are added in a
/// fixed order. So the number of cores does not change a digit.
const STATES_AT_ONCE: i64 = 256;

/// A head's forward pass over states, with all that its gradient needs.
#[derive(Debug)]
pub(super) struct Pass {
    parts: Vec<Part>,
    /// Action values `[S, 3]`.
    pub values: Tensor,
}

/// The forward pass over some of the states.
#[derive(Debug)]
struct Part {
    /// The head's layers.
    layers: [Linear; 3],
    /// The input of each layer: `[S, input]`, then twice `[S, 256]`.
    inputs: [Tensor; 3],
    values: Tensor,
}

impl Pass {
    /// Runs `head` on `states` (`[S, input]`). Nothing is recorded for libtorch's own gradients.
    pub fn through(head: &ValueHead, states: &Tensor) -> Self {
        let parts = split(states).into_iter().map(|states| (head.layers.each_ref().map(shared), states));
        let parts = on_all_cores(parts.collect(), |(layers, states)| Part::through(layers, states));
        let values: Vec<&Tensor> = parts.iter().map(|part| &part.values).collect();
        Self { values: Tensor::cat(&values, 0), parts }
    }

    /// Propagates `grad_output` (`[S, 3]`), a loss's gradient with respect to the values, back through the head.
    ///
    /// Writes the loss's gradient with respect to the head's variables to `gradient`, which has their shapes, in the
    /// order of their names. Returns the gradient with respect to the states, `[S, input]`.
    pub fn back(self, grad_output: &Tensor, gradient: &[Tensor]) -> Tensor {
        let parts = self.parts.into_iter().zip(split(grad_output)).enumerate().map(|(index, (part, grad_output))| {
            let first = index == 0;
            let own = gradient.iter().map(|sum| if first { sum.shallow_clone() } else { sum.empty_like() });
            (part, grad_output, own.collect::<Vec<_>>())
        });
        let found = on_all_cores(parts.collect(), |(part, grad_output, own)| (part.back(grad_output, &own), own));

        for (_, own) in found.iter().skip(1) {
            for (sum, own) in gradient.iter().zip(own) {
                let _ = tch::no_grad(|| sum.shallow_clone().g_add_(own));
            }
        }

        let by_states: Vec<&Tensor> = found.iter().map(|(by_states, _)| by_states).collect();
        Tensor::cat(&by_states, 0)
    }
}

impl Part {
    fn through(layers: [Linear; 3], states: Tensor) -> Self {
        tch::no_grad(|| {
            let [first, second, third] = &layers;
            let hidden = first.forward(&states).relu_();
            let later = second.forward(&hidden).relu_();
            let values = third.forward(&later);
            Self { inputs: [states, hidden, later], values, layers }
        })
    }

    fn back(&self, mut grad_output: Tensor, gradient: &[Tensor]) -> Tensor {
        tch::no_grad(|| {
            for (index, (layer, input)) in self.layers.iter().zip(&self.inputs).enumerate().rev() {
                let _ = grad_output.sum_intlist_out(&gradient[2 * index], 0, false, None);
                let _ = grad_output.tr().mm_out(&gradient[2 * index + 1], input);
                grad_output = grad_output.mm(&layer.ws);

                if index > 0 {
                    // The gradient passes a ReLU only where its output is above zero.
                    grad_output = input.threshold_backward(&grad_output, 0);
                }
            }
            grad_output
        })
    }
}

/// Splits `rows` as evenly as possible into parts for one core each; on a GPU they stay together.
fn split(rows: &Tensor) -> Vec<Tensor> {
    let count = rows.size()[0];
    let parts = if rows.device() == Device::Cpu { (count - 1) / STATES_AT_ONCE + 1 } else { 1 };
    rows.chunk(parts.max(1), 0)
}

/// A layer with the same weights. A tensor's handle may be moved to another thread, but not shared between threads.
fn shared(layer: &Linear) -> Linear {
    Linear { ws: layer.ws.shallow_clone(), bs: layer.bs.as_ref().map(Tensor::shallow_clone) }
}

fn on_all_cores<T: Send, R: Send>(parts: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    if parts.len() == 1 {
        return parts.into_iter().map(work).collect();
    }

    let alone = |part| {
        compute_on_this_thread();
        work(part)
    };
    parts.into_par_iter().map(alone).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use tch::{Kind, nn};

    use super::*;
    use crate::training::dqn::drawn::{draw_variables, drawn};

    #[test]
    fn values_and_gradients_are_libtorchs() {
        compute_on_this_thread();
        // One part only, and several parts of different size.
        [34, 700].into_iter().for_each(compare);
    }

    fn compare(count: i64) {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let store = nn::VarStore::new(Device::Cpu);
        let reference = ValueHead::new(&(store.root() / "head"), 16);
        let variables = draw_variables(&store, &mut rng);
        let states = drawn(&mut rng, &[count, 16]).set_requires_grad(true);
        let grad_output = drawn(&mut rng, &[count, 3]);
        let expected = reference.forward(&states);
        let pass = Pass::through(&reference, &states.detach());
        assert!(pass.values.allclose(&expected, 1e-5, 1e-6, false));

        let gradient: Vec<Tensor> = variables.iter().map(|(_, variable)| variable.detach().zeros_like()).collect();
        let by_states = pass.back(&grad_output, &gradient);
        let mut by: Vec<&Tensor> = variables.iter().map(|(_, variable)| variable).collect();
        by.push(&states);
        let loss = (expected * grad_output).sum(Kind::Float);
        let expected = Tensor::run_backward(&[loss], &by, false, false);
        for (found, expected) in gradient.iter().chain([&by_states]).zip(&expected) {
            assert!(found.allclose(expected, 1e-4, 1e-5, false));
        }
    }
}
