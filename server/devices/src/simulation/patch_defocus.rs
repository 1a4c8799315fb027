//! Defocus of one patch of a sharp picture: only the patch's own 32x32 values are computed.

use multiversion::multiversion;

use super::gaussian;
use parfocal_imaging::{GrayImage, PATCH_SIDE, Patch, Square, Surroundings, fill_block_means};

/// Widest supported reach of a kernel, in pixels either side: four times the largest sigma of the scans, 8.
const MAX_REACH: usize = 32;
/// Pixels a row of the largest square with what the widest kernel needs around it.
pub(super) const MAX_SIDE: usize = Surroundings::SIDE + 2 * MAX_REACH;
/// Widest blur, in pixels of standard deviation.
const MOST_SIGMA: f64 = 8.0;
/// From this sigma on, squares are blurred at half the resolution: no detail is left that would show the difference.
const WIDE_SIGMA: f64 = 3.0;
/// Pixels along each axis that are averaged into one value at half the resolution.
const COARSE: usize = 2;
/// Reach, in values at half the resolution, of the kernel of a blur whose sigma is below one such value.
const NARROW_REACH: usize = 4;
/// Below this sigma, blur changes gray values by less than a camera can tell.
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
#[derive(Debug, Clone, Default)]
pub struct Defocus {
    source: Vec<f32>,
    rows: Vec<f32>,
    sums: Vec<f32>,
}

impl Defocus {
    /// The patch whose top left pixel is `(x, y)` of `image` (which must not be empty), blurred by a spot of standard
    /// deviation `sigma` pixels (at most 8; more counts as 8). Outside the image its border pixels are repeated.
    pub fn patch(&mut self, image: &GrayImage, (x, y): (isize, isize), sigma: f64, spot: Spot) -> Patch {
        self.patch_of(sigma, spot, |reach, side, source| {
            gather(image, (x - reach as isize, y - reach as isize), side, source);
        })
    }

    /// As [`Defocus::patch`], of a scene that `look` shows. `look` gets the number of pixels around the patch that
    /// matter, the number of pixels in a row, and the slice to fill row after row.
    pub fn patch_of(&mut self, sigma: f64, spot: Spot, look: impl FnOnce(usize, usize, &mut [f32])) -> Patch {
        let mut patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        self.fill(PATCH_SIDE, sigma, spot, look, &mut patch.0);
        patch
    }

    /// Gray levels of `square` of `image`, row after row, blurred as in [`Defocus::patch`]. A [wide](Self::is_wide) blur
    /// is made from means of 2x2 pixels.
    pub fn square(&mut self, image: &GrayImage, square: Square, sigma: f64, spot: Spot) -> Vec<f32> {
        let Square { x, y, side } = square;
        if Self::is_wide(sigma) {
            return self.coarse_square(side, sigma, spot, |reach, coarse_side, source| {
                let margin = (COARSE * reach) as isize;
                let fine_side = COARSE * coarse_side;
                let mut fine = vec![0.0; fine_side * fine_side];
                gather(image, (x as isize - margin, y as isize - margin), fine_side, &mut fine);
                fill_block_means::<COARSE>(&fine, fine_side, coarse_side, source);
            });
        }

        self.square_of(side, sigma, spot, |reach, width, source| {
            gather(image, (x as isize - reach as isize, y as isize - reach as isize), width, source);
        })
    }

    /// Gray levels of a square of `side` pixels (at most 128) of a scene that `look` shows, as in
    /// [`Defocus::patch_of`].
    pub fn square_of(
        &mut self,
        side: usize,
        sigma: f64,
        spot: Spot,
        look: impl FnOnce(usize, usize, &mut [f32]),
    ) -> Vec<f32> {
        let mut levels = vec![0.0; side * side];
        self.fill(side, sigma, spot, look, &mut levels);
        levels
    }

    /// Whether a blur of `sigma` leaves so little detail that a square may be made from means of 2x2 pixels.
    pub fn is_wide(sigma: f64) -> bool {
        sigma >= WIDE_SIGMA
    }

