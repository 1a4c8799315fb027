//! Defocus of one patch of a sharp picture: only the patch's own 32x32 values are computed.

use multiversion::multiversion;

use super::gaussian;
use crate::imaging::{GrayImage, PATCH_SIDE, Patch, fill_block_means};

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
    /// Pixels that the values of a wider patch are means of.
    fine: Vec<f32>,
}

impl Default for Defocus {
    fn default() -> Self {
        let zeros = |count| vec![0.0; count].into();
        Self {
            source: zeros(MAX_SIDE * MAX_SIDE),
            rows: zeros(MAX_SIDE * PATCH_SIDE),
            sums: zeros(MAX_SIDE * (MAX_SIDE + 1)),
            fine: Vec::new(),
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

    /// The wider patch whose values are means of `scale` x `scale` pixels of `image`, from `(x, y)` on, blurred by a spot of
    /// standard deviation `sigma` pixels of the image.
    pub fn wider_patch(
        &mut self,
        image: &GrayImage,
        (x, y): (usize, usize),
        scale: usize,
        sigma: f64,
        spot: Spot,
    ) -> Patch {
        let mut fine = std::mem::take(&mut self.fine);
        let patch = self.wider_patch_of(sigma / scale as f64, spot, |reach, side, source| {
            let margin = (reach * scale) as isize;
            fine.resize((side * scale).pow(2), 0.0);
            gather(image, (x as isize - margin, y as isize - margin), side * scale, &mut fine);
            fill_block_means(&fine, side * scale, scale, side, &mut source[..side * side]);
        });
        self.fine = fine;
        patch
    }

    /// As [`Defocus::patch_of`] where pixels are means of many of a finer picture's, so that blur narrower than a pixel counts too.
    pub fn wider_patch_of(&mut self, sigma: f64, spot: Spot, look: impl FnOnce(usize, usize, &mut [f32])) -> Patch {
        if !(LEAST_SIGMA / 3.0..1.0).contains(&sigma) {
            return self.patch_of(sigma, spot, look);
        }
        // Of so narrow a spot only the variance shows, not the shape.
        let kernel = narrow_kernel(sigma);
        let reach = kernel.len() / 2;
        let side = PATCH_SIDE + 2 * reach;
        look(reach, side, &mut self.source);
        let mut patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        blur_rows(&self.source[..side * side], side, &kernel, &mut self.rows);
        blur_columns(&self.rows[..side * PATCH_SIDE], &kernel, &mut patch.0);
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

/// A kernel of variance `sigma` squared, which must be below 1: `exp(-t) I_n(t)` with t the variance, the discrete Gaussian
/// (Lindeberg 1990). Samples of a Gaussian so narrow would have less variance than that.
fn narrow_kernel(sigma: f64) -> Vec<f32> {
    const REACH: i32 = 4;
    let half = 0.5 * sigma * sigma;
    // The series of the modified Bessel function; its terms shrink by a factor of more than 4.
    let bessel = |order: i32| -> f64 {
        let mut term = (1..=order).fold(1.0, |term, factor| term * half / f64::from(factor));
        let mut sum = term;
        for index in 1..12 {
            term *= half * half / f64::from(index * (index + order));
            sum += term;
        }
        sum
    };
    let weights: Vec<f64> = (-REACH..=REACH).map(|tap| bessel(tap.abs())).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| (weight / sum) as f32).collect()
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
    use crate::imaging::{WIDER, block_means, gaussian_blur};
    use crate::simulation::texture::texture;

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
    fn a_narrow_kernel_has_its_variance() {
        for sigma in [0.05, 0.2, 0.5, 0.8, 0.99] {
            let variance: f64 = narrow_kernel(sigma)
                .iter()
                .zip(-4..=4)
                .map(|(weight, tap): (_, i32)| f64::from(*weight) * f64::from(tap * tap))
                .sum();
            assert!((variance / (sigma * sigma) - 1.0).abs() < 0.02, "{sigma}: {variance}");
        }
    }

    #[test]
    fn a_wider_patch_is_nearly_the_reduced_blurred_picture() {
        let picture = texture(4, 300);
        for sigma in [0.0, 0.7, 1.5, 3.0, 6.0] {
            let whole = gaussian_blur(&picture, sigma);
            for scale in WIDER {
                let found = Defocus::default().wider_patch(&picture, (70, 80), scale, sigma, Spot::Gaussian);
                let expected = block_means(&whole.data[80 * 300 + 70..], 300, scale);
                let off: f32 = found.0.iter().zip(&expected.0).map(|(a, b)| (a - b).powi(2)).sum::<f32>() / 1024.0;
                // What is finer than a pixel folds before the blur here, and after it there.
                assert!(off.sqrt() < 1.0, "sigma {sigma}, scale {scale}: {}", off.sqrt());
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
