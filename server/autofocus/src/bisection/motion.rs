//! How far the scene moved between two frames, found by registering their whole surroundings. Sixteen times as many
//! pixels as the patch has find the motion where the patch alone is too poor in detail.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use multiversion::multiversion;

use parfocal_imaging::Surroundings;

const SIDE: usize = Surroundings::SIDE;
/// Largest motion along each axis that is looked for, in pixels a frame.
const FARTHEST: isize = 24;
/// A square of complex numbers, row after row: real and imaginary parts.
#[derive(Debug, Clone)]
struct Complex {
    re: Vec<[f32; SIDE]>,
    im: Vec<[f32; SIDE]>,
}

/// The Fourier transform of a frame's surroundings, less their mean, under a Hann window.
#[derive(Debug, Clone)]
pub struct Spectrum(Complex);

impl Spectrum {
    /// The transform of `levels` ([`Surroundings::levels`]).
    #[must_use]
    pub fn of(levels: &[f32]) -> Self {
        let rows = levels.as_chunks::<SIDE>().0;
        let sum: f32 = rows.iter().map(|row| row.iter().sum::<f32>()).sum();
        let mean = sum / (SIDE * SIDE) as f32;

        let windowed = |(row, down): (&[f32; SIDE], &f32)| -> [f32; SIDE] {
            std::array::from_fn(|x| (row[x] - mean) * down * TABLES.window[x])
        };
        let re = rows.iter().zip(&TABLES.window).map(windowed).collect();
        let im = vec![[0.0; SIDE]; SIDE];

        Self(transformed(Complex { re, im }))
    }

    /// By how many pixels (right, down) what was seen in `self` has moved in the later frame `now`.
    ///
    /// It is the peak of the phase correlation (Kuglin and Hines 1975). Blur hardly moves the peak: it lowers the
    /// amplitude of each frequency and leaves its phase.
    #[must_use]
    pub fn motion_to(&self, now: &Self) -> (isize, isize) {
        // The inverse transform is the conjugate of the transform of the conjugate, up to a factor. Only its real part
        // is wanted, so conjugating once is enough.
        let map = transformed(conjugate_cross_power(&self.0, &now.0)).re;

        let mut best = map[0][0];
        let mut motion = (0, 0);
        for down in -FARTHEST..=FARTHEST {
            let row = &map[down.rem_euclid(SIDE as isize) as usize];
            for right in -FARTHEST..=FARTHEST {
                let value = row[right.rem_euclid(SIDE as isize) as usize];
                if value > best {
                    best = value;
                    motion = (right, down);
                }
            }
        }

        motion
    }
}

/// The conjugate of `conj(before) * now`, each divided by its size to the power 3/4. With the power 1 every frequency
/// would count alike, noise included; with 0 the strongest few would decide.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn conjugate_cross_power(before: &Complex, now: &Complex) -> Complex {
    const LEAST: f32 = 1e-9;

    let mut out = Complex { re: vec![[0.0; SIDE]; SIDE], im: vec![[0.0; SIDE]; SIDE] };
    for y in 0..SIDE {
        let (a, b) = (&before.re[y], &before.im[y]);
        let (c, d) = (&now.re[y], &now.im[y]);
        let (re, im) = (&mut out.re[y], &mut out.im[y]);
        for x in 0..SIDE {
            let real = a[x] * c[x] + b[x] * d[x];
            let imaginary = a[x] * d[x] - b[x] * c[x];
            let root = (real * real + imaginary * imaginary).sqrt().sqrt();
            let weight = 1.0 / (root * root.sqrt() + LEAST);
            re[x] = weight * real;
            im[x] = -weight * imaginary;
        }
    }
    out
}

/// The two-dimensional discrete Fourier transform, with e^(-i...).
fn transformed(square: Complex) -> Complex {
    transposed(&down_columns(transposed(&down_columns(square, &TABLES)), &TABLES))
}

struct Tables {
    /// The Hann window along an axis, without its zeros at both ends.
    window: [f32; SIDE],
    /// cos and -sin of 2 pi k / [`SIDE`].
    cos: [f32; SIDE / 2],
    sin: [f32; SIDE / 2],
    /// Each index with its bits in reverse.
    reversed: [usize; SIDE],
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let turn = |k: usize| TAU * k as f64 / SIDE as f64;
    let bits = SIDE.trailing_zeros();
    Tables {
        window: std::array::from_fn(|i| (0.5 - 0.5 * (TAU * (i + 1) as f64 / (SIDE + 1) as f64).cos()) as f32),
        cos: std::array::from_fn(|k| turn(k).cos() as f32),
        sin: std::array::from_fn(|k| -turn(k).sin() as f32),
        reversed: std::array::from_fn(|index| index.reverse_bits() >> (usize::BITS - bits)),
    }
});

