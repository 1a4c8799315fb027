//! Gaussian defocus of a window of a colour picture, fast enough for every frame.

use multiversion::multiversion;

use crate::simulation::blur::{add_pair, weigh};
use crate::simulation::gaussian::half_kernel;
use parfocal_imaging::RgbImage;

/// Standard deviations after which the kernel is cut: the part left out weighs 0.05 %.
const CUT: f64 = 3.5;
/// Blur below this, in pixels, changes no byte by more than one.
const NARROWEST: f64 = 0.15;

/// Blurs windows; reuses its memory from one to the next.
#[derive(Debug, Default)]
pub(super) struct Defocus {
    /// The window with its margin above and below, blurred across.
    across: Vec<f32>,
    line: Vec<f32>,
}

impl Defocus {
    /// The window of `size` at `corner` of `picture`, blurred with standard deviation `sigma` pixels. The
    /// surroundings of the window blur into it; outside the picture, its border is repeated.
    pub(super) fn see(&mut self, picture: &RgbImage, corner: [usize; 2], size: [usize; 2], sigma: f64) -> RgbImage {
        let [width, height] = size;
        let mut data = vec![0; 3 * width * height];

        if sigma < NARROWEST {
            let rows = data.chunks_exact_mut(3 * width);
            for (y, out) in rows.enumerate() {
                let start = 3 * ((corner[1] + y) * picture.width + corner[0]);
                out.copy_from_slice(&picture.data[start..][..3 * width]);
            }

            return RgbImage { width, height, data };
        }

        let kernel = kernel(sigma);
        let reach = kernel.len() - 1;

        self.across.resize(3 * width * (height + 2 * reach), 0.0);

        for (row, out) in self.across.chunks_exact_mut(3 * width).enumerate() {
            let y = (corner[1] + row).saturating_sub(reach).min(picture.height - 1);
            pad(&mut self.line, &picture.data[3 * y * picture.width..][..3 * picture.width], corner[0], width, reach);

            blur_across(out, &self.line, &kernel);
        }

        blur_down(&mut data, &self.across, 3 * width, &kernel);
        RgbImage { width, height, data }
    }
}

/// One half of a Gaussian that sums to 1 with its mirror image, the middle first.
fn kernel(sigma: f64) -> Vec<f32> {
    let reach = (CUT * sigma).ceil() as usize;
    half_kernel(sigma, reach).into_iter().map(|weight| weight as f32).collect()
}

/// Collects the pixels from `reach` left of `left` to `reach` right of `left + width`; outside the row,
/// its border is repeated.
fn pad(line: &mut Vec<f32>, row: &[u8], left: usize, width: usize, reach: usize) {
    let pixels = row.as_chunks::<3>().0;
    line.clear();

    let places = left..left + width + 2 * reach;
    line.extend(places.flat_map(|x| pixels[x.saturating_sub(reach).min(pixels.len() - 1)].map(f32::from)));
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn blur_across(out: &mut [f32], line: &[f32], kernel: &[f32]) {
    let middle = 3 * (kernel.len() - 1);
    weigh(out, &line[middle..], kernel[0]);
    for (tap, &weight) in kernel.iter().enumerate().skip(1) {
        add_pair(out, &line[middle - 3 * tap..], &line[middle + 3 * tap..], weight);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn blur_down(data: &mut [u8], across: &[f32], row: usize, kernel: &[f32]) {
    let reach = kernel.len() - 1;
    let mut sum = vec![0.0; row];

    for (y, out) in data.chunks_exact_mut(row).enumerate() {
        let at = |y: usize| &across[y * row..][..row];
        weigh(&mut sum, at(y + reach), kernel[0]);

        for (tap, &weight) in kernel.iter().enumerate().skip(1) {
            add_pair(&mut sum, at(y + reach - tap), at(y + reach + tap), weight);
        }

        for (out, sum) in out.iter_mut().zip(&sum) {
            *out = (sum + 0.5) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dark left of column 100, bright from it on.
    fn edge() -> RgbImage {
        let row = (0..200).flat_map(|x| [if x < 100 { 50 } else { 200 }; 3]);
        RgbImage { width: 200, height: 90, data: row.collect::<Vec<u8>>().repeat(90) }
    }

    /// The integral of the standard normal distribution (Abramowitz and Stegun 7.1.26, error below 1e-6).
    fn normal_integral(x: f64) -> f64 {
        let t = 1.0 / (1.0 + 0.327_591_1 * x.abs() / std::f64::consts::SQRT_2);
        let poly =
            t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
        let tail = 0.5 * poly * (-0.5 * x * x).exp();
        if x > 0.0 { 1.0 - tail } else { tail }
    }

    #[test]
    fn an_edge_becomes_the_integral_of_a_gaussian() {
        for sigma in [1.5, 4.0, 8.0] {
            let seen = Defocus::default().see(&edge(), [20, 10], [160, 60], sigma);
            assert_eq!((seen.width, seen.height), (160, 60));
            for x in 0..160 {
                // The edge stands half a pixel left of column 100, which is column 80 of the window.
                let expected = 50.0 + 150.0 * normal_integral((f64::from(x) - 79.5) / sigma);
                let found = f64::from(seen.data[3 * (30 * 160 + x as usize) + 1]);
                assert!((found - expected).abs() < 1.5, "sigma {sigma}, column {x}: {found} {expected}");
            }
        }
    }

    #[test]
    fn in_focus_the_window_is_the_picture() {
        let data = (0..3 * 80 * 70).map(|i| (i * 31 % 251) as u8).collect();
        let picture = RgbImage { width: 80, height: 70, data };
        let seen = Defocus::default().see(&picture, [5, 9], [40, 30], 0.0);
        assert_eq!(seen.data[..3], picture.data[3 * (9 * 80 + 5)..][..3]);
        assert_eq!(seen.data[3 * (29 * 40 + 39)..], picture.data[3 * (38 * 80 + 44)..][..3]);
    }

    #[test]
    fn an_even_picture_stays_even_to_its_very_border() {
        let picture = RgbImage { width: 64, height: 64, data: vec![123; 3 * 64 * 64] };
        for sigma in [0.2, 3.0, 8.0] {
            let seen = Defocus::default().see(&picture, [16, 16], [48, 48], sigma);
            assert!(seen.data.iter().all(|value| *value == 123), "sigma {sigma}");
        }
    }
}
