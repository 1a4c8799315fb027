//! Optimisers whose whole state can be saved, so that a resumed training continues exactly as if it had never stopped.

use tch::{Tensor, nn};

use super::run::checkpoint::Checkpoint;
use crate::LearningError;

/// The rule that turns gradients into steps, with its settings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case", tag = "name", deny_unknown_fields)]
pub enum Rule {
    /// `RMSProp` with momentum in `PyTorch`'s form, except that epsilon is under the root: smoothing 0.99, epsilon
    /// 1e-8.
    RmsProp {
        /// Step size before the schedule's scale.
        learning_rate: f64,
        /// Momentum, 0 to below 1.
        momentum: f64,
    },
    /// Adam (Kingma and Ba 2015) with betas 0.9 and 0.999 and epsilon 1e-8, except that epsilon is under the root.
    Adam {
        /// Step size before the schedule's scale.
        learning_rate: f64,
    },
}

/// Scale of the learning rate when the share `done` (0..1) of the training is done: a half cosine from 1 to `floor`.
pub fn half_cosine(done: f64, floor: f64) -> f64 {
    floor + (1.0 - floor) * 0.5 * (1.0 + (std::f64::consts::PI * done.min(1.0)).cos())
}

/// A store's variables as views of one tensor, in the order of their names. So an operation on all of them is a single
/// call.
#[derive(Debug)]
pub struct Flat {
    /// The variables, in the order of their names.
    pub variables: Vec<Tensor>,
    /// All their values, one after another: `[total]`.
    pub values: Tensor,
}

impl Flat {
    /// Moves the variables of `store` into one tensor.
    pub fn of(store: &nn::VarStore) -> Self {
        let mut named: Vec<(String, Tensor)> = store.variables().into_iter().collect();
        named.sort_by(|a, b| a.0.cmp(&b.0));
        let mut variables: Vec<Tensor> = named.into_iter().map(|(_, tensor)| tensor).collect();

        let values = tch::no_grad(|| joined(&variables));
        for (part, variable) in parts(&values, &variables).iter().zip(&mut variables) {
            variable.set_data(part);
        }

        Self { variables, values }
    }

    /// Moves all variables by `share` of the way towards those of `other`, which has the same network.
    pub fn approach(&mut self, other: &Self, share: f64) {
        let _ = self.values.lerp_(&other.values, share);
    }

    /// The gradient of `loss` with respect to all variables, as one tensor.
    pub fn gradient(&self, loss: &Tensor) -> Tensor {
        joined(&Tensor::run_backward(&[loss], &self.variables, false, false))
    }
}

/// The values of all tensors, one after another.
fn joined(tensors: &[Tensor]) -> Tensor {
    let flat: Vec<Tensor> = tensors.iter().map(|tensor| tensor.reshape([-1])).collect();
    Tensor::cat(&flat, 0)
}

/// Splits `values` into consecutive views with the shapes of `variables`.
pub fn parts(values: &Tensor, variables: &[Tensor]) -> Vec<Tensor> {
    let mut at = 0;
    let part = |variable: &Tensor| {
        let length = variable.size().iter().product();
        at += length;
        values.narrow(0, at - length, length).view_as(variable)
    };
    variables.iter().map(part).collect()
}

/// An optimiser over all variables of a store.
#[derive(Debug)]
pub struct Optimiser {
    rule: Rule,
    flat: Flat,
    /// Running averages: first of the squared gradients, second of the gradients (Adam) or of the steps (`RMSProp`).
    state: [Tensor; 2],
    steps: i32,
}

impl Optimiser {
    /// An optimiser of `store`'s variables. Moves them into one tensor.
    pub fn new(rule: Rule, store: &nn::VarStore) -> Self {
        let flat = Flat::of(store);
        let state = [flat.values.zeros_like(), flat.values.zeros_like()];
        Self { rule, flat, state, steps: 0 }
    }

    /// The variables.
    pub const fn flat(&self) -> &Flat {
        &self.flat
    }

    /// Takes one step down `gradient`, which holds the gradients of all variables in the order of their names. Its norm
    /// is clipped to `clip`, the step size scaled by `scale`.
    pub fn descend(&mut self, mut gradient: Tensor, clip: f64, scale: f64) {
        tch::no_grad(|| {
            let shrink = clip / (gradient.norm().double_value(&[]) + 1e-6);
            if shrink < 1.0 {
                let _ = gradient.g_mul_scalar_(shrink);
            }

            self.steps += 1;
            let [squared, averaged] = &mut self.state;
            let variables = &mut self.flat.values;

            match self.rule {
                Rule::RmsProp { learning_rate, momentum } => {
                    let _ = squared.lerp_(&gradient.square(), 0.01);
                    let _ = averaged.g_mul_scalar_(momentum).addcmul_(&gradient, &inverse_root(squared, 1e-8));
                    let _ = variables.g_sub_(&(&*averaged * (learning_rate * scale)));
                }
                Rule::Adam { learning_rate } => {
                    let _ = squared.lerp_(&gradient.square(), 0.001);
                    let _ = averaged.lerp_(&gradient, 0.1);
                    let first = 1.0 - 0.9f64.powi(self.steps);
                    let second = 1.0 - 0.999f64.powi(self.steps);

                    // The step is averaged / first / sqrt(squared / second + epsilon²), with its factors combined.
                    let rate = learning_rate * scale * second.sqrt() / first;
                    let _ = variables.addcmul_(&(&*averaged * -rate), &inverse_root(squared, 1e-8 * second.sqrt()));
                }
            }
        });
    }

