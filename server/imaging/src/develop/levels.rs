//! White-balanced samples in whole numbers, small enough that the sum of four fits 16 bits.

use multiversion::multiversion;

use super::lanes::{LANES, Lanes, upper_half};
use super::ring::Ring;
use crate::calibration::{BANDS, Calibration};
use crate::frame::{CELL, GrayImage, MosaicFrame};
use crate::reconstruct::balance::{self, LOW_BITS, PixelBalance};

/// Level of a sample as dark as the dark reference; above 0, so that noise below dark is kept.
pub(super) const BLACK: u16 = 512;
/// Level of a sample as bright as the white reference.
pub(super) const WHITE: u16 = 8192;
/// Highest level that is developed, a little above white. Bands saturate at different levels above white. Cut at this
/// level, a highlight is white in all bands, and gets no false colour.
pub(super) const HIGHEST: u16 = WHITE + (WHITE - BLACK) / 16;
/// Highest level that counts for gray: twice white, so that the sum of four fits 16 bits.
const HIGHEST_OF_GRAY: u16 = 16_383;
/// Levels from black to white.
pub(super) const SPAN: f32 = (WHITE - BLACK) as f32;

/// From [`PixelBalance`]'s numbers to levels: factor and summand.
const FROM_BALANCED: (f32, f32) =
    (SPAN / (balance::WHITE - balance::DARK), BLACK as f32 - SPAN / (balance::WHITE - balance::DARK) * balance::DARK);

/// The gray value (0..=255) of a level.
pub(super) fn gray(level: i16) -> f32 {
    (255.0 / SPAN * (f32::from(level) - f32::from(BLACK))).clamp(0.0, 255.0)
}

/// Turns samples into levels, by references per band or per pixel, and sums them up cell by cell.
#[derive(Debug, Clone)]
pub(super) struct Levels {
    /// For each row of a cell: how its bands, which alternate along the row, become levels.
    of_bands: [BandBalance; CELL],
    /// Samples of a row of cells beyond its last whole vector.
    rest: [Lanes<u16>; CELL],
    /// Sums of the four levels in each column of a row of cells: as they count for gray, and (`sums`) as they are
    /// developed.
    of_gray: Ring<u16>,
    sums: Ring<u16>,
}

/// A vector's balance by references per band, in whole numbers: a level is
/// `(((min(sample, most) - least) * factor - 2^15) * gain >> 16) + summand`.
///
/// 2^15 is subtracted because compilers find the instruction for the upper half of a product of signed numbers, but not
/// that of unsigned ones. The summand makes up for it.
#[derive(Debug, Clone, Copy)]
struct BandBalance {
    most: Lanes<u16>,
    least: Lanes<u16>,
    /// A power of two that scales the samples to the full 16 bits.
    factor: Lanes<u16>,
    gain: Lanes<i16>,
    summand: Lanes<i16>,
}

impl BandBalance {
    /// The balance for a row of samples of four alternating bands, whose references are `dark` and `white`.
    fn new(dark: [f32; CELL], white: [f32; CELL]) -> Self {
        let mut balance =
            Self { most: [0; LANES], least: [0; LANES], factor: [1; LANES], gain: [0; LANES], summand: [0; LANES] };

        for lane in 0..LANES {
            let gain = SPAN / (white[lane % CELL] - dark[lane % CELL]);
            let offset = f32::from(BLACK) - dark[lane % CELL] * gain;

            // The smallest sample whose level is not negative, and the largest that stays in range however the numbers
            // below are rounded.
            let highest = f32::from(HIGHEST_OF_GRAY - 2);
            let least = (-offset / gain).clamp(0.0, 65_535.0).ceil() as u16;
            let most = ((highest - offset) / gain).clamp(f32::from(least), 65_535.0).floor() as u16;
            let span = (most - least).max(1);

            let factor = 1_u16 << span.leading_zeros();
            let whole_gain = (gain * 65_536.0 / f32::from(factor)).round().min(f32::from(i16::MAX));

            // The product is rounded down, on average by half a level.
            let summand = (f32::from(least) * gain + offset + 0.5).clamp(0.0, highest);
            let subtracted = whole_gain / 2.0;

            balance.least[lane] = least;
            balance.most[lane] = most;
            balance.factor[lane] = factor;
            balance.gain[lane] = whole_gain as i16;
            balance.summand[lane] = (summand + subtracted).round() as i16;
        }
        balance
    }
}

