//! Measures how blurred a patch is, by the logarithm of its energy in bands of spatial frequency.
//!
//! A Gaussian of standard deviation s multiplies the energy at angular frequency w by exp(-(s w)²). So a change of blur
//! shifts each band's logarithm by an amount that depends on neither contrast nor texture.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::LazyLock;

use multiversion::multiversion;

use super::{mgm, mlr};
use parfocal_imaging::{PATCH_SIDE, Patch};

/// Bands of radial frequency.
const BANDS: usize = 14;
/// Length of the result of [`features`]: the bands, contrast, mean gradient magnitude, mean local ratio, brightness.
pub const FEATURES: usize = BANDS + 4;
/// Index in [`features`] of the logarithm of the mean gradient magnitude.
pub const SHARPNESS: usize = BANDS + 1;
/// Columns of the transform. A real patch needs the 17 of frequencies 0..=16; the rest pads them to whole vectors.
const COLUMNS: usize = 24;
const HALF: usize = PATCH_SIDE / 2;

/// Added to a band's energy so that an empty band has a finite logarithm. Far below the energy of noise of one gray
/// level.
const ROUNDING: f32 = 30.0;
/// Least ratio of the energy in the lower third of the bands to that in the upper third for a patch to show detail.
/// White noise exceeds 2.5 in one patch of a thousand.
const LEAST_FALL: f32 = 2.5;

type Matrix = [[f32; COLUMNS]; PATCH_SIDE];

/// The Fourier transform of a patch, less its mean, under a Hann window. Rows are frequencies 0..=31 down the patch;
/// the first 17 columns are frequencies 0..=16 along it.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchTransform {
    /// Real parts.
    pub real: Matrix,
    /// Imaginary parts.
    pub imaginary: Matrix,
    /// The patch's mean.
    mean: f32,
    /// The patch's variance.
    variance: f32,
    /// Energy in each band.
    energy: [f32; BANDS],
}

/// Sines and cosines for the transform, multiplied by the Hann window along their axis.
struct Tables {
    /// cos and sin of 2 pi row column / 32 for the first [`COLUMNS`] frequencies of the first axis.
    cos: Matrix,
    sin: Matrix,
    /// cos and sin for all 32 frequencies of the second axis.
    full_cos: [[f32; PATCH_SIDE]; PATCH_SIDE],
    full_sin: [[f32; PATCH_SIDE]; PATCH_SIDE],
    /// Band of each pair of frequencies, by row and column; `BANDS` for none.
    band: [[usize; COLUMNS]; PATCH_SIDE],
    /// Frequency pairs in each band.
    count: [f32; BANDS],
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let window: [f32; PATCH_SIDE] =
        std::array::from_fn(|i| (0.5 - 0.5 * (TAU * (i as f64 + 0.5) / PATCH_SIDE as f64).cos()) as f32);
    let wave = |row: usize, column: usize| TAU * (row * column % PATCH_SIDE) as f64 / PATCH_SIDE as f64;

    let table = |f: fn(f64) -> f64| -> Matrix {
        std::array::from_fn(|row| std::array::from_fn(|column| window[row] * f(wave(row, column)) as f32))
    };
    let full = |f: fn(f64) -> f64| -> [[f32; PATCH_SIDE]; PATCH_SIDE] {
        std::array::from_fn(|k| std::array::from_fn(|row| window[row] * f(wave(row, k)) as f32))
    };

    let band: [[usize; COLUMNS]; PATCH_SIDE] = std::array::from_fn(|ky| std::array::from_fn(|kx| band(ky, kx)));
    let members = |which| band.iter().flatten().filter(|&&band| band == which).count() as f32;

    Tables {
        cos: table(f64::cos),
        sin: table(f64::sin),
        full_cos: full(f64::cos),
        full_sin: full(f64::sin),
        band,
        count: std::array::from_fn(members),
    }
});

/// Band of a pair of frequencies, by radius; the bands of low frequencies are narrower. The mean with its leakage and
/// the far corners belong to no band.
fn band(ky: usize, kx: usize) -> usize {
    if kx > HALF {
        return BANDS;
    }
    let ky = ky.min(PATCH_SIDE - ky) as f64;
    let radius = ky.hypot(kx as f64);

    let edges = [1.5, 2.2, 3.0, 3.8, 4.7, 5.7, 6.8, 8.0, 9.4, 11.0, 12.8, 14.6, 16.5, 18.5, 20.5];
    edges.windows(2).position(|pair| (pair[0]..pair[1]).contains(&radius)).unwrap_or(BANDS)
}

/// A patch's features, each of the order of 1.
pub fn features(patch: &Patch, spectrum: &PatchTransform) -> [f32; FEATURES] {
    let energy = &spectrum.energy;
    let mut out = [0.0; FEATURES];

    for band in 0..BANDS {
        out[band] = 0.25 * ((energy[band] / TABLES.count[band] + ROUNDING).ln() - 9.0);
    }

    out[BANDS] = 0.5 * ((spectrum.variance + 0.1).ln() - 5.0);
    out[SHARPNESS] = ((mgm(patch) + 0.5).ln() - 3.5) as f32;
    out[BANDS + 2] = 0.5 * ((mlr(patch) - 1.0 + 1e-4).ln() as f32 + 3.5);
    out[BANDS + 3] = (spectrum.mean - 128.0) / 64.0;
    out
}

impl PatchTransform {
    /// Standard deviation of the patch, in gray levels.
    pub fn contrast(&self) -> f32 {
        self.variance.sqrt()
    }