    /// Adds the optimiser's state to a checkpoint: both averages, variable by variable, and the number of steps.
    pub fn save(&self, checkpoint: &mut Checkpoint<'_>) {
        for (name, tensor) in self.named_state() {
            checkpoint.put_tensor(&name, &tensor);
        }
        checkpoint.notes.insert("steps".to_owned(), self.steps.to_string());
    }

    /// Restores what [`Optimiser::save`] added.
    ///
    /// # Errors
    /// If the checkpoint is damaged or belongs to another network.
    pub fn restore(&mut self, checkpoint: &Checkpoint<'_>) -> Result<(), LearningError> {
        for (name, mut tensor) in self.named_state() {
            checkpoint.fill(&name, &mut tensor)?;
        }
        self.steps = checkpoint.number("steps")?;
        Ok(())
    }

    fn named_state(&self) -> Vec<(String, Tensor)> {
        let [squared, averaged] = self.state.each_ref().map(|values| parts(values, &self.flat.variables));
        let both = squared.into_iter().zip(averaged).flat_map(<[Tensor; 2]>::from);
        both.enumerate().map(|(index, tensor)| (format!("optimiser.{index}"), tensor)).collect()
    }
}

/// 1 / sqrt(`squared` + `least`²), so at most 1 / `least`. With `least` under the root instead of beside it, libtorch
/// takes half as long.
fn inverse_root(squared: &Tensor, least: f64) -> Tensor {
    (squared + least * least).rsqrt_()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of a variable that begins at 0, after one step down each of `gradients`.
    fn descended(rule: Rule, clip: f64, scale: f64, gradients: &[f64]) -> f64 {
        let store = nn::VarStore::new(tch::Device::Cpu);
        let variable = store.root().zeros("variable", &[1]);
        let mut optimiser = Optimiser::new(rule, &store);
        for gradient in gradients {
            let gradient = optimiser.flat().gradient(&(&variable * *gradient).sum(tch::Kind::Float));
            optimiser.descend(gradient, clip, scale);
        }
        variable.double_value(&[0])
    }

    #[test]
    fn rms_prop_by_hand() {
        let rule = Rule::RmsProp { learning_rate: 0.1, momentum: 0.9 };
        // The mean square is 0.01, so the momentum becomes 1 / 0.1 = 10. Then the mean square is 0.0199, and the
        // momentum 0.9 * 10 + 1 / sqrt(0.0199).
        for (gradients, expected) in [(&[1.0][..], -1.0), (&[1.0, 1.0], -1.0 - 1.608_881_2), (&[1.0, 0.0], -1.9)] {
            let stands = descended(rule, 10.0, 1.0, gradients);
            assert!((stands - expected).abs() < 1e-5, "{gradients:?}: {stands}, not {expected}");
        }
    }

    #[test]
    fn adam_by_hand() {
        let rule = Rule::Adam { learning_rate: 0.1 };
        // With a constant gradient, each step equals the learning rate, however large the gradient is. After the
        // gradient has changed sign, its mean is -0.01 / 0.19, and its mean square still 1.
        let turned = -0.1 + 0.1 * 0.01 / 0.19;
        for (gradients, expected) in
            [(&[1.0; 3][..], -0.3), (&[50.0; 3], -0.3), (&[0.02; 3], -0.3), (&[1.0, -1.0], turned)]
        {
            let stands = descended(rule, 100.0, 1.0, gradients);
            assert!((stands - expected).abs() < 1e-5, "{gradients:?}: {stands}, not {expected}");
        }
    }

    #[test]
    fn steps_are_scaled_and_gradients_clipped() {
        let rule = Rule::Adam { learning_rate: 0.1 };
        assert!((descended(rule, 100.0, 0.5, &[1.0]) + 0.05).abs() < 1e-6);
        // 3 is clipped to 1, so the two steps are as with two equal gradients.
        assert!((descended(rule, 1.0, 1.0, &[3.0, 1.0]) + 0.2).abs() < 1e-5);
        assert!((descended(rule, 100.0, 1.0, &[3.0, 1.0]) + 0.2).abs() > 1e-3);
    }
}
