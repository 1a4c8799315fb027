//! Blurs whole pictures by the spots that lenses make of a point: a Gaussian, a disc, a disc with a
//! brighter rim or core.

use multiversion::multiversion;

use super::blur::gaussian_blur;
use parfocal_imaging::GrayImage;

/// Share of a disc's radius within which its core lies.
const CORE: f32 = 0.7;

/// The spot that a point becomes out of focus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LensSpot {
    /// A Gaussian, as in the paper.
    Gaussian,
    /// A disc, as a round aperture makes it. Its rim, the outer three tenths of its radius, is brighter than its core
    /// by the factor `1 + rim`, or darker if `rim` is below 0. Spherical aberration brightens the rim on one side of
    /// focus and the core on the other.
    Disc {
        /// Excess brightness of the rim over the core, above -1.
        rim: f32,
    },
}

/// `picture` blurred by `spot`. A plain disc would have a standard deviation of `sigma` pixels along
/// each axis: its radius is twice that. Outside the picture its border pixels are repeated.
pub fn blurred(picture: &GrayImage, sigma: f64, spot: LensSpot) -> GrayImage {
    match spot {
        _ if sigma <= 0.0 => picture.clone(),
        LensSpot::Gaussian => gaussian_blur(picture, sigma),
        LensSpot::Disc { rim } => {
            let radius = 2.0 * sigma as f32;
            let mut sums = disc_sums(picture, radius);
            let mut total = disc_area(radius);

            if rim != 0.0 {
                // The whole disc at the rim's brightness, minus the excess within the core.
                let core = disc_sums(picture, CORE * radius);
                for (whole, core) in sums.iter_mut().zip(core) {
                    *whole = (1.0 + rim) * *whole - rim * core;
                }
                total = (1.0 + rim) * total - rim * disc_area(CORE * radius);
            }

            for sum in &mut sums {
                *sum /= total;
            }

            GrayImage { width: picture.width, height: picture.height, data: sums }
        }
    }
}

/// Half the width of a disc of `radius` at `offset` rows from its middle; 0 outside the disc.
fn half_width(radius: f32, offset: i32) -> f32 {
    (radius * radius - (offset * offset) as f32).max(0.0).sqrt()
}

/// The rows of a disc and its half width in each. A disc smaller than a pixel still covers the pixel itself.
fn spans(radius: f32) -> impl Iterator<Item = (i32, f32)> {
    let reach = radius as i32;
    (-reach..=reach).map(move |offset| {
        let half = half_width(radius, offset);
        (offset, if offset == 0 { half.max(0.5) } else { half })
    })
}

fn disc_area(radius: f32) -> f32 {
    spans(radius).map(|(_, half)| 2.0 * half).sum()
}

/// The sum of `picture` over a disc of `radius` pixels around each pixel; in each row, the pixels at the disc's ends
/// count by the part of them that it covers.
fn disc_sums(picture: &GrayImage, radius: f32) -> Vec<f32> {
    let width = picture.width;
    let height = picture.height;
    let margin = radius as usize + 2;

    // Running sums along each row, with its border pixels repeated: a span's sum is a difference of two.
    let stride = width + 2 * margin + 1;
    let mut running = vec![0.0f32; stride * height];
    for (line, sums) in picture.data.chunks_exact(width).zip(running.chunks_exact_mut(stride)) {
        // Relative to mid-gray, so that sums stay small and exact.
        let mut sum = 0.0;
        for (index, after) in sums[1..].iter_mut().enumerate() {
            sum += line[index.saturating_sub(margin).min(width - 1)] - 128.0;
            *after = sum;
        }
    }

    let mut out = vec![128.0 * disc_area(radius); width * height];
    for (offset, half) in spans(radius) {
        let middle = margin as f32 + 0.5;
        for (y, out) in out.chunks_exact_mut(width).enumerate() {
            let row = (y as i32 + offset).clamp(0, height as i32 - 1) as usize;
            add_span(&running[row * stride..][..stride], middle - half, middle + half, out);
        }
    }

    out
}

/// Adds to each pixel of `out` the sum from `low` to `high` pixels to the right of it, from running sums.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn add_span(running: &[f32], low: f32, high: f32, out: &mut [f32]) {
    let below = low as usize;
    let above = high as usize;
    let low_part = low - below as f32;
    let high_part = high - above as f32;

    let width = out.len();
    let low_near = &running[below..below + width];
    let low_far = &running[below + 1..below + 1 + width];
    let high_near = &running[above..above + width];
    let high_far = &running[above + 1..above + 1 + width];

    for x in 0..width {
        let upto = high_near[x] + high_part * (high_far[x] - high_near[x]);
        let before = low_near[x] + low_part * (low_far[x] - low_near[x]);
        out[x] += upto - before;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of 1000 in the middle of black.
    fn point() -> GrayImage {
        let mut data = vec![0.0; 65 * 65];
        data[32 * 65 + 32] = 1000.0;
        GrayImage { width: 65, height: 65, data }
    }

    /// Sum, standard deviation along x, and value at the middle of a blurred point.
    fn moments(spot: LensSpot, sigma: f64) -> (f32, f32, f32) {
        let picture = blurred(&point(), sigma, spot);
        let sum: f32 = picture.data.iter().sum();
        let squares = picture.data.iter().enumerate().map(|(i, v)| v * ((i % 65) as f32 - 32.0).powi(2));
        (sum, (squares.sum::<f32>() / sum).sqrt(), picture.data[32 * 65 + 32])
    }

    #[test]
    fn spots_keep_the_light_and_have_their_width() {
        for sigma in [0.7, 1.5, 3.0, 6.0] {
            let (sum, width, _) = moments(LensSpot::Disc { rim: 0.0 }, sigma);
            assert!((sum - 1000.0).abs() < 1.0, "{sum}");
            assert!((width - sigma as f32).abs() < 0.25, "{width} {sigma}");
        }
    }

    #[test]
    fn a_bright_rim_spreads_the_light_and_a_bright_core_gathers_it() {
        let [dark, plain, bright] = [-0.5, 0.0, 1.0].map(|rim| moments(LensSpot::Disc { rim }, 4.0));
        assert!(dark.1 < plain.1 && plain.1 < bright.1);
        assert!(dark.2 > plain.2 && plain.2 > bright.2);
        assert!((bright.0 - 1000.0).abs() < 1.0 && (dark.0 - 1000.0).abs() < 1.0);
        // A uniform disc of radius 8 spreads 1000 over 64 pi pixels.
        assert!((plain.2 - 1000.0 / (64.0 * std::f32::consts::PI)).abs() < 0.2, "{}", plain.2);
    }

    #[test]
    fn flat_pictures_stay_flat() {
        let flat = GrayImage { width: 20, height: 9, data: vec![77.0; 180] };
        for spot in [LensSpot::Gaussian, LensSpot::Disc { rim: 0.8 }] {
            assert!(blurred(&flat, 3.0, spot).data.iter().all(|value| (value - 77.0).abs() < 1e-2));
        }
    }
}
