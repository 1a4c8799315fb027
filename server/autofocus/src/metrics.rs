//! Focus metrics of a patch: mean gradient magnitude and mean local ratio.
//!
//! Both are computed on the 0..255 gray scale with borders replicated, as in Budd et al., MICCAI 2023 (doi
//! 10.1007/978-3-031-43996-4_63). They run in every control step and millions of times in training, so the inner loops
//! go over whole rows of 32 values, which the compiler turns into vector instructions for the machine at hand.

use std::sync::LazyLock;

use multiversion::multiversion;

use parfocal_imaging::{PATCH_SIDE, Patch};

/// Standard deviation in pixels of the Gaussian in [`mlr`].
pub const MLR_SIGMA: f64 = 4.0;
/// The Gaussian is cut at this distance in pixels: four standard deviations.
const RADIUS: usize = 16;

const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;
const PADDED: usize = PATCH_SIDE + 2;

type Row = [f32; PATCH_SIDE];
type Square = [Row; PATCH_SIDE];

/// Mean gradient magnitude: mean over the patch of `sqrt(Ix² + Iy²)`, where `Ix` and `Iy` are the responses of the 3x3
/// Sobel operators, not normalised (a slope of 1 per pixel gives 8). In gray levels; 0 for a flat patch.
pub fn mgm(patch: &Patch) -> f64 {
    mean(&gradient_magnitude_sums(&patch.0))
}

/// Mean local ratio: mean over the patch of `max((G+1)/(I+1), (I+1)/(G+1))`, where `G` is `I` blurred by a Gaussian of
/// sigma 4, truncated at 4 sigma. Without unit; 1 for a flat patch, else above 1. Gray values must not be negative.
pub fn mlr(patch: &Patch) -> f64 {
    let blur = &*BLUR;
    mean(&local_ratio_sums(&patch.0, &blur.rows, &blur.columns))
}

/// Mean over the patch, from each column's sum.
fn mean(column_sums: &Row) -> f64 {
    column_sums.iter().map(|&sum| f64::from(sum)).sum::<f64>() / PIXELS as f64
}

/// Sum of the Sobel magnitude over each column.
#[multiversion(targets = "simd")]
fn gradient_magnitude_sums(patch: &[f32; PIXELS]) -> Row {
    let rows = patch.as_chunks::<PATCH_SIDE>().0;
    let mut sums = [0.0; PATCH_SIDE];
    for y in 0..PATCH_SIDE {
        let above = padded(&rows[y.saturating_sub(1)]);
        let here = padded(&rows[y]);
        let below = padded(&rows[(y + 1).min(PATCH_SIDE - 1)]);

        // Each Sobel operator takes a 1-2-1 sum along one axis and a difference along the other.
        let mut smooth = [0.0; PADDED];
        let mut slope = [0.0; PADDED];
        for x in 0..PADDED {
            smooth[x] = above[x] + 2.0 * here[x] + below[x];
            slope[x] = below[x] - above[x];
        }

        for x in 0..PATCH_SIDE {
            let ix = smooth[x + 2] - smooth[x];
            let iy = slope[x] + 2.0 * slope[x + 1] + slope[x + 2];
            sums[x] += (ix * ix + iy * iy).sqrt();
        }
    }
    sums
}

/// The row with its first and last values repeated.
#[inline(always)]
fn padded(row: &Row) -> [f32; PADDED] {
    let mut out = [0.0; PADDED];
    out[0] = row[0];
    out[1..=PATCH_SIDE].copy_from_slice(row);
    out[PADDED - 1] = row[PATCH_SIDE - 1];
    out
}

/// Sum of the local ratio over each column.
#[multiversion(targets = "simd")]
fn local_ratio_sums(patch: &[f32; PIXELS], blur_rows: &Square, blur_columns: &Square) -> Row {
    let mut image = [[0.0; PATCH_SIDE]; PATCH_SIDE];
    image.copy_from_slice(patch.as_chunks::<PATCH_SIDE>().0);
    let blurred = product(blur_rows, &product(&image, blur_columns));

    let mut sums = [0.0; PATCH_SIDE];
    for (row, smooth) in image.iter().zip(&blurred) {
        for x in 0..PATCH_SIDE {
            // The greater of a ratio and its inverse is the greater value divided by the smaller one.
            sums[x] += (row[x].max(smooth[x]) + 1.0) / (row[x].min(smooth[x]) + 1.0);
        }
    }
    sums
}