    fn fill(
        &mut self,
        side: usize,
        sigma: f64,
        spot: Spot,
        look: impl FnOnce(usize, usize, &mut [f32]),
        out: &mut [f32],
    ) {
        let sigma = sigma.clamp(0.0, MOST_SIGMA);
        let reach = if sigma < LEAST_SIGMA { 0 } else { ((4.0 * sigma).ceil() as usize).min(MAX_REACH) };
        self.blur(side, &Blur { sigma, reach, spot, kernel: gaussian::kernel }, look, out);
    }

    /// Gray levels of a square of `side` pixels of a scene that `look` shows in means of 2x2
    /// pixels, as in [`Defocus::patch_of`], blurred by a spot of standard deviation `sigma` pixels.
    pub fn coarse_square(
        &mut self,
        side: usize,
        sigma: f64,
        spot: Spot,
        look: impl FnOnce(usize, usize, &mut [f32]),
    ) -> Vec<f32> {
        let sigma = sigma.clamp(0.0, MOST_SIGMA) / COARSE as f64;
        let side = side / COARSE;
        let mut levels = vec![0.0; side * side];

        let blur = if sigma < 1.0 {
            // Such a narrow spot shows only its variance, not its shape. Samples of a Gaussian would have less than its
            // variance.
            Blur { sigma, reach: NARROW_REACH, spot: Spot::Gaussian, kernel: gaussian::discrete_kernel }
        } else {
            Blur { sigma, reach: (4.0 * sigma).ceil() as usize, spot, kernel: gaussian::kernel }
        };
        self.blur(side, &blur, look, &mut levels);

        expanded(&levels, side)
    }

    /// Fills `out` (`width` x `width` values) with what `look` shows, blurred by `blur`.
    fn blur(&mut self, width: usize, blur: &Blur, look: impl FnOnce(usize, usize, &mut [f32]), out: &mut [f32]) {
        let &Blur { sigma, reach, spot, kernel } = blur;
        let side = width + 2 * reach;
        self.source.resize(side * side, 0.0);
        look(reach, side, &mut self.source);

        match spot {
            _ if reach == 0 => out.copy_from_slice(&self.source),
            Spot::Gaussian => {
                let kernel: Vec<f32> = kernel(sigma, reach).into_iter().map(|weight| weight as f32).collect();
                self.rows.resize(side * width, 0.0);
                blur_rows(&self.source, side, &kernel, width, &mut self.rows);
                blur_columns(&self.rows, &kernel, width, out);
            }
            Spot::Disc => {
                self.sums.resize(side * (side + 1), 0.0);
                disc(&self.source, side, reach, 2.0 * sigma as f32, width, &mut self.sums, out);
            }
        }
    }
}

/// A spot, how many pixels it reaches, and what makes its kernel of both if it is a Gaussian.
struct Blur {
    sigma: f64,
    reach: usize,
    spot: Spot,
    kernel: fn(f64, usize) -> Vec<f64>,
}

/// Twice as wide and as high: each of the `side` x `side` values becomes 2x2 on the slope between its neighbours, whose
/// mean is the value. A mere repetition would have edges where there are none.
fn expanded(levels: &[f32], side: usize) -> Vec<f32> {
    let mut out = vec![0.0; COARSE * COARSE * side * side];
    for y in 0..side {
        let line = |row: usize| &levels[row * side..][..side];
        let (above, here, below) = (line(y.saturating_sub(1)), line(y), line((y + 1).min(side - 1)));
        let (upper, lower) = out[COARSE * COARSE * side * y..][..COARSE * COARSE * side].split_at_mut(COARSE * side);
        for x in 0..side {
            // The new values lie a quarter of a step from the old ones, whose neighbours are two steps apart.
            let right = 0.125 * (here[(x + 1).min(side - 1)] - here[x.saturating_sub(1)]);
            let down = 0.125 * (below[x] - above[x]);
            upper[COARSE * x] = here[x] - right - down;
            upper[COARSE * x + 1] = here[x] + right - down;
            lower[COARSE * x] = here[x] - right + down;
            lower[COARSE * x + 1] = here[x] + right + down;
        }
    }
    out
}

