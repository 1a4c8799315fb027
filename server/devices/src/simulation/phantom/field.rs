//! Square fields of numbers over the phantom's surface: smooth noise, spline upsampling, slopes.

use multiversion::multiversion;
use rand::{Rng, RngExt};

/// Side of the phantom's square surface in texels; one texel is about one pixel of a band at the usual
/// working distance.
pub const SIDE: usize = 1024;

/// The value that stands for an abundance of 1 in a texel. It leaves headroom for mirrored lamps of 8 times white.
pub(super) const UNIT: f32 = 8191.0;

/// Standard deviation of uniform noise on -1..1 after the spline's smoothing in both directions.
const AFTER_SPLINE: f32 = 0.28;

/// A square grid of values, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) side: usize,
    pub(super) data: Vec<f32>,
}

impl Field {
    pub(super) fn filled(side: usize, value: f32) -> Self {
        Self { side, data: vec![value; side * side] }
    }

    pub(super) fn from_fn(side: usize, value: impl Fn(usize, usize) -> f32) -> Self {
        let data = (0..side * side).map(|index| value(index % side, index / side)).collect();
        Self { side, data }
    }

    pub(super) fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.side..][..self.side]
    }

    /// The value nearest to a place; outside the field, that of the border.
    pub(super) fn near(&self, x: f32, y: f32) -> f32 {
        let last = (self.side - 1) as f32;
        self.data[y.clamp(0.0, last) as usize * self.side + x.clamp(0.0, last) as usize]
    }
}

/// A smooth field given by coarse knots: a cubic B-spline with a knot every `cell` places, made row by
/// row as needed.
pub(super) struct Spline {
    side: usize,
    /// The knots' rows, already at full width.
    wide: Vec<f32>,
    /// Weights of the four nearest knots, by place within a cell.
    weights: Vec<[f32; 4]>,
}

impl Spline {
    /// Smooth noise of mean 0 and standard deviation about 1, whose blobs are about `cell` wide.
    pub(super) fn noise(side: usize, cell: usize, rng: &mut impl Rng) -> Self {
        let count = knots(side, cell).pow(2);
        let data = (0..count).map(|_| (rng.random::<f32>() * 2.0 - 1.0) / AFTER_SPLINE).collect();
        Self::new(&Field { side: knots(side, cell), data }, side, cell)
    }

    /// The spline over `side` places through a field of [`knots`]`(side, cell)` knots a side.
    pub(super) fn new(coarse: &Field, side: usize, cell: usize) -> Self {
        debug_assert_eq!(coarse.side, knots(side, cell));

        let weights: Vec<[f32; 4]> = (0..cell).map(|phase| spline(phase as f32 / cell as f32)).collect();
        let mut wide = vec![0.0; coarse.side * side];

        for (knots, wide) in coarse.data.chunks_exact(coarse.side).zip(wide.chunks_exact_mut(side)) {
            for (taps, wide) in knots.windows(4).zip(wide.chunks_mut(cell)) {
                for (out, weights) in wide.iter_mut().zip(&weights) {
                    *out = taps[0] * weights[0] + taps[1] * weights[1] + taps[2] * weights[2] + taps[3] * weights[3];
                }
            }
        }

        Self { side, wide, weights }
    }

    /// Writes row `y` into `out`.
    pub(super) fn row_into(&self, y: usize, out: &mut [f32]) {
        let cell = self.weights.len();
        blend(out, &self.wide[(y / cell) * self.side..], self.weights[y % cell]);
    }

    /// All rows.
    pub(super) fn field(&self) -> Field {
        let mut field = Field::filled(self.side, 0.0);
        for (y, row) in field.data.chunks_exact_mut(self.side).enumerate() {
            self.row_into(y, row);
        }
        field
    }
}

/// Knots a side that a spline over `side` places needs with one every `cell`.
pub(super) fn knots(side: usize, cell: usize) -> usize {
    side.div_ceil(cell) + 3
}

/// Weights of a uniform cubic B-spline's four knots at `t` (0..1) between the middle two.
fn spline(t: f32) -> [f32; 4] {
    let rest = 1.0 - t;
    [
        rest * rest * rest / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * rest * rest * rest - 6.0 * rest * rest + 4.0) / 6.0,
        t * t * t / 6.0,
    ]
}

/// Weighted sum of four consecutive rows.
#[multiversion(targets("x86_64+avx2+fma"))]
fn blend(out: &mut [f32], rows: &[f32], weights: [f32; 4]) {
    let side = out.len();
    let (first, rest) = rows.split_at(side);
    let (second, rest) = rest.split_at(side);
    let (third, fourth) = rest.split_at(side);

    let taps = first.iter().zip(second).zip(third).zip(fourth);
    for (out, (((a, b), c), d)) in out.iter_mut().zip(taps) {
        *out = a * weights[0] + b * weights[1] + c * weights[2] + d * weights[3];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_spline_keeps_straight_lines_straight() {
        let side = 40;
        let cell = 8;
        let coarse = Field::from_fn(knots(side, cell), |x, y| x as f32 + 10.0 * y as f32);
        let fine = Spline::new(&coarse, side, cell).field();
        for y in 0..side {
            for x in 0..side {
                let expected = (x as f32 / 8.0 + 1.0) + 10.0 * (y as f32 / 8.0 + 1.0);
                assert!((fine.row(y)[x] - expected).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn noise_is_centred_and_of_unit_spread() {
        let noise = Spline::noise(512, 4, &mut ChaCha8Rng::seed_from_u64(5)).field();
        let count = noise.data.len() as f32;
        let mean = noise.data.iter().sum::<f32>() / count;
        let variance = noise.data.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / count;
        assert!(mean.abs() < 0.05, "{mean}");
        assert!((variance.sqrt() - 1.0).abs() < 0.1, "{variance}");
    }
}
