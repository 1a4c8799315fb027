//! Compares the blur of two patches of one scene. The patches are registered: where they overlap they show the same
//! texture, and only the blur differs.
//!
//! The scene moves under the patch from frame to frame. The energy of different textures varies more than a slight blur
//! changes it. So energies are compared over the same texture only.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::LazyLock;

use multiversion::multiversion;

use super::spectrum::PatchTransform;
use parfocal_imaging::{PATCH_SIDE, Patch};

/// Length of the result of [`changes`]: log ratios of energy at [`LAGS`], the correlation, and the overlap.
pub const CHANGES: usize = LAGS.len() + 2;

/// Lags of the second differences, in pixels. Each passes frequencies around 1 / (2 lag) cycles per pixel.
pub(super) const LAGS: [usize; 5] = [1, 2, 3, 4, 6];
/// Largest displacement considered along each axis, in pixels. Beyond it the overlap is too small.
const FARTHEST: isize = 15;
/// Highest frequency used to find the displacement, in cycles per patch. Higher ones do not survive blur.
const FINEST: usize = 10;
/// Cross-power below which the phase of a frequency is mostly due to noise and rounding.
const FAINT: f32 = 300.0;
/// Energy per pixel that rounding to whole gray levels adds to a second difference, (1 + 4 + 1) / 12, plus as much
/// again for noise.
pub(super) const FLOOR: f32 = 1.0;

type Square = [[f32; PATCH_SIDE]; PATCH_SIDE];

/// How the blur changed from `before` to `now`: log ratios of energy, fine to coarse, positive if sharper now; then the
/// correlation of the patches in their overlap, and the overlap's share of a patch. Each is of the order of 1.
pub fn changes(before: (&Patch, &PatchTransform), now: (&Patch, &PatchTransform)) -> [f32; CHANGES] {
    let (dx, dy) = displacement(before.1, now.1);
    let moved = shifted(before.0, dx, dy);
    let still: Square = std::array::from_fn(|y| std::array::from_fn(|x| now.0.0[y * PATCH_SIDE + x]));
    let rows = overlap(dy);
    let columns = overlap(dx);

    let mut energies = [[0.0; 2]; LAGS.len()];
    for (square, which) in [(&moved, 0), (&still, 1)] {
        let down = second_differences(square, rows.clone(), columns.clone());
        let along = second_differences(&transposed(square), columns.clone(), rows.clone());
        for lag in 0..LAGS.len() {
            energies[lag][which] += down[lag] + along[lag];
        }
    }

    let mut out = [0.0; CHANGES];
    for (ratio, [before, now]) in out.iter_mut().zip(energies) {
        *ratio = log_ratio(now, before);
    }

    out[LAGS.len() + 1] = (rows.len() * columns.len()) as f32 / (PATCH_SIDE * PATCH_SIDE) as f32;
    out[LAGS.len()] = correlation(&moved, &still, rows, columns);
    out
}

/// The log ratio of the energies of second differences, positive if it is sharper `now`; of the order of 1.
pub(super) fn log_ratio(now: f32, before: f32) -> f32 {
    (3.0 * ((now + FLOOR) / (before + FLOOR)).ln()).clamp(-4.0, 4.0)
}

/// The displacement `(x, y)` in whole pixels: `now` at a place shows what `before` shows at that place plus the
/// displacement. It is the peak of their phase correlation (Kuglin and Hines 1975). Blur hardly moves the peak, since
/// it reduces the amplitude of each frequency and leaves its phase.
pub(super) fn displacement(before: &PatchTransform, now: &PatchTransform) -> (isize, isize) {
    let map = correlate(before, now, &WAVES);
    let mut best = f32::NEG_INFINITY;
    let mut place = (0, 0);

    for dy in -FARTHEST..=FARTHEST {
        for dx in -FARTHEST..=FARTHEST {
            let value = map[dy.rem_euclid(PATCH_SIDE as isize) as usize][dx.rem_euclid(PATCH_SIDE as isize) as usize];
            if value > best {
                (best, place) = (value, (dx, dy));
            }
        }
    }
    place
}

