//! What a patch tells of its blur: the energy in bands of spatial frequency, as logarithms.
//!
//! A Gaussian of standard deviation s multiplies the energy at angular frequency w by exp(-(s w)²), so a change of blur
//! shifts each band's logarithm by an amount that depends on neither contrast nor texture.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "indices and weights of a 32x32 transform"
)]

use std::f64::consts::TAU;
use std::sync::LazyLock;

use multiversion::multiversion;

use super::{mgm, mlr};
use crate::imaging::{PATCH_SIDE, Patch};

/// Bands of radial frequency.
const BANDS: usize = 14;
/// Values [`features`] gives: the bands, contrast, mean gradient magnitude, mean local ratio, brightness.
pub const FEATURES: usize = BANDS + 4;
/// Columns of the transform that a real patch needs: frequencies 0..=16; padded to whole vectors.
const COLUMNS: usize = 24;
const HALF: usize = PATCH_SIDE / 2;

type Matrix = [[f32; COLUMNS]; PATCH_SIDE];

/// Waves for the transform, times the Hann window along their axis.
struct Tables {
    /// cos and sin of 2 pi row column / 32 for the first [`COLUMNS`] frequencies.
    cos: Matrix,
    sin: Matrix,
    /// cos and sin for all 32 frequencies of the second axis.
    full_cos: [[f32; PATCH_SIDE]; PATCH_SIDE],
    full_sin: [[f32; PATCH_SIDE]; PATCH_SIDE],
    /// Band of each (row frequency, column frequency), `BANDS` for none.
    band: [[usize; COLUMNS]; PATCH_SIDE],
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
    Tables {
        cos: table(f64::cos),
        sin: table(f64::sin),
        full_cos: full(f64::cos),
        full_sin: full(f64::sin),
        band: std::array::from_fn(|ky| std::array::from_fn(|kx| band(ky, kx))),
    }
});

/// Band of a frequency pair: by radius, finer for low frequencies; none for the mean and its leakage, and the far corners.
fn band(ky: usize, kx: usize) -> usize {
    if kx > HALF {
        return BANDS;
    }
    let ky = ky.min(PATCH_SIDE - ky) as f64;
    let radius = ky.hypot(kx as f64);
    let edges = [1.5, 2.2, 3.0, 3.8, 4.7, 5.7, 6.8, 8.0, 9.4, 11.0, 12.8, 14.6, 16.5, 18.5, 20.5];
    edges.windows(2).position(|pair| (pair[0]..pair[1]).contains(&radius)).unwrap_or(BANDS)
}

/// The patch's features, each of the order of 1.
#[must_use]
pub fn features(patch: &Patch) -> [f32; FEATURES] {
    let tables = &*TABLES;
    let mean = patch.0.iter().sum::<f32>() / patch.0.len() as f32;
    let (energy, count) = band_energies(&patch.0, mean, tables);
    let variance = patch.0.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / patch.0.len() as f32;
    let mut out = [0.0; FEATURES];
    for band in 0..BANDS {
        // 30: far below a gray level's noise, so that an empty band gives a finite value.
        out[band] = 0.25 * ((energy[band] / count[band] + 30.0).ln() - 9.0);
    }
    out[BANDS] = 0.5 * ((variance + 0.1).ln() - 5.0);
    out[BANDS + 1] = ((mgm(patch) + 0.5).ln() - 3.5) as f32;
    out[BANDS + 2] = 0.5 * ((mlr(patch) - 1.0 + 1e-4).ln() as f32 + 3.5);
    out[BANDS + 3] = (mean - 128.0) / 64.0;
    out
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn band_energies(patch: &[f32; PATCH_SIDE * PATCH_SIDE], mean: f32, tables: &Tables) -> ([f32; BANDS], [f32; BANDS]) {
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
    let (mut energy, mut count) = ([0.0f32; BANDS], [0.0f32; BANDS]);
    for ky in 0..PATCH_SIDE {
        let (mut re, mut im) = ([0.0f32; COLUMNS], [0.0f32; COLUMNS]);
        for row in 0..PATCH_SIDE {
            let (cos, sin) = (tables.full_cos[ky][row], tables.full_sin[ky][row]);
            for k in 0..COLUMNS {
                re[k] += real[row][k] * cos - imaginary[row][k] * sin;
                im[k] += real[row][k] * sin + imaginary[row][k] * cos;
            }
        }
        for k in 0..=HALF {
            let band = tables.band[ky][k];
            if band < BANDS {
                energy[band] += re[k] * re[k] + im[k] * im[k];
                count[band] += 1.0;
            }
        }
    }
    (energy, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(frequency: f64) -> Patch {
        Patch(std::array::from_fn(|i| {
            (128.0 + 50.0 * (TAU * frequency * (i % PATCH_SIDE) as f64 / PATCH_SIDE as f64 + 0.6).cos()) as f32
        }))
    }

    #[test]
    fn a_wave_lights_up_its_own_band() {
        for (frequency, band) in [(2.0, 0), (5.0, 4), (10.0, 8), (14.0, 11)] {
            let found = features(&wave(frequency));
            let brightest = (0..BANDS).max_by(|&a, &b| found[a].total_cmp(&found[b])).unwrap();
            assert!(brightest.abs_diff(band) <= 1, "{frequency}: {brightest}");
        }
    }

    #[test]
    fn the_transform_is_the_textbook_one() {
        // A wave of amplitude A at frequency (5, 0) under a Hann window (weights 1/4, 1/2, 1/4 on neighbouring
        // frequencies along each axis) has |X|² = (A/2 · 512² · ...)²: summed over the half plane, with both signs of
        // the row frequency, (A/2 · 32 · 32)² · (3/8)² by Parseval.
        let (energy, _) = band_energies(&wave(5.0).0, 128.0, &TABLES);
        let expected = (25.0f32 * 1024.0 * 0.375).powi(2);
        let found = energy.iter().sum::<f32>();
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}