/// The transform of each column (Cooley and Tukey 1965). It works on whole rows at once, which become vector
/// instructions.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn down_columns(square: Complex, tables: &Tables) -> Complex {
    let mut re: Vec<[f32; SIDE]> = tables.reversed.iter().map(|&row| square.re[row]).collect();
    let mut im: Vec<[f32; SIDE]> = tables.reversed.iter().map(|&row| square.im[row]).collect();

    let mut half = 1;
    while half < SIDE {
        for start in (0..SIDE).step_by(2 * half) {
            for k in 0..half {
                let cos = tables.cos[k * (SIDE / 2 / half)];
                let sin = tables.sin[k * (SIDE / 2 / half)];
                let (upper_re, lower_re) = pair(&mut re, start + k, start + k + half);
                let (upper_im, lower_im) = pair(&mut im, start + k, start + k + half);
                for x in 0..SIDE {
                    let turned_re = lower_re[x] * cos - lower_im[x] * sin;
                    let turned_im = lower_re[x] * sin + lower_im[x] * cos;
                    lower_re[x] = upper_re[x] - turned_re;
                    lower_im[x] = upper_im[x] - turned_im;
                    upper_re[x] += turned_re;
                    upper_im[x] += turned_im;
                }
            }
        }
        half *= 2;
    }

    Complex { re, im }
}

/// Rows `first` and `second`, which is greater.
#[inline(always)]
fn pair(rows: &mut [[f32; SIDE]], first: usize, second: usize) -> (&mut [f32; SIDE], &mut [f32; SIDE]) {
    let (upper, lower) = rows.split_at_mut(second);
    (&mut upper[first], &mut lower[0])
}

fn transposed(square: &Complex) -> Complex {
    // Block by block, so that reads and writes stay in the cache.
    const BLOCK: usize = 16;
    let turned = |rows: &[[f32; SIDE]]| {
        let mut out = vec![[0.0; SIDE]; SIDE];
        for top in (0..SIDE).step_by(BLOCK) {
            for left in (0..SIDE).step_by(BLOCK) {
                for y in top..top + BLOCK {
                    for x in left..left + BLOCK {
                        out[x][y] = rows[y][x];
                    }
                }
            }
        }
        out
    };
    Complex { re: turned(&square.re), im: turned(&square.im) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::GrayImage;

    #[test]
    fn the_transform_of_a_wave_is_two_peaks() {
        // cos(2 pi (3 x + 5 y) / 128) has half of all pixels at the frequency (3, 5), and half at (-3, -5).
        let wave = |y: usize, x: usize| (TAU * (3 * x + 5 * y) as f64 / SIDE as f64).cos() as f32;
        let re = (0..SIDE).map(|y| std::array::from_fn(|x| wave(y, x))).collect();
        let found = transformed(Complex { re, im: vec![[0.0; SIDE]; SIDE] });
        for y in 0..SIDE {
            for x in 0..SIDE {
                let expected = if (y, x) == (5, 3) || (y, x) == (123, 125) { 8192.0 } else { 0.0 };
                assert!((found.re[y][x] - expected).abs() < 0.1 && found.im[y][x].abs() < 0.1, "{y} {x}");
            }
        }
        // The sine has its peaks in the imaginary part, with the sign of e^(-i...).
        let sine = |x: usize| (TAU * 3.0 * x as f64 / SIDE as f64).sin() as f32;
        let re = (0..SIDE).map(|_| std::array::from_fn(sine)).collect();
        let found = transformed(Complex { re, im: vec![[0.0; SIDE]; SIDE] });
        assert!((found.im[0][3] + 8192.0).abs() < 0.1 && (found.im[0][125] - 8192.0).abs() < 0.1);
    }

    /// The square of `picture` with its corner at `(x, y)`.
    fn square(picture: &GrayImage, x: usize, y: usize) -> Vec<f32> {
        (0..SIDE * SIDE).map(|i| picture.data[(y + i / SIDE) * picture.width + x + i % SIDE].round()).collect()
    }

    #[test]
    fn motion_is_found_through_a_change_of_blur() {
        for seed in 0..5 {
            let sharp = texture(seed, 192);
            let blurred = gaussian_blur(&sharp, 2.0);
            let before = Spectrum::of(&square(&sharp, 32, 32));
            for (dx, dy) in [(0, 0), (3, -2), (-6, 5), (17, 9), (-24, 24)] {
                // What was at (x, y) is at (x + dx, y + dy) in a square whose corner moved the other way.
                let now = square(&blurred, (32 - dx) as usize, (32 - dy) as usize);
                assert_eq!(before.motion_to(&Spectrum::of(&now)), (dx, dy), "seed {seed}");
            }
        }
    }

    #[test]
    fn a_flat_view_has_not_moved() {
        let flat = Spectrum::of(&vec![90.0; SIDE * SIDE]);
        assert_eq!(flat.motion_to(&flat), (0, 0));
    }
}
