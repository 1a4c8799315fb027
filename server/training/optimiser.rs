//! Optimisers whose whole state can be saved, so that training resumed goes on exactly as training never stopped.

use tch::{Kind, Tensor, nn};

use super::checkpoint::{Checkpoint, CheckpointError};

/// Which rule turns gradients into steps.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case", tag = "name", deny_unknown_fields)]
pub enum Rule {
    /// `RMSProp` with momentum, `PyTorch`'s form: smoothing 0.99, epsilon 1e-8.
    RmsProp {
        /// Step size.
        learning_rate: f64,
        /// Momentum.
        momentum: f64,
    },
    /// Adam (Kingma and Ba 2015) with betas 0.9 and 0.999, epsilon 1e-8.
    Adam {
        /// Step size.
        learning_rate: f64,
    },
}

/// An optimiser over all variables of a store.
#[derive(Debug)]
pub struct Optimiser {
    rule: Rule,
    variables: Vec<Tensor>,
    /// Two running averages for each variable: of squared gradients; of gradients or steps.
    state: Vec<[Tensor; 2]>,
    steps: i32,
}

impl Optimiser {
    /// An optimiser of `store`'s variables, in the order of their names.
    #[must_use]
    pub fn new(rule: Rule, store: &nn::VarStore) -> Self {
        let mut named: Vec<(String, Tensor)> = store.variables().into_iter().collect();
        named.sort_by(|a, b| a.0.cmp(&b.0));
        let variables: Vec<Tensor> = named.into_iter().map(|(_, tensor)| tensor).collect();
        let state = variables.iter().map(|v| [v.zeros_like(), v.zeros_like()].map(|t| t.detach())).collect();
        Self { rule, variables, state, steps: 0 }
    }

    /// One step down the gradient of `loss`, its norm clipped to `clip`, the step size scaled by `scale`.
    pub fn minimise(&mut self, loss: &Tensor, clip: f64, scale: f64) {
        for variable in &mut self.variables {
            variable.zero_grad();
        }
        loss.backward();
        tch::no_grad(|| {
            let squares: f64 =
                self.variables.iter().map(|v| v.grad().square().sum(Kind::Float).double_value(&[])).sum();
            let shrink = (clip / (squares.sqrt() + 1e-6)).min(1.0);
            self.steps += 1;
            for (variable, [squared, averaged]) in self.variables.iter_mut().zip(&mut self.state) {
                let gradient = variable.grad() * shrink;
                apply(self.rule, self.steps, scale, variable, &gradient, squared, averaged);
            }
        });
    }

    /// Adds the optimiser's state to a checkpoint.
    pub fn save(&self, checkpoint: &mut Checkpoint) {
        for (index, tensor) in self.state.iter().flatten().enumerate() {
            checkpoint.put_tensor(&format!("optimiser.{index}"), tensor);
        }
        checkpoint.notes.insert("steps".to_owned(), self.steps.to_string());
    }

    /// Takes back what [`Optimiser::save`] added.
    ///
    /// # Errors
    /// When the checkpoint is of another network.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), CheckpointError> {
        for (index, tensor) in self.state.iter_mut().flatten().enumerate() {
            checkpoint.fill(&format!("optimiser.{index}"), tensor)?;
        }
        self.steps = checkpoint.number("steps")?;
        Ok(())
    }
}

fn apply(
    rule: Rule,
    steps: i32,
    scale: f64,
    variable: &mut Tensor,
    gradient: &Tensor,
    squared: &mut Tensor,
    averaged: &mut Tensor,
) {
    match rule {
        Rule::RmsProp { learning_rate, momentum } => {
            let _ = squared.g_mul_scalar_(0.99).g_add_(&(gradient * gradient * 0.01));
            let _ = averaged.g_mul_scalar_(momentum).g_add_(&(gradient / (squared.sqrt() + 1e-8)));
            let _ = variable.g_sub_(&(&*averaged * (learning_rate * scale)));
        }
        Rule::Adam { learning_rate } => {
            let _ = squared.g_mul_scalar_(0.999).g_add_(&(gradient * gradient * 0.001));
            let _ = averaged.g_mul_scalar_(0.9).g_add_(&(gradient * 0.1));
            let (first, second) = (1.0 - 0.9f64.powi(steps), 1.0 - 0.999f64.powi(steps));
            let step = (&*averaged / first) / ((&*squared / second).sqrt() + 1e-8);
            let _ = variable.g_sub_(&(step * (learning_rate * scale)));
        }
    }
}