impl Levels {
    pub(super) fn new(calibration: &Calibration) -> Self {
        let dark = calibration.dark.band_means();
        let white = calibration.white.band_means();
        let row = |row: usize, of: [f32; BANDS]| std::array::from_fn(|column| of[CELL * row + column]);

        Self {
            of_bands: std::array::from_fn(|index| BandBalance::new(row(index, dark), row(index, white))),
            rest: [[0; LANES]; CELL],
            of_gray: Ring::default(),
            sums: Ring::default(),
        }
    }

    /// Prepares for mosaics of `width` samples per row.
    pub(super) fn resize(&mut self, width: usize) {
        self.of_gray.resize(width, 1);
        self.sums.resize(width, 1);
    }

    /// Makes the `levels` of the row of cells `y`, its cells' mean levels (`means`), and its row of `gray`.
    pub(super) fn make(
        &mut self,
        mosaic: &MosaicFrame,
        balance: Option<&PixelBalance>,
        y: usize,
        levels: &mut Ring<u16>,
        means: &mut [u16],
        gray: &mut GrayImage,
    ) {
        let width = mosaic.width();
        let rows = |row: usize| &mosaic.samples()[(CELL * y + row) * width..][..width];

        match balance {
            Some(balance) => {
                for row in 0..CELL {
                    let (gains, offsets) = balance.row(CELL * y + row);
                    balance_pixels(rows(row), gains, offsets, levels.row_mut(CELL * y + row));
                }
                cut_rows(levels.rows_mut(CELL * y), self.of_gray.lanes_mut(0), self.sums.lanes_mut(0));
            }
            None => self.balance_bands([0, 1, 2, 3].map(rows), levels.rows_mut(CELL * y)),
        }
        for row in 0..CELL {
            levels.fill_margins(CELL * y + row, CELL);
        }

        let width = mosaic.band_width();
        cell_means(self.of_gray.row(0), self.sums.row(0), means, &mut gray.data[y * width..][..width]);
    }