/// Fills `source`, `side` pixels a row, from `image`'s `(left, top)` on.
fn gather(image: &GrayImage, (left, top): (isize, isize), side: usize, source: &mut [f32]) {
    let width = image.width as isize;
    let height = image.height as isize;
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
fn blur_rows(source: &[f32], side: usize, kernel: &[f32], width: usize, rows: &mut [f32]) {
    for (line, out) in source.chunks_exact(side).zip(rows.chunks_exact_mut(width)) {
        for (block, out) in out.as_chunks_mut::<PATCH_SIDE>().0.iter_mut().enumerate() {
            let mut sums = [0.0f32; PATCH_SIDE];
            for (tap, weight) in kernel.iter().enumerate() {
                for (sum, value) in sums.iter_mut().zip(&line[PATCH_SIDE * block + tap..][..PATCH_SIDE]) {
                    *sum += weight * value;
                }
            }

            *out = sums;
        }
    }
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn blur_columns(rows: &[f32], kernel: &[f32], width: usize, out: &mut [f32]) {
    for (row, out) in out.chunks_exact_mut(width).enumerate() {
        for (block, out) in out.as_chunks_mut::<PATCH_SIDE>().0.iter_mut().enumerate() {
            let mut sums = [0.0f32; PATCH_SIDE];
            for (weight, line) in kernel.iter().zip(rows[row * width..].chunks_exact(width)) {
                for (sum, value) in sums.iter_mut().zip(&line[PATCH_SIDE * block..][..PATCH_SIDE]) {
                    *sum += weight * value;
                }
            }

            *out = sums;
        }
    }
}

/// Mean over a disc. Pixels at its rim are weighted by the part of them that it covers along the row. Each row's span
/// is a difference of running sums, and all columns of a row share the same parts at both ends.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn disc(source: &[f32], side: usize, reach: usize, radius: f32, width: usize, sums: &mut [f32], out: &mut [f32]) {
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
            let near = sign * (1.0 - edge.fract());
            let far = sign * edge.fract();

            for (row, out) in out.chunks_exact_mut(width).enumerate() {
                let sums = &sums[(row + offset) * (side + 1) + whole..][..=width];
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
    use crate::simulation::blur::gaussian_blur;
    use crate::simulation::texture::texture;
    use parfocal_imaging::{WIDER, block_means};

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
                // Sampling the Gaussian at whole pixels costs up to half a gray level at sigma 2.
                // The edge lies between columns 63 and 64, so at 15.5 in the patch's columns.
                let expected = 100.0 * (1.0 + erf((column as f64 - 15.5) / (sigma * 2.0f64.sqrt())));
                let found = f64::from(patch.0[10 * PATCH_SIDE + column]);
                assert!((found - expected).abs() < 0.6, "sigma {sigma} column {column}: {found} != {expected}");
            }
        }
    }

    #[test]
    fn a_square_shows_what_the_patches_in_it_show() {
        let picture = texture(4, 300);
        for spot in [Spot::Gaussian, Spot::Disc] {
            for sigma in [0.0, 0.5, 1.5, 2.9, 3.0, 6.0] {
                let mut defocus = Defocus::default();
                let levels = defocus.square(&picture, Square { x: 70, y: 80, side: 128 }, sigma, spot);
                let patch = defocus.patch(&picture, (70 + 32, 80 + 64), sigma, spot);
                let off = |i: usize| (levels[(64 + i / 32) * 128 + 32 + i % 32] - patch.0[i]).powi(2);
                let off = ((0..1024).map(off).sum::<f32>() / 1024.0).sqrt();
                // A wide blur is made at half the resolution, which shifts gray levels by as much as they change within
                // a pixel.
                let most = if sigma < WIDE_SIGMA { 1e-3 } else { 4.0 };
                assert!(off < most, "{spot:?} of {sigma}: {off}");
            }
        }
    }

    #[test]
    fn wide_blur_has_the_block_means_of_blur_at_full_resolution() {
        let picture = texture(4, 300);
        for sigma in [3.0, 4.0, 6.0, 8.0] {
            let whole = gaussian_blur(&picture, sigma);
            let found = Defocus::default().square(&picture, Square { x: 70, y: 80, side: 128 }, sigma, Spot::Gaussian);
            for scale in WIDER {
                let found = block_means(&found, 128, scale);
                let expected = block_means(&whole.data[80 * 300 + 70..], 300, scale);
                let off: f32 = found.0.iter().zip(&expected.0).map(|(a, b)| (a - b).powi(2)).sum::<f32>() / 1024.0;
                assert!(off.sqrt() < 0.5, "sigma {sigma}, scale {scale:?}: {}", off.sqrt());
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
