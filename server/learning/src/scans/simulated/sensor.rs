//! The sensor of a simulated scan: turns light into what the camera records.

use multiversion::multiversion;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::settings::ScanSettings;
use parfocal_devices::simulation::cover::Cover;
use parfocal_devices::simulation::normal::cheap_normal;
use parfocal_imaging::{PATCH_SIDE, Patch, Surroundings, WIDER};

/// Exposure, noise and fixed pattern of a sensor, and what covers its view.
#[derive(Debug, Clone)]
pub struct Sensor {
    exposure: (f64, f64),
    /// Standard deviation of the noise, in gray levels.
    noise: f32,
    cover: Option<Cover>,
    /// The fixed pattern, in gray levels for each pixel; empty if there is none.
    pattern: Vec<f32>,
    /// The fixed pattern as the wider patches show it.
    wider_pattern: [Vec<f32>; WIDER.len()],
    random: ChaCha8Rng,
    /// The noise of the wider patches has its own stream, so that the patch's noise is the same whether the wider
    /// patches are observed or not.
    wider_random: ChaCha8Rng,
    /// That of the surroundings, likewise.
    surrounding_random: ChaCha8Rng,
}

impl Sensor {
    /// A sensor whose pattern and noise are drawn from `seed`.
    pub fn new(settings: &ScanSettings, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x6e6f_6973_6521);
        let mut wider_random = ChaCha8Rng::seed_from_u64(seed ^ 0x7769_6465_7221);
        let pattern = fixed_pattern(settings.pattern as f32, &mut random);
        let wider_pattern =
            WIDER.map(|scale| fixed_pattern(settings.pattern as f32 / scale.pixels() as f32, &mut wider_random));

        Self {
            exposure: settings.exposure,
            noise: settings.noise as f32,
            cover: settings.covered.then(|| Cover::new(seed ^ 0x0063_6f76_6572)),
            pattern,
            wider_pattern,
            random,
            wider_random,
            surrounding_random: ChaCha8Rng::seed_from_u64(seed ^ 0x6172_6f75_6e64),
        }
    }

    /// Turns the light of a patch into what the camera records: whole gray levels, 0..=255. `contrast` scales what
    /// differs from the light's mean.
    pub fn record(&mut self, patch: &mut Patch, contrast: f64) {
        self.expose(&mut patch.0, contrast);
        add_noise(&mut patch.0, self.noise, &mut self.random);
        add(&mut patch.0, &self.pattern);
        digitise(&mut patch.0);
    }

    /// The same for the wider patch at scale `index`. Noise and rounding matter less, because a value is the mean of
    /// many pixels.
    pub fn record_wider(&mut self, patch: &mut Patch, index: usize, contrast: f64) {
        self.expose(&mut patch.0, contrast);
        add_noise(&mut patch.0, self.noise / WIDER[index].pixels() as f32, &mut self.wider_random);
        add(&mut patch.0, &self.wider_pattern[index]);
        patch.0.iter_mut().for_each(|value| *value = value.clamp(0.0, 255.0));
    }

    /// The same for the light around a patch, of which the recorded `patch` becomes part. The fixed pattern is that of
    /// the patch, repeated.
    pub fn record_surroundings(&mut self, light: &Surroundings, patch: &Patch, contrast: f64) -> Surroundings {
        let mut levels = light.levels.to_vec();
        self.expose(&mut levels, contrast);
        add_noise(&mut levels, self.noise, &mut self.surrounding_random);

        if !self.pattern.is_empty() {
            for (index, value) in levels.iter_mut().enumerate() {
                let x = (index % Surroundings::SIDE + PATCH_SIDE - light.patch.0 % PATCH_SIDE) % PATCH_SIDE;
                let y = (index / Surroundings::SIDE + PATCH_SIDE - light.patch.1 % PATCH_SIDE) % PATCH_SIDE;
                *value += self.pattern[y * PATCH_SIDE + x];
            }
        }

        digitise(&mut levels);
        put_patch(patch, light.patch, &mut levels);
        Surroundings { levels: levels.into(), patch: light.patch }
    }

    /// Advances to the next frame.
    pub fn advance(&mut self) {
        self.cover.iter_mut().for_each(Cover::advance);
    }

    fn expose(&self, levels: &mut [f32], contrast: f64) {
        let detail = self.cover.as_ref().map_or(1.0, Cover::detail);
        expose(levels, self.exposure.0 as f32, (detail * contrast) as f32, self.exposure.1 as f32);
    }
}

/// A fixed pattern of one patch's pixels; empty if it has no strength.
fn fixed_pattern(strength: f32, random: &mut ChaCha8Rng) -> Vec<f32> {
    let pixels = if strength > 0.0 { PATCH_SIDE * PATCH_SIDE } else { 0 };
    (0..pixels).map(|_| strength * cheap_normal(random)).collect()
}

fn add_noise(levels: &mut [f32], noise: f32, random: &mut ChaCha8Rng) {
    if noise > 0.0 {
        for value in levels {
            *value += noise * cheap_normal(random);
        }
    }
}

fn add(levels: &mut [f32], pattern: &[f32]) {
    for (value, pattern) in levels.iter_mut().zip(pattern) {
        *value += pattern;
    }
}

/// Scales differences from the levels' mean by `contrast`, then everything by `gain`, and adds `offset`.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn expose(levels: &mut [f32], gain: f32, contrast: f32, offset: f32) {
    let mean = levels.iter().sum::<f32>() / levels.len() as f32;
    for value in levels {
        *value = gain * (mean + contrast * (*value - mean)) + offset;
    }
}

/// Rounds to whole gray levels, 0..=255.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn digitise(levels: &mut [f32]) {
    for value in levels {
        *value = value.clamp(0.0, 255.0).round();
    }
}

/// Writes `patch` into the surroundings `levels`, with its corner at `(x, y)`.
fn put_patch(patch: &Patch, (x, y): (usize, usize), levels: &mut [f32]) {
    let lines = levels.chunks_exact_mut(Surroundings::SIDE).skip(y);
    for (line, row) in lines.zip(patch.0.chunks_exact(PATCH_SIDE)) {
        line[x..x + PATCH_SIDE].copy_from_slice(row);
    }
}