/// Matrix product.
#[inline(always)]
fn product(left: &Square, right: &Square) -> Square {
    let mut out = [[0.0; PATCH_SIDE]; PATCH_SIDE];
    for (out, left) in out.iter_mut().zip(left) {
        for (&factor, right) in left.iter().zip(right) {
            for x in 0..PATCH_SIDE {
                out[x] += factor * right[x];
            }
        }
    }

    out
}

/// A Gaussian blur as two matrices: `blurred = rows * image * columns`. The matrices include the replicated borders. On
/// a patch hardly wider than the kernel, this is faster than a convolution.
struct Blur {
    rows: Square,
    columns: Square,
}

static BLUR: LazyLock<Blur> = LazyLock::new(|| {
    let kernel = gaussian();
    let mut rows = [[0.0; PATCH_SIDE]; PATCH_SIDE];
    let mut columns = [[0.0; PATCH_SIDE]; PATCH_SIDE];

    for out in 0..PATCH_SIDE {
        let mut weights = [0.0; PATCH_SIDE];
        for (tap, weight) in kernel.iter().enumerate() {
            weights[(out + tap).saturating_sub(RADIUS).min(PATCH_SIDE - 1)] += weight;
        }

        for (from, &weight) in weights.iter().enumerate() {
            rows[out][from] = weight as f32;
            columns[from][out] = weight as f32;
        }
    }

    Blur { rows, columns }
});

