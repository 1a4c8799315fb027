//! How far the scene moved between two frames, found by registering their whole surroundings. Sixteen times as many
//! pixels as the patch has find the motion where the patch alone is too poor in detail.
//!
//! The Fourier transforms here take two things into account that halve the work each. Pictures are real, so half of the
//! frequencies are the conjugates of the others, and two columns of pixels can be transformed as one of complex
//! numbers. And only small motions are looked for, so most of the inverse transform is never computed.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use multiversion::multiversion;

use parfocal_imaging::Surroundings;

const SIDE: usize = Surroundings::SIDE;
/// Largest motion along each axis that is looked for, in pixels a frame.
const FARTHEST: isize = 24;
/// Pixels around a peak that belong to it.
const PEAK_HALF: isize = 5;
/// Columns of pixels that are transformed at once, two in each complex number.
const PAIRS: usize = SIDE / 2;
/// Frequencies down the picture that are kept, from 0 to the highest, and some zeros, so that a row of them fills whole
/// vector registers.
const KEPT: usize = SIDE / 2 + 8;
/// Motions to the right and to the left that are computed, each as many; at least [`FARTHEST`].
const REACH: usize = 32;

/// [`SIDE`] rows of complex numbers, real and imaginary parts.
#[derive(Debug, Clone)]
struct Rows<const WIDTH: usize> {
    re: Vec<[f32; WIDTH]>,
    im: Vec<[f32; WIDTH]>,
}

impl<const WIDTH: usize> Rows<WIDTH> {
    fn zeros() -> Self {
        Self { re: vec![[0.0; WIDTH]; SIDE], im: vec![[0.0; WIDTH]; SIDE] }
    }
}

/// The Fourier transform of a frame's surroundings, less their mean, under a Hann window: a row for each frequency
/// across, in it those down from 0 to the highest.
#[derive(Debug, Clone)]
pub struct ViewTransform(Rows<KEPT>);

impl ViewTransform {
    /// The transform of `levels` ([`Surroundings::levels`]).
    pub fn of(levels: &[f32]) -> Self {
        let rows = levels.as_chunks::<SIDE>().0;
        let sum: f32 = rows.iter().map(|row| row.iter().sum::<f32>()).sum();
        let mean = sum / (SIDE * SIDE) as f32;
        Self(transformed(rows, mean, &TABLES))
    }

    /// By how many pixels (right, down) what was seen in `self` has moved in the later frame `now`.
    ///
    /// It is the peak of the phase correlation (Kuglin and Hines 1975). Blur hardly moves the peak: it lowers the
    /// amplitude of each frequency and leaves its phase.
    pub fn motion_to(&self, now: &Self) -> (isize, isize) {
        peak(&correlation(&self.0, &now.0, &TABLES))
    }

    /// The same motion, and how far its peak stands out: its height above the mean of the other motions, in their
    /// standard deviations (the peak-to-sidelobe ratio, Bolme et al. 2010). 0 if nothing is seen.
    pub fn registered_to(&self, now: &Self) -> ((isize, isize), f32) {
        let map = correlation(&self.0, &now.0, &TABLES);
        let motion = peak(&map);

        let mut sums = [0.0f64; 3];
        for (right, down) in motions()
            .filter(|(right, down)| (right - motion.0).abs() > PEAK_HALF || (down - motion.1).abs() > PEAK_HALF)
        {
            let value = f64::from(at(&map, right, down));
            sums[0] += 1.0;
            sums[1] += value;
            sums[2] += value * value;
        }

        let mean = sums[1] / sums[0];
        let deviation = (sums[2] / sums[0] - mean * mean).max(0.0).sqrt();
        let height = f64::from(at(&map, motion.0, motion.1)) - mean;
        (motion, if deviation > 0.0 { (height / deviation) as f32 } else { 0.0 })
    }
}

