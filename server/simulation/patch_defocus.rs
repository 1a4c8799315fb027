//! Defocus of one patch of a sharp picture: only the patch's own 32x32 pixels are computed.

use multiversion::multiversion;

use super::gaussian;
use crate::imaging::{GrayImage, PATCH_SIDE, Patch};

/// Widest supported reach of a kernel, in pixels either side: four times the largest sigma of the scans, 8.
const MAX_REACH: usize = 32;
/// Pixels a row that the widest kernel needs.
pub(super) const MAX_SIDE: usize = PATCH_SIDE + 2 * MAX_REACH;
/// Below this a blur changes no grey value that a camera could tell.
const LEAST_SIGMA: f64 = 0.15;

/// Shape of the blur that a point becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spot {
    /// A Gaussian, as in the paper.
    Gaussian,
    /// A disc of the same variance, as a round aperture makes it: its radius is twice the Gaussian's sigma.
    Disc,
}

/// Scratch space that [`Defocus::patch`] reuses.
#[derive(Debug, Clone)]
pub struct Defocus {
    source: Box<[f32]>,
    rows: Box<[f32]>,
    sums: Box<[f32]>,
}

impl Default for Defocus {
    fn default() -> Self {
        let zeros = |count| vec![0.0; count].into();
        Self {
            source: zeros(MAX_SIDE * MAX_SIDE),
            rows: zeros(MAX_SIDE * PATCH_SIDE),
            sums: zeros(MAX_SIDE * (MAX_SIDE + 1)),
        }
    }
}

impl Defocus {
    /// The patch whose top left pixel is `(x, y)` of `image` (which must not be empty), blurred by a spot of standard
    /// deviation `sigma` pixels (at most 8; more counts as 8). Outside the image its border pixels go on.
    pub fn patch(&mut self, image: &GrayImage, (x, y): (isize, isize), sigma: f64, spot: Spot) -> Patch {
        self.patch_of(sigma, spot, |reach, side, source| {
            gather(image, (x - reach as isize, y - reach as isize), side, source);
        })
    }

    /// The same of a scene that `look` shows: it is called with how many pixels around the patch matter, how many that makes
    /// a row, and where to put them, row after row.
    pub fn patch_of(&mut self, sigma: f64, spot: Spot, look: impl FnOnce(usize, usize, &mut [f32])) -> Patch {
        let sigma = sigma.clamp(0.0, 8.0);
        let reach = if sigma < LEAST_SIGMA { 0 } else { ((4.0 * sigma).ceil() as usize).min(MAX_REACH) };
        let side = PATCH_SIDE + 2 * reach;
        look(reach, side, &mut self.source);
        let mut patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        match spot {
            _ if reach == 0 => patch.0.copy_from_slice(&self.source[..PATCH_SIDE * PATCH_SIDE]),
            Spot::Gaussian => {
                let kernel: Vec<f32> = gaussian::kernel(sigma, reach).into_iter().map(|weight| weight as f32).collect();
                blur_rows(&self.source[..side * side], side, &kernel, &mut self.rows);
                blur_columns(&self.rows[..side * PATCH_SIDE], &kernel, &mut patch.0);
            }
            Spot::Disc => {
                let source = &self.source[..side * side];
                disc(source, side, reach, 2.0 * sigma as f32, &mut self.sums, &mut patch.0);
            }
        }
        patch
    }
}