/// The Gaussian's samples from -16 to 16 pixels, with sum 1.
fn gaussian() -> [f64; 2 * RADIUS + 1] {
    let kernel: [f64; 2 * RADIUS + 1] = std::array::from_fn(|tap| {
        let distance = tap as f64 - RADIUS as f64;
        (-0.5 * (distance / MLR_SIGMA).powi(2)).exp()
    });
    let sum: f64 = kernel.iter().sum();
    kernel.map(|weight| weight / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(value: impl Fn(f64, f64) -> f64) -> Patch {
        Patch(std::array::from_fn(|i| value((i % PATCH_SIDE) as f64, (i / PATCH_SIDE) as f64) as f32))
    }

    #[track_caller]
    fn assert_close(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "{found} is not {expected} within {tolerance}");
    }

    #[test]
    fn a_flat_patch_has_no_gradient_and_ratio_one() {
        for level in [0.0, 1.0, 100.0, 255.0] {
            assert_close(mgm(&patch(|_, _| level)), 0.0, 0.0);
            assert_close(mlr(&patch(|_, _| level)), 1.0, 1e-6);
        }
    }

    /// Inside, a slope of `s` per pixel gives `8 s`. In the two border columns one neighbour is a replica, so they give
    /// half of that.
    #[test]
    fn a_ramp_responds_with_eight_times_its_slope() {
        let expected = 8.0 * 3.0 * (30.0 + 2.0 * 0.5) / 32.0;
        assert_close(mgm(&patch(|x, _| 3.0 * x)), expected, 1e-4);
        assert_close(mgm(&patch(|_, y| 240.0 - 3.0 * y)), expected, 1e-4);
    }

    /// On `3x + 4y` the slopes along the axes give 24 and 32 (40 together) inside, and half of that where the
    /// difference meets a border.
    #[test]
    fn a_slanted_ramp_adds_the_axes_as_a_hypotenuse() {
        let inside = 40.0;
        let sides = 12.0_f64.hypot(32.0);
        let ends = 24.0_f64.hypot(16.0);
        let corners = 12.0_f64.hypot(16.0);
        let expected = (900.0 * inside + 60.0 * sides + 60.0 * ends + 4.0 * corners) / 1024.0;
        assert_close(mgm(&patch(|x, y| 3.0 * x + 4.0 * y)), expected, 1e-4);
    }

    /// A step of 100 between columns 15 and 16 gives 4 * 100 in those two columns and 0 elsewhere.
    #[test]
    fn a_step_edge_responds_on_both_of_its_sides() {
        let edge = patch(|x, _| if x < 16.0 { 50.0 } else { 150.0 });
        assert_close(mgm(&edge), 2.0 * 400.0 / 32.0, 1e-5);
    }

    /// A single bright pixel of 80 gives, around it, 2 * 80 at the four sides and sqrt(2) * 80 at the four corners.
    #[test]
    fn a_point_responds_around_itself() {
        let point = patch(|x, y| if (x, y) == (10.0, 20.0) { 80.0 } else { 0.0 });
        let expected = 80.0 * 4.0 * (2.0 + 2.0_f64.sqrt()) / 1024.0;
        assert_close(mgm(&point), expected, 1e-5);
    }

    /// Truncated at 4 sigma and normalised, the middle weight is the density `1 / (4 sqrt(2 pi))` to four digits, and
    /// the others fall off by the Gaussian's ratio: `exp(-1/2)` at one sigma, `exp(-2)` at two, `exp(-8)` at four.
    #[test]
    fn the_kernel_is_the_gaussian() {
        let kernel = gaussian();
        assert_close(kernel[16], 0.099_735_570, 1e-5);
        assert_close(kernel[20] / kernel[16], 0.606_530_660, 1e-9);
        assert_close(kernel[8] / kernel[16], 0.135_335_283, 1e-9);
        assert_close(kernel[32] / kernel[16], 0.000_335_463, 1e-9);
        assert_close(kernel.iter().sum(), 1.0, 1e-12);
    }

    /// Step 0 to 255 between columns 15 and 16. The blurred step is 255 times the Gaussian's cumulative distribution,
    /// which the discrete sum meets at half pixels: `Phi(d / 4)`, d = 0.5, 1.5, … with `Phi(0.125) = 0.549738`,
    /// `Phi(3.875) = 0.999947`. The ratio on the dark side is `255 Phi(-d / 4) + 1`, on the bright side its mirror's
    /// `256 / (255 Phi(d / 4) + 1)`.
    #[test]
    fn a_step_edge_has_the_ratio_of_the_error_function() {
        let expected = (0..16)
            .map(|i| {
                let below = upper_tail((f64::from(i) + 0.5) / 4.0);
                (255.0 * below + 1.0) + 256.0 / (255.0 * (1.0 - below) + 1.0)
            })
            .sum::<f64>()
            / 32.0;

        let edge = patch(|x, _| if x < 16.0 { 0.0 } else { 255.0 });
        assert_close(mlr(&edge) / expected, 1.0, 4e-3);
    }

    /// `1 - Phi(z)` by integrating the density: independent of the kernel under test.
    fn upper_tail(z: f64) -> f64 {
        let steps = 10_000_u32;
        let width = (10.0 - z) / f64::from(steps);
        let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
        (0..steps).map(|i| density(z + width * (f64::from(i) + 0.5)) * width).sum()
    }

    // Against another implementation: SciPy 1.17.1, with `n` for `scipy.ndimage`,
    //   i = np.arange(1024); I = (((i * i * 37 + i * 11) % 256) * 0.5 + 60 * np.sin(i / 90) + 80).reshape(32, 32)
    //   np.hypot(n.sobel(I, 0, mode="nearest"), n.sobel(I, 1, mode="nearest")).mean()
    //   G = n.gaussian_filter(I, 4, mode="nearest", truncate=4)
    //   np.maximum((G + 1) / (I + 1), (I + 1) / (G + 1)).mean()
    #[test]
    fn both_agree_with_scipy() {
        let textured = Patch(std::array::from_fn(|i| {
            let noise = ((i * i * 37 + i * 11) % 256) as f64 * 0.5;
            (noise + 60.0 * (i as f64 / 90.0).sin() + 80.0) as f32
        }));

        assert_close(mgm(&textured), 210.861_969, 1e-3);
        assert_close(mlr(&textured), 1.391_609_47, 1e-5);
    }
}
