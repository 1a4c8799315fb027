//! Gaussian blur of gray pictures.

use multiversion::multiversion;

use super::gaussian::half_kernel;
use parfocal_imaging::GrayImage;

/// Distance at which the kernel is cut, in standard deviations.
const CUT: f64 = 4.0;

/// Blurs `image` with a Gaussian of standard deviation `sigma` pixels: separable, kernel cut at 4
/// sigma and normalised to sum 1, border pixels repeated outwards. A `sigma` that is not positive and
/// finite leaves the picture as it is.
pub fn gaussian_blur(image: &GrayImage, sigma: f64) -> GrayImage {
    let kernel = gaussian_kernel(sigma);
    if kernel.len() == 1 || image.data.is_empty() {
        return image.clone();
    }

    let mut across = vec![0.0; image.data.len()];
    blur_rows(&image.data, image.width, &kernel, &mut across);

    let mut data = vec![0.0; image.data.len()];
    blur_columns(&across, image.width, &kernel, &mut data);

    GrayImage { width: image.width, height: image.height, data }
}

/// Half of the kernel, from its middle outwards. With its mirror image it sums to 1.
fn gaussian_kernel(sigma: f64) -> Vec<f32> {
    if !(sigma > 0.0 && sigma.is_finite()) {
        return vec![1.0];
    }
    let radius = (CUT * sigma).ceil().min(f64::from(u16::MAX)) as usize;
    half_kernel(sigma, radius).into_iter().map(|weight| weight as f32).collect()
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn blur_rows(data: &[f32], width: usize, kernel: &[f32], blurred: &mut [f32]) {
    let radius = kernel.len() - 1;
    let mut padded = vec![0.0; width + 2 * radius];

    for (row, out) in data.chunks_exact(width).zip(blurred.chunks_exact_mut(width)) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);

        weigh(out, row, kernel[0]);
        for (tap, &weight) in kernel.iter().enumerate().skip(1) {
            add_pair(out, &padded[radius - tap..], &padded[radius + tap..], weight);
        }
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn blur_columns(data: &[f32], width: usize, kernel: &[f32], blurred: &mut [f32]) {
    let height = data.len() / width;
    let row = |y: usize| &data[y * width..][..width];

    for (y, out) in blurred.chunks_exact_mut(width).enumerate() {
        weigh(out, row(y), kernel[0]);
        for (tap, &weight) in kernel.iter().enumerate().skip(1) {
            add_pair(out, row(y.saturating_sub(tap)), row((y + tap).min(height - 1)), weight);
        }
    }
}

/// Sets `out` to `weight` times a row.
#[inline(always)]
pub(crate) fn weigh(out: &mut [f32], values: &[f32], weight: f32) {
    for (out, &value) in out.iter_mut().zip(values) {
        *out = weight * value;
    }
}

/// Adds `weight` times the sum of two rows to `out`.
#[inline(always)]
pub(crate) fn add_pair(out: &mut [f32], one: &[f32], other: &[f32], weight: f32) {
    for ((out, &one), &other) in out.iter_mut().zip(one).zip(other) {
        *out += weight * (one + other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal cumulative distribution at -2, -1, 0, 1 and 2 standard deviations (standard tables).
    const NORMAL_CDF: [(f32, f32); 5] = [(-2.0, 0.02275), (-1.0, 0.15866), (0.0, 0.5), (1.0, 0.84134), (2.0, 0.97725)];

    fn step(width: usize, height: usize, bright: impl Fn(usize, usize) -> bool) -> GrayImage {
        let data = (0..width * height).map(|i| if bright(i % width, i / width) { 200.0 } else { 0.0 }).collect();
        GrayImage::new(width, height, data).unwrap()
    }

    #[test]
    fn a_blurred_step_edge_is_the_normal_distribution() {
        // The edge is between pixels 39 and 40, so pixel 40 + k is k + 0.5 away. We interpolate between two pixels.
        let upright = gaussian_blur(&step(80, 70, |x, _| x >= 40), 4.0);
        let level = gaussian_blur(&step(70, 80, |_, y| y >= 40), 4.0);
        for (sigmas, expected) in NORMAL_CDF {
            let right = (40.0 + 4.0 * sigmas) as usize;
            let across = f32::midpoint(upright.data[35 * 80 + right - 1], upright.data[35 * 80 + right]) / 200.0;
            let down = f32::midpoint(level.data[(right - 1) * 70 + 35], level.data[right * 70 + 35]) / 200.0;
            assert!((across - expected).abs() < 2e-3, "{across} {expected}");
            assert!((down - expected).abs() < 2e-3, "{down} {expected}");
        }
    }

    #[test]
    fn a_flat_picture_stays_flat_at_its_borders() {
        let flat = GrayImage::new(9, 7, vec![77.0; 63]).unwrap();
        for value in gaussian_blur(&flat, 5.0).data {
            assert!((value - 77.0).abs() < 1e-3);
        }
    }

    #[test]
    fn no_blur_is_the_same_picture() {
        let picture = step(9, 7, |x, y| x > y);
        for sigma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(gaussian_blur(&picture, sigma), picture);
        }
        assert_eq!(gaussian_blur(&GrayImage::default(), 2.0), GrayImage::default());
    }
}