/// Fills `source`, `side` pixels a row, from `image`'s `(left, top)` on.
fn gather(image: &GrayImage, (left, top): (isize, isize), side: usize, source: &mut [f32]) {
    let (width, height) = (image.width as isize, image.height as isize);
    for (row, target) in source.chunks_exact_mut(side).take(side).enumerate() {
        let y = (top + row as isize).clamp(0, height - 1) as usize;
        let line = &image.data[y * image.width..(y + 1) * image.width];
        if left >= 0 && left + side as isize <= width {
            target.copy_from_slice(&line[left as usize..left as usize + side]);
        } else {
            for (column, value) in target.iter_mut().enumerate() {
                *value = line[(left + column as isize).clamp(0, width - 1) as usize];
            }
        }
    }
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn blur_rows(source: &[f32], side: usize, kernel: &[f32], rows: &mut [f32]) {
    for (line, out) in source.chunks_exact(side).zip(rows.chunks_exact_mut(PATCH_SIDE)) {
        let mut sums = [0.0f32; PATCH_SIDE];
        for (tap, weight) in kernel.iter().enumerate() {
            for (sum, value) in sums.iter_mut().zip(&line[tap..tap + PATCH_SIDE]) {
                *sum += weight * value;
            }
        }
        out.copy_from_slice(&sums);
    }
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn blur_columns(rows: &[f32], kernel: &[f32], out: &mut [f32]) {
    for (row, out) in out.chunks_exact_mut(PATCH_SIDE).enumerate() {
        let mut sums = [0.0f32; PATCH_SIDE];
        for (weight, line) in kernel.iter().zip(rows[row * PATCH_SIDE..].chunks_exact(PATCH_SIDE)) {
            for (sum, value) in sums.iter_mut().zip(line) {
                *sum += weight * value;
            }
        }
        out.copy_from_slice(&sums);
    }
}

/// Mean over a disc, its rim weighted by cover along the row: each row's span is a difference of running sums, and all
/// columns of a row share how their spans lie to the pixels.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn disc(source: &[f32], side: usize, reach: usize, radius: f32, sums: &mut [f32], out: &mut [f32]) {
    for (line, sums) in source.chunks_exact(side).zip(sums.chunks_exact_mut(side + 1)) {
        sums[0] = 0.0;
        let mut sum = 0.0;
        for (value, after) in line.iter().zip(&mut sums[1..]) {
            sum += value;
            *after = sum;
        }
    }
    let mut area = 0.0;
    out.fill(0.0);
    for offset in 0..=2 * reach {
        let high = offset as f32 - reach as f32;
        let half = (radius * radius - high * high).max(0.0).sqrt().min(reach as f32);
        area += 2.0 * half;
        let middle = reach as f32 + 0.5;
        for (edge, sign) in [(middle + half, 1.0f32), (middle - half, -1.0)] {
            let whole = edge as usize;
            let (near, far) = (sign * (1.0 - edge.fract()), sign * edge.fract());
            for (row, out) in out.chunks_exact_mut(PATCH_SIDE).enumerate() {
                let sums = &sums[(row + offset) * (side + 1) + whole..][..=PATCH_SIDE];
                for (value, pair) in out.iter_mut().zip(sums.windows(2)) {
                    *value += near * pair[0] + far * pair[1];
                }
            }
        }
    }
    for value in out.iter_mut() {
        *value /= area;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0 left of column 64, 200 from there on.
    fn step_edge() -> GrayImage {
        let data = (0..128 * 128).map(|index| if index % 128 < 64 { 0.0 } else { 200.0 }).collect();
        GrayImage::new(128, 128, data).unwrap()
    }

    /// Abramowitz and Stegun 7.1.26, good to 1.5e-7.
    fn erf(x: f64) -> f64 {
        let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
        let poly = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
        let value = 1.0 - poly.iter().fold(0.0, |sum, c| (sum + c) * t) * (-x * x).exp();
        value * x.signum()
    }

    #[test]
    fn a_blurred_edge_is_the_error_function() {
        let mut defocus = Defocus::default();
        for sigma in [2.0, 4.0, 8.0] {
            let patch = defocus.patch(&step_edge(), (48, 48), sigma, Spot::Gaussian);
            for column in 0..PATCH_SIDE {
                // Sampling the Gaussian at whole pixels costs up to half a gray level at sigma 2. The edge lies between columns 63 and 64, so at 15.5 in the patch's columns.
                let expected = 100.0 * (1.0 + erf((column as f64 - 15.5) / (sigma * 2.0f64.sqrt())));
                let found = f64::from(patch.0[10 * PATCH_SIDE + column]);
                assert!((found - expected).abs() < 0.6, "sigma {sigma} column {column}: {found} != {expected}");
            }
        }
    }

    #[test]
    fn no_blur_copies_and_borders_go_on() {
        let image = GrayImage::new(2, 1, vec![10.0, 20.0]).unwrap();
        let patch = Defocus::default().patch(&image, (-1, 0), 0.0, Spot::Gaussian);
        assert_eq!(&patch.0[..4], &[10.0, 10.0, 20.0, 20.0]);
    }

    #[test]
    fn a_disc_keeps_brightness_and_has_the_gaussians_variance() {
        let mut data = vec![0.0; 128 * 128];
        data[64 * 128 + 64] = 1000.0;
        let point = GrayImage::new(128, 128, data).unwrap();
        let patch = Defocus::default().patch(&point, (48, 48), 3.0, Spot::Disc);
        let total: f32 = patch.0.iter().sum();
        let variance: f32 = patch.0.iter().enumerate().map(|(i, v)| v * ((i % 32) as f32 - 16.0).powi(2)).sum();
        assert!((total - 1000.0).abs() < 5.0, "{total}");
        assert!((variance / total - 9.0).abs() < 0.8, "{}", variance / total);
    }
}