/// All motions that are looked for (right, down), row by row.
fn motions() -> impl Iterator<Item = (isize, isize)> {
    (-FARTHEST..=FARTHEST).flat_map(|down| (-FARTHEST..=FARTHEST).map(move |right| (right, down)))
}

/// The value of a correlation for a motion.
fn at(map: &Rows<REACH>, right: isize, down: isize) -> f32 {
    let row = down.rem_euclid(SIDE as isize) as usize;
    if right < 0 { map.re[row][(right + REACH as isize) as usize] } else { map.im[row][right as usize] }
}

/// The motion with the highest value; none where all are equal.
fn peak(map: &Rows<REACH>) -> (isize, isize) {
    let mut best = at(map, 0, 0);
    let mut motion = (0, 0);
    for (right, down) in motions() {
        let value = at(map, right, down);
        if value > best {
            best = value;
            motion = (right, down);
        }
    }
    motion
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

/// The two-dimensional discrete Fourier transform, with e^(-i...), of `levels` less `mean` under the window.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn transformed(levels: &[[f32; SIDE]], mean: f32, tables: &Tables) -> Rows<KEPT> {
    // The left half is the real part, the right half the imaginary one.
    let mut halves = Rows::<PAIRS>::zeros();
    for (y, line) in levels.iter().enumerate() {
        let row = tables.reversed[y];
        let down = tables.window[y];
        for x in 0..PAIRS {
            halves.re[row][x] = (line[x] - mean) * down * tables.window[x];
            halves.im[row][x] = (line[PAIRS + x] - mean) * down * tables.window[PAIRS + x];
        }
    }
    down_columns(&mut halves, tables);

    // A real column's transform at the frequencies k and -k are conjugates, which tells the two halves apart.
    let mut across = Rows::<KEPT>::zeros();
    for k in 0..=SIDE / 2 {
        let negative = (SIDE - k) % SIDE;
        let (re, im) = (&halves.re[k], &halves.im[k]);
        let (other_re, other_im) = (&halves.re[negative], &halves.im[negative]);
        for x in 0..PAIRS {
            let left = tables.reversed[x];
            across.re[left][k] = 0.5 * (re[x] + other_re[x]);
            across.im[left][k] = 0.5 * (im[x] - other_im[x]);
            let right = tables.reversed[PAIRS + x];
            across.re[right][k] = 0.5 * (im[x] + other_im[x]);
            across.im[right][k] = 0.5 * (other_re[x] - re[x]);
        }
    }
    down_columns(&mut across, tables);
    across
}

/// The phase correlation, a row for each motion down: motions to the left by [`REACH`] to 1 in the real part, none and
/// those to the right in the imaginary one.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn correlation(before: &Rows<KEPT>, now: &Rows<KEPT>, tables: &Tables) -> Rows<REACH> {
    let mut power = conjugate_cross_power(before, now, tables);
    down_columns(&mut power, tables);

    // Both maps, to the left and to the right, are real, so they are transformed as one of complex numbers.
    let mut maps = Rows::<REACH>::zeros();
    for k in 0..SIDE {
        // The frequencies that are not kept are the conjugates of those that are.
        let (kept, sign) = if k <= SIDE / 2 { (k, 1.0) } else { (SIDE - k, -1.0) };
        let row = tables.reversed[k];
        for x in 0..REACH {
            let left = SIDE - REACH + x;
            maps.re[row][x] = power.re[left][kept] - sign * power.im[x][kept];
            maps.im[row][x] = sign * power.im[left][kept] + power.re[x][kept];
        }
    }
    down_columns(&mut maps, tables);
    maps
}