    /// Whether the patch shows more than noise. Tissue, however sharp, has far more energy at low frequencies than at
    /// high ones. The sensor's noise and rounding have equal energy at all.
    pub fn shows_detail(&self) -> bool {
        let mean = |bands: Range<usize>| {
            self.energy[bands.clone()].iter().sum::<f32>() / TABLES.count[bands].iter().sum::<f32>() + ROUNDING
        };
        mean(0..BANDS / 3) > LEAST_FALL * mean(2 * BANDS / 3..BANDS)
    }
}

/// Computes the transform of a patch.
pub fn spectrum(patch: &Patch) -> PatchTransform {
    let mean = column_sums(patch, |value| value).iter().sum::<f32>() / patch.0.len() as f32;
    let variance = column_sums(patch, |value| (value - mean).powi(2)).iter().sum::<f32>() / patch.0.len() as f32;

    let mut spectrum = transform(&patch.0, mean, &TABLES);
    spectrum.variance = variance;
    spectrum.energy = band_energies(&spectrum);

    spectrum
}

/// Sums `term` down each column. The columns' sums fill whole vectors.
fn column_sums(patch: &Patch, term: impl Fn(f32) -> f32) -> [f32; PATCH_SIDE] {
    let mut sums = [0.0; PATCH_SIDE];
    for line in patch.0.chunks_exact(PATCH_SIDE) {
        for (sum, &value) in sums.iter_mut().zip(line) {
            *sum += term(value);
        }
    }
    sums
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn transform(patch: &[f32; PATCH_SIDE * PATCH_SIDE], mean: f32, tables: &Tables) -> PatchTransform {
    let mut real = [[0.0f32; COLUMNS]; PATCH_SIDE];
    let mut imaginary = [[0.0f32; COLUMNS]; PATCH_SIDE];
    for (row, line) in patch.chunks_exact(PATCH_SIDE).enumerate() {
        for (column, value) in line.iter().enumerate() {
            let value = value - mean;
            for k in 0..COLUMNS {
                real[row][k] += value * tables.cos[column][k];
                imaginary[row][k] += value * tables.sin[column][k];
            }
        }
    }

    let blank = [[0.0; COLUMNS]; PATCH_SIDE];
    let mut out = PatchTransform { real: blank, imaginary: blank, mean, variance: 0.0, energy: [0.0; BANDS] };

    for ky in 0..PATCH_SIDE {
        let re = &mut out.real[ky];
        let im = &mut out.imaginary[ky];
        for row in 0..PATCH_SIDE {
            let cos = tables.full_cos[ky][row];
            let sin = tables.full_sin[ky][row];
            for k in 0..COLUMNS {
                re[k] += real[row][k] * cos - imaginary[row][k] * sin;
                im[k] += real[row][k] * sin + imaginary[row][k] * cos;
            }
        }
    }

    out
}

fn band_energies(spectrum: &PatchTransform) -> [f32; BANDS] {
    // The last entry collects the energy that belongs to no band.
    let mut energy = [0.0f32; BANDS + 1];
    for (ky, bands) in TABLES.band.iter().enumerate() {
        let real = &spectrum.real[ky];
        let imaginary = &spectrum.imaginary[ky];
        for kx in 0..=HALF {
            energy[bands[kx]] += real[kx] * real[kx] + imaginary[kx] * imaginary[kx];
        }
    }

    std::array::from_fn(|band| energy[band])
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use parfocal_devices::simulation::normal::standard_normal;

    fn wave(frequency: f64) -> Patch {
        Patch(std::array::from_fn(|i| {
            (128.0 + 50.0 * (TAU * frequency * (i % PATCH_SIDE) as f64 / PATCH_SIDE as f64 + 0.6).cos()) as f32
        }))
    }

    #[test]
    fn a_wave_lights_up_its_own_band() {
        for (frequency, band) in [(2.0, 0), (5.0, 4), (10.0, 8), (14.0, 11)] {
            let found = features(&wave(frequency), &spectrum(&wave(frequency)));
            let brightest = (0..BANDS).max_by(|&a, &b| found[a].total_cmp(&found[b])).unwrap();
            assert!(brightest.abs_diff(band) <= 1, "{frequency}: {brightest}");
        }
    }

    #[test]
    fn a_flat_patch_and_mere_noise_show_nothing_and_blurred_texture_does() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut noise =
            |sd: f64| Patch(std::array::from_fn(|_| (90.3 + sd * standard_normal(&mut rng)).round() as f32));
        for sd in [0.0, 0.3, 1.0, 4.0, 10.0] {
            let seen = (0..200).filter(|_| spectrum(&noise(sd)).shows_detail()).count();
            assert!(seen <= 2, "noise of {sd}: {seen} of 200");
        }

        let mut texture = noise(2.0);
        for (value, wave) in texture.0.iter_mut().zip(wave(2.0).0) {
            *value += 0.1 * (wave - 128.0);
        }
        assert!(spectrum(&texture).shows_detail());
    }

    #[test]
    fn the_transform_is_the_textbook_one() {
        // A wave of amplitude A at frequency 5 along the rows. The Hann window spreads it to neighbouring frequencies.
        // By Parseval, the sum of |X|² over the half plane, with both signs of the row frequency, is
        // (A/2 · 32 · 32)² · (3/8)²: the mean square of the window is 3/8 along each axis.
        let energy = band_energies(&transform(&wave(5.0).0, 128.0, &TABLES));
        let expected = (25.0f32 * 1024.0 * 0.375).powi(2);
        let found = energy.iter().sum::<f32>();
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}
