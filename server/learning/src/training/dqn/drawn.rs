//! Weights and other tensors that tests draw from their own random generator. libtorch's generator is shared by all
//! tests of a process, so the same seed would give other values in each run. Now and then a unit would then be so near
//! zero that rounding decides whether it has a gradient.

use rand_chacha::ChaCha8Rng;
use tch::{Tensor, nn};

use parfocal_devices::simulation::normal::standard_normal;

/// Normal values of mean 0 and variance 1.
pub fn drawn(rng: &mut ChaCha8Rng, shape: &[i64]) -> Tensor {
    let count = shape.iter().product();
    let values: Vec<f32> = (0..count).map(|_: i64| standard_normal(rng) as f32).collect();
    Tensor::from_slice(&values).view(shape)
}

/// Draws new values for all variables of `store`, with a standard deviation of 0.2, and returns them by name. Biases
/// are drawn too: initially they are zero, and a test would not notice if they were ignored.
pub fn draw_variables(store: &nn::VarStore, rng: &mut ChaCha8Rng) -> Vec<(String, Tensor)> {
    let mut variables: Vec<(String, Tensor)> = store.variables().into_iter().collect();
    variables.sort_by(|a, b| a.0.cmp(&b.0));
    for (_, variable) in &mut variables {
        let values = drawn(rng, &variable.size()) * 0.2;
        tch::no_grad(|| variable.copy_(&values));
    }
    variables
}