/// The conjugate of `conj(before) * now`, each divided by its size to the power 3/4. With the power 1 every frequency
/// would count alike, noise included; with 0 the strongest few would decide. Rows are in the order that
/// [`down_columns`] takes.
///
/// The inverse transform is the conjugate of the transform of the conjugate, up to a factor. Only its real part is
/// wanted, so conjugating once is enough.
#[inline(always)]
fn conjugate_cross_power(before: &Rows<KEPT>, now: &Rows<KEPT>, tables: &Tables) -> Rows<KEPT> {
    const LEAST: f32 = 1e-9;

    let mut out = Rows::zeros();
    for y in 0..SIDE {
        let (a, b) = (&before.re[y], &before.im[y]);
        let (c, d) = (&now.re[y], &now.im[y]);
        let row = tables.reversed[y];
        let (re, im) = (&mut out.re[row], &mut out.im[row]);
        for x in 0..KEPT {
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

/// The transform of each column, in place (Cooley and Tukey 1965). Row `k` is expected at `reversed[k]`. It works on
/// whole rows at once, which become vector instructions.
#[inline(always)]
fn down_columns<const WIDTH: usize>(rows: &mut Rows<WIDTH>, tables: &Tables) {
    let mut half = 1;
    while half < SIDE {
        for start in (0..SIDE).step_by(2 * half) {
            for k in 0..half {
                let cos = tables.cos[k * (SIDE / 2 / half)];
                let sin = tables.sin[k * (SIDE / 2 / half)];
                let (upper_re, lower_re) = pair(&mut rows.re, start + k, start + k + half);
                let (upper_im, lower_im) = pair(&mut rows.im, start + k, start + k + half);
                for x in 0..WIDTH {
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
}

/// Rows `first` and `second`, which is greater.
#[inline(always)]
fn pair<const WIDTH: usize>(
    rows: &mut [[f32; WIDTH]],
    first: usize,
    second: usize,
) -> (&mut [f32; WIDTH], &mut [f32; WIDTH]) {
    let (upper, lower) = rows.split_at_mut(second);
    (&mut upper[first], &mut lower[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::GrayImage;

    /// The transform at one frequency by its definition, term by term.
    fn by_definition(levels: &[f32], across: usize, down: usize) -> (f64, f64) {
        let mean = f64::from(levels.iter().sum::<f32>()) / (SIDE * SIDE) as f64;
        let window = |i: usize| 0.5 - 0.5 * (TAU * (i + 1) as f64 / (SIDE + 1) as f64).cos();
        levels.iter().enumerate().fold((0.0, 0.0), |(re, im), (i, level)| {
            let (x, y) = (i % SIDE, i / SIDE);
            let turn = -TAU * ((across * x + down * y) % SIDE) as f64 / SIDE as f64;
            let level = (f64::from(*level) - mean) * window(x) * window(y);
            (re + level * turn.cos(), im + level * turn.sin())
        })
    }

    #[test]
    fn the_transform_is_what_its_definition_says() {
        let picture = texture(2, SIDE);
        let ViewTransform(found) = ViewTransform::of(&picture.data);
        for (across, down) in [(0, 0), (3, 5), (4, 5), (125, 5), (64, 64), (70, 3), (127, 60), (1, 64)] {
            let (re, im) = by_definition(&picture.data, across, down);
            let found = (f64::from(found.re[across][down]), f64::from(found.im[across][down]));
            assert!((found.0 - re).hypot(found.1 - im) < 0.5, "{across} {down}: {found:?} {re} {im}");
        }
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
            let before = ViewTransform::of(&square(&sharp, 32, 32));
            for (dx, dy) in [(0, 0), (3, -2), (-6, 5), (17, 9), (-24, 24)] {
                // What was at (x, y) is at (x + dx, y + dy) in a square whose corner moved the other way.
                let now = square(&blurred, (32 - dx) as usize, (32 - dy) as usize);
                assert_eq!(before.motion_to(&ViewTransform::of(&now)), (dx, dy), "seed {seed}");
            }
        }
    }

    #[test]
    fn a_flat_view_has_not_moved() {
        let flat = ViewTransform::of(&vec![90.0; SIDE * SIDE]);
        assert_eq!(flat.motion_to(&flat), (0, 0));
    }
}