    /// Turns four rows of samples into levels by references per band, and sums them up.
    fn balance_bands(&mut self, samples: [&[u16]; CELL], levels: [&mut [Lanes<u16>]; CELL]) {
        let of_gray = self.of_gray.lanes_mut(0);
        let sums = self.sums.lanes_mut(0);
        let whole = samples.map(|row| row.as_chunks().0);
        let [first, second, third, fourth] = levels;
        balance_rows(&self.of_bands, whole, [first, second, third, fourth], (of_gray, sums));

        let count = whole[0].len();
        if count == sums.len() {
            return;
        }

        // The samples beyond the last whole vector, filled up to a vector.
        for (row, rest) in samples.iter().zip(&mut self.rest) {
            let left = row.as_chunks::<LANES>().1;
            rest[..left.len()].copy_from_slice(left);
        }
        let rest = self.rest.each_ref().map(std::slice::from_ref);
        let last = [&mut first[count..], &mut second[count..], &mut third[count..], &mut fourth[count..]];
        balance_rows(&self.of_bands, rest, last, (&mut of_gray[count..], &mut sums[count..]));
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn balance_pixels(samples: &[u16], gains: &[f32], offsets: &[f32], levels: &mut [u16]) {
    let (factor, summand) = FROM_BALANCED;
    let balances = gains.iter().zip(offsets);
    for ((level, &sample), (gain, offset)) in levels.iter_mut().zip(samples).zip(balances) {
        *level = rounded((f32::from(sample) * gain + offset) * factor + summand);
    }
}

/// Balances four rows of samples by references per band, and sums up their levels twice: for gray, and cut at
/// [`HIGHEST`], as they are developed.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn balance_rows(
    balances: &[BandBalance; CELL],
    samples: [&[Lanes<u16>]; CELL],
    levels: [&mut [Lanes<u16>]; CELL],
    (of_gray, sums): (&mut [Lanes<u16>], &mut [Lanes<u16>]),
) {
    let count = samples[0].len();
    let samples = samples.map(|row| &row[..count]);
    let [first, second, third, fourth] = levels.map(|row| &mut row[..count]);
    let of_gray = &mut of_gray[..count];
    let sums = &mut sums[..count];

    for x in 0..count {
        let of_gray = &mut of_gray[x];
        let sums = &mut sums[x];
        *of_gray = [0; LANES];
        *sums = [0; LANES];
        balance_vector(&balances[0], &samples[0][x], &mut first[x], (of_gray, sums));
        balance_vector(&balances[1], &samples[1][x], &mut second[x], (of_gray, sums));
        balance_vector(&balances[2], &samples[2][x], &mut third[x], (of_gray, sums));
        balance_vector(&balances[3], &samples[3][x], &mut fourth[x], (of_gray, sums));
    }
}

#[inline(always)]
fn balance_vector(
    balance: &BandBalance,
    samples: &Lanes<u16>,
    levels: &mut Lanes<u16>,
    (of_gray, sums): (&mut Lanes<u16>, &mut Lanes<u16>),
) {
    for lane in 0..LANES {
        let above = samples[lane].min(balance.most[lane]).saturating_sub(balance.least[lane]);
        let scaled = above.wrapping_mul(balance.factor[lane]).wrapping_sub(1 << 15) as i16;
        let level = (upper_half(scaled, balance.gain[lane]) + balance.summand[lane]) as u16;
        of_gray[lane] += level;
        levels[lane] = level.min(HIGHEST);
        sums[lane] += levels[lane];
    }
}

/// The nearest level.
#[inline(always)]
fn rounded(level: f32) -> u16 {
    (level.clamp(0.0, f32::from(HIGHEST_OF_GRAY)) + LOW_BITS).to_bits() as u16
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn cell_means(of_gray: &[u16], sums: &[u16], means: &mut [u16], gray: &mut [f32]) {
    let sums = of_gray.as_chunks::<CELL>().0.iter().zip(sums.as_chunks::<CELL>().0);
    for ((mean, gray), (of_gray, sums)) in means.iter_mut().zip(gray).zip(sums) {
        let mut whole = 0_u32;
        let mut sum = 0_u32;
        for (&value, &cut) in of_gray.iter().zip(sums) {
            whole += u32::from(value);
            sum += u32::from(cut);
        }

        *mean = ((sum + 8) / 16) as u16;
        let share = (whole as f32 / 16.0 - f32::from(BLACK)) / SPAN;
        *gray = (255.0 * share).clamp(0.0, 255.0);
    }
}

/// Sums four rows of levels for gray, cuts them at [`HIGHEST`], and sums what is left.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn cut_rows(levels: [&mut [Lanes<u16>]; CELL], of_gray: &mut [Lanes<u16>], sums: &mut [Lanes<u16>]) {
    let count = sums.len();
    let [first, second, third, fourth] = levels.map(|row| &mut row[..count]);

    for (index, (of_gray, sums)) in of_gray.iter_mut().zip(sums).enumerate() {
        let rows = [&mut first[index], &mut second[index], &mut third[index], &mut fourth[index]];
        *of_gray = [0; LANES];
        *sums = [0; LANES];
        for row in rows {
            for lane in 0..LANES {
                of_gray[lane] += row[lane];
                row[lane] = row[lane].min(HIGHEST);
                sums[lane] += row[lane];
            }
        }
    }
}

/// Makes the means of blocks of two by two levels of the row of cells `y`: two rows of them.
pub(super) fn make_blocks(levels: &Ring<u16>, y: usize, blocks: &mut Ring<u16>) {
    for row in 0..CELL / 2 {
        let top = levels.row(CELL * y + 2 * row);
        let bottom = levels.row(CELL * y + 2 * row + 1);
        block_row(top, bottom, blocks.row_mut(CELL / 2 * y + row));
        blocks.fill_margins(CELL / 2 * y + row, CELL / 2);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn block_row(top: &[u16], bottom: &[u16], blocks: &mut [u16]) {
    let pairs = top.as_chunks::<2>().0.iter().zip(bottom.as_chunks::<2>().0);
    for (block, (top, bottom)) in blocks.iter_mut().zip(pairs) {
        *block = (top[0] + top[1] + bottom[0] + bottom[1] + 2) / 4;
    }
}