/// cos and sin of 2 pi frequency place / 32.
struct Waves {
    cos: Square,
    sin: Square,
}

static WAVES: LazyLock<Waves> = LazyLock::new(|| {
    let table = |f: fn(f64) -> f64| -> Square {
        std::array::from_fn(|k| {
            std::array::from_fn(|place| f(TAU * (k * place % PATCH_SIDE) as f64 / PATCH_SIDE as f64) as f32)
        })
    };
    Waves { cos: table(f64::cos), sin: table(f64::sin) }
});

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn correlate(before: &PatchTransform, now: &PatchTransform, waves: &Waves) -> Square {
    let mut map = [[0.0f32; PATCH_SIDE]; PATCH_SIDE];
    for ky in (0..=FINEST).chain(PATCH_SIDE - FINEST..PATCH_SIDE) {
        let mut real = [0.0f32; PATCH_SIDE];
        let mut imaginary = [0.0f32; PATCH_SIDE];
        for kx in 0..=FINEST {
            let a = before.real[ky][kx];
            let b = before.imaginary[ky][kx];
            let c = now.real[ky][kx];
            let d = now.imaginary[ky][kx];

            // The transform has e^(+i...), so a displaced patch's phase lags: before * conj(now).
            let re = a * c + b * d;
            let im = b * c - a * d;
            let weight = 1.0 / (re * re + im * im + FAINT * FAINT).sqrt();
            // Each positive frequency along a row also stands for its negative one.
            let weight = if kx == 0 { weight } else { 2.0 * weight };
            let re = weight * re;
            let im = weight * im;

            for x in 0..PATCH_SIDE {
                real[x] += re * waves.cos[kx][x] + im * waves.sin[kx][x];
                imaginary[x] += im * waves.cos[kx][x] - re * waves.sin[kx][x];
            }
        }

        for (y, line) in map.iter_mut().enumerate() {
            let cos = waves.cos[ky][y];
            let sin = waves.sin[ky][y];
            for x in 0..PATCH_SIDE {
                line[x] += real[x] * cos + imaginary[x] * sin;
            }
        }
    }

    map
}

/// Range along an axis in which a patch and one displaced by `by` overlap.
fn overlap(by: isize) -> Range<usize> {
    let side = PATCH_SIDE as isize;
    (-by).max(0) as usize..(side - by.max(0)) as usize
}

/// `patch` shifted so that its place `(dx, dy)` becomes the origin; 0 outside.
fn shifted(patch: &Patch, dx: isize, dy: isize) -> Square {
    let mut out = [[0.0; PATCH_SIDE]; PATCH_SIDE];
    let columns = overlap(dx);
    for y in overlap(dy) {
        let from = (y as isize + dy) as usize * PATCH_SIDE + (columns.start as isize + dx) as usize;
        out[y][columns.clone()].copy_from_slice(&patch.0[from..from + columns.len()]);
    }
    out
}

fn transposed(square: &Square) -> Square {
    std::array::from_fn(|y| std::array::from_fn(|x| square[x][y]))
}

/// Mean square of the second differences down the rows `rows` in the columns `columns`, at each of [`LAGS`].
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn second_differences(square: &Square, rows: Range<usize>, columns: Range<usize>) -> [f32; LAGS.len()] {
    let mut out = [0.0; LAGS.len()];
    for (mean, lag) in out.iter_mut().zip(LAGS) {
        let mut sums = [0.0f32; PATCH_SIDE];
        for y in rows.start + lag..rows.end.saturating_sub(lag) {
            let above = &square[y - lag];
            let here = &square[y];
            let below = &square[y + lag];
            for x in 0..PATCH_SIDE {
                let difference = above[x] - 2.0 * here[x] + below[x];
                sums[x] += difference * difference;
            }
        }

        let count = rows.len().saturating_sub(2 * lag) * columns.len();
        *mean = sums[columns.clone()].iter().sum::<f32>() / count.max(1) as f32;
    }
    out
}

