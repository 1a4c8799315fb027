//! Compares the encoder by hand with libtorch's, and its gradients with finite differences.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tch::{Device, Kind, Tensor, nn};

use super::Encoder;
use crate::training::dqn::drawn::draw_variables;
use parfocal_autofocus::networks;

/// Patches with ramps of random slope under random noise; the first is flat.
fn patches(count: usize, rng: &mut impl Rng) -> Vec<u8> {
    let mut levels = Vec::with_capacity(count * 1024);
    for patch in 0..count {
        let slope = rng.random_range(0.0..4.0f32);
        let noise = rng.random_range(1..80u8);
        for pixel in 0..1024u16 {
            let ramp = slope * f32::from(pixel % 32);
            let level = 20.0 + ramp + f32::from(rng.random_range(0..noise));
            levels.push(if patch == 0 { 77 } else { level as u8 });
        }
    }
    levels
}

struct Both {
    store: nn::VarStore,
    torch: networks::Encoder,
    ours: Encoder,
}

fn both(seed: u64) -> Both {
    networks::compute_on_this_thread();
    let store = nn::VarStore::new(Device::Cpu);
    let torch = networks::Encoder::new(&(store.root() / "encoder"));
    draw_variables(&store, &mut ChaCha8Rng::seed_from_u64(seed));
    let ours = Encoder::of(&store, "encoder").unwrap();
    Both { store, torch, ours }
}

fn as_tensor(patches: &[u8]) -> Tensor {
    Tensor::from_slice(patches).to_kind(Kind::Float).view([-1, 1024])
}

/// Largest difference, relative to the largest expected value.
fn difference(found: &Tensor, expected: &Tensor) -> f64 {
    let scale = expected.abs().max().double_value(&[]);
    (found - expected.view_as(found)).abs().max().double_value(&[]) / scale
}

#[test]
fn encodings_are_libtorchs() {
    let both = both(3);
    let patches = patches(50, &mut ChaCha8Rng::seed_from_u64(1));
    let expected = both.torch.forward(&as_tensor(&patches));
    let found = Tensor::from_slice(&both.ours.encode(&patches)).view([-1, 8]);
    assert!(difference(&found, &expected) < 1e-5);
}

#[test]
fn gradients_are_libtorchs() {
    let both = both(4);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let patches = patches(40, &mut rng);
    let grad_output: Vec<f32> = (0..40 * 8).map(|_| rng.random_range(-1.0..1.0)).collect();
    let loss =
        (both.torch.forward(&as_tensor(&patches)) * Tensor::from_slice(&grad_output).view([-1, 8])).sum(Kind::Float);
    loss.backward();

    let found = Tensor::from_slice(&both.ours.gradient(&patches, &grad_output));
    let mut variables: Vec<_> = both.store.variables().into_iter().collect();
    variables.sort_by(|a, b| a.0.cmp(&b.0));
    assert_eq!(variables.len(), 8);

    let mut at = 0;
    for (name, variable) in variables {
        let expected = variable.grad();
        let length = i64::try_from(expected.numel()).unwrap();
        let difference = difference(&found.narrow(0, at, length), &expected.view([-1]));
        assert!(difference < 1e-4, "{name}: {difference}");
        at += length;
    }
    assert_eq!(found.size(), [at]);
}

#[test]
fn a_gradient_is_what_a_small_step_changes() {
    let both = both(5);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let patches = patches(8, &mut rng);
    let grad_output: Vec<f32> = (0..8 * 8).map(|_| rng.random_range(-1.0..1.0)).collect();
    let loss = || -> f64 {
        both.ours.encode(&patches).iter().zip(&grad_output).map(|(e, s)| f64::from(*e) * f64::from(*s)).sum()
    };

    let gradient = both.ours.gradient(&patches, &grad_output);
    // The second layer's weight [1][2][0][1] comes after both biases and the first layer's 72 weights.
    let expected = f64::from(gradient[8 + 72 + 8 + 72 + 2 * 9 + 1]);

    let step = |by: f64| {
        let weight = both.store.variables().remove("encoder.2.weight").unwrap();
        let _ = tch::no_grad(|| weight.get(1).get(2).get(0).get(1).g_add_scalar_(by));
    };

    step(1e-3);
    let above = loss();
    step(-2e-3);
    let found = (above - loss()) / 2e-3;
    assert!((found - expected).abs() < 0.01 * expected.abs(), "{found} {expected}");
}
