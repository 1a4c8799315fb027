//! White-balanced samples in whole numbers, small enough that four of them fit 16 bits.

use multiversion::multiversion;

use super::ring::Ring;
use crate::imaging::calibration::{BANDS, Calibration};
use crate::imaging::frame::{CELL, GrayImage, MosaicFrame};
use crate::imaging::reconstruct::balance::{self, PixelBalance};

/// Level of a sample as dark as the dark reference; above 0, so that noise below dark is kept.
pub(super) const BLACK: u16 = 512;
/// Level of a sample as bright as the white reference.
pub(super) const WHITE: u16 = 8192;
/// Highest level that is developed, a little above white. Bands saturate at different levels above
/// white; cut here, a highlight is white in all bands, and not a colour of its own.
pub(super) const HIGHEST: u16 = WHITE + (WHITE - BLACK) / 16;
/// Highest level that counts for gray: twice white, so that four of them fit 16 bits.
const HIGHEST_OF_GRAY: u16 = 16_383;
/// Levels from black to white.
pub(super) const SPAN: f32 = (WHITE - BLACK) as f32;

/// 2^23: added to a small number it leaves that number, rounded, in the lowest bits, which is cheaper
/// than a cast.
pub(super) const LOW_BITS: f32 = 8_388_608.0;

/// From [`PixelBalance`]'s numbers to levels: factor and summand.
const FROM_BALANCED: (f32, f32) =
    (SPAN / (balance::WHITE - balance::DARK), BLACK as f32 - SPAN / (balance::WHITE - balance::DARK) * balance::DARK);

/// The gray value (0..=255) of a level.
pub(super) fn gray(level: u16) -> f32 {
    (255.0 / SPAN * (f32::from(level) - f32::from(BLACK))).clamp(0.0, 255.0)
}

/// Turns samples into levels, by references per band or per pixel, and sums them up cell by cell.
#[derive(Debug, Clone)]
pub(super) struct Levels {
    /// Gain and offset of each band, by references per band.
    of_bands: [(f32, f32); BANDS],
    /// The same for each sample of four rows.
    gains: [Vec<f32>; CELL],
    offsets: [Vec<f32>; CELL],
    /// Sums of four levels, one below another, as they count for gray and as they are developed.
    of_gray: Vec<u16>,
    sums: Vec<u16>,
}

impl Levels {
    pub(super) fn new(calibration: &Calibration) -> Self {
        let dark = calibration.dark.band_means();
        let white = calibration.white.band_means();

        let of_band = |band: usize| {
            let gain = SPAN / (white[band] - dark[band]);
            (gain, f32::from(BLACK) - dark[band] * gain)
        };
        Self {
            of_bands: std::array::from_fn(of_band),
            gains: Default::default(),
            offsets: Default::default(),
            of_gray: Vec::new(),
            sums: Vec::new(),
        }
    }

    /// Makes ready for mosaics of `width` samples a row.
    pub(super) fn resize(&mut self, width: usize) {
        if self.sums.len() == width {
            return;
        }

        self.sums.resize(width, 0);
        self.of_gray.resize(width, 0);
        for (row, (gains, offsets)) in self.gains.iter_mut().zip(&mut self.offsets).enumerate() {
            let balances = (0..width).map(|x| self.of_bands[CELL * row + x % CELL]);
            gains.clear();
            gains.extend(balances.clone().map(|(gain, _)| gain));
            offsets.clear();
            offsets.extend(balances.map(|(_, offset)| offset));
        }
    }

    /// Makes the levels of the row of cells `y`, its cells' mean levels into `means`, and its part of
    /// `gray`.
    pub(super) fn make(
        &mut self,
        mosaic: &MosaicFrame,
        balance: Option<&PixelBalance>,
        y: usize,
        levels: &mut Ring<u16>,
        means: &mut [u16],
        gray: &mut GrayImage,
    ) {
        self.of_gray.fill(0);
        self.sums.fill(0);

        for row in 0..CELL {
            let samples = &mosaic.samples()[(CELL * y + row) * mosaic.width()..][..mosaic.width()];
            let out = levels.row_mut(CELL * y + row);

            match balance {
                Some(balance) => {
                    let (gains, offsets) = balance.row(CELL * y + row);
                    balance_pixels(samples, gains, offsets, out);
                }
                None => balance_bands(samples, &self.gains[row], &self.offsets[row], out),
            }

            cut_row(out, &mut self.of_gray, &mut self.sums);
            levels.fill_margins(CELL * y + row, CELL);
        }

        let width = mosaic.band_width();
        cell_means(&self.of_gray, &self.sums, means, &mut gray.data[y * width..][..width]);
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

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn balance_bands(samples: &[u16], gains: &[f32], offsets: &[f32], levels: &mut [u16]) {
    let balances = gains.iter().zip(offsets);
    for ((level, &sample), (gain, offset)) in levels.iter_mut().zip(samples).zip(balances) {
        *level = rounded(f32::from(sample) * gain + offset);
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

/// Adds a row of levels to the sums for gray, cuts it at [`HIGHEST`], and adds it to the others.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn cut_row(levels: &mut [u16], of_gray: &mut [u16], sums: &mut [u16]) {
    for (level, (of_gray, sum)) in levels.iter_mut().zip(of_gray.iter_mut().zip(sums)) {
        *of_gray += *level;
        *level = (*level).min(HIGHEST);
        *sum += *level;
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