/// Pearson's correlation of two patches in their overlap; 0 if one is flat.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn correlation(a: &Square, b: &Square, rows: Range<usize>, columns: Range<usize>) -> f32 {
    let mut sums = [[0.0f32; PATCH_SIDE]; 5];
    let count = (rows.len() * columns.len()).max(1) as f32;
    for y in rows {
        for x in 0..PATCH_SIDE {
            // Relative to middle gray: with large values, the small variance would be lost to rounding.
            let a = a[y][x] - 128.0;
            let b = b[y][x] - 128.0;
            for (sum, term) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                sum[x] += term;
            }
        }
    }

    let [a, b, aa, bb, ab] = sums.map(|sum| sum[columns.clone()].iter().sum::<f32>() / count);
    let aa = aa - a * a;
    let bb = bb - b * b;
    let ab = ab - a * b;
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::spectrum;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_imaging::GrayImage;

    const SIDE: usize = 96;

    /// A picture of spots of many sizes: white noise blurred to three widths, each scaled to a deviation of 20 gray
    /// levels.
    fn scene(seed: u32) -> GrayImage {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };

        let mut sum = vec![128.0f32; SIDE * SIDE];
        for sigma in [0.7, 1.5, 3.0] {
            let white = GrayImage::new(SIDE, SIDE, (0..SIDE * SIDE).map(|_| noise()).collect()).unwrap();
            // After a Gaussian blur, white noise of variance 1/12 keeps 1 / (4 pi sigma^2) of it.
            let scale = 20.0 * (12.0 * 2.0 * TAU * sigma * sigma).sqrt() as f32;
            for (total, value) in sum.iter_mut().zip(gaussian_blur(&white, sigma).data) {
                *total += scale * value;
            }
        }

        GrayImage::new(SIDE, SIDE, sum).unwrap()
    }

    fn cut(picture: &GrayImage, x: usize, y: usize) -> Patch {
        Patch(std::array::from_fn(|i| picture.data[(y + i / PATCH_SIDE) * SIDE + x + i % PATCH_SIDE].round()))
    }

    fn compare(before: &Patch, now: &Patch) -> [f32; CHANGES] {
        changes((before, &spectrum(before)), (now, &spectrum(now)))
    }

    #[test]
    fn displacements_are_found_through_a_change_of_blur() {
        let mut missed = 0;
        for seed in 0..20 {
            let sharp = scene(seed);
            let blurred = gaussian_blur(&sharp, 1.5);
            for (dx, dy) in [(0, 0), (3, -2), (-6, 5), (7, 7)] {
                let before = spectrum(&cut(&sharp, 30, 30));
                let now = spectrum(&cut(&blurred, (30 + dx) as usize, (30 + dy) as usize));
                missed += usize::from(displacement(&before, &now) != (dx, dy));
            }
        }

        assert!(missed <= 4, "{missed} of 80 missed");
    }

    #[test]
    fn what_moves_unblurred_has_not_changed() {
        let sharp = scene(7);
        let found = compare(&cut(&sharp, 30, 30), &cut(&sharp, 35, 27));
        assert!(found[..LAGS.len()].iter().all(|ratio| ratio.abs() < 1e-3), "{found:?}");
        assert!(found[LAGS.len()] > 0.999);
        assert!((found[LAGS.len() + 1] - 27.0 * 29.0 / 1024.0).abs() < 1e-6);
    }

    #[test]
    fn blur_shows_first_in_what_is_fine() {
        let sharp = scene(8);
        let found = compare(&cut(&sharp, 30, 30), &cut(&gaussian_blur(&sharp, 0.8), 34, 30));
        assert!(found[..LAGS.len()].is_sorted(), "{found:?}");
        assert!(found[0] < -1.0 && found[LAGS.len() - 1] < 0.0, "{found:?}");
    }

    #[test]
    fn flat_patches_have_no_ratio() {
        let flat = Patch([90.0; PATCH_SIDE * PATCH_SIDE]);
        let found = compare(&flat, &flat);
        assert!(found[..=LAGS.len()].iter().all(|&value| value == 0.0), "{found:?}");
    }
}
