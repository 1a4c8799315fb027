//! Colour: each pixel gets the colour of the cells around it, and its own luminance.
//!
//! The 16 samples of a cell lie at 16 places. At an edge they differ in brightness, which would look like colour. So
//! the samples are first brought to their cell's mean luminance. Differences below three sixteenths of that mean are
//! kept, so that the colours are the cells' own where there is no strong edge. Of a difference from nine sixteenths on,
//! nothing is kept.
//!
//! A pixel gets its surroundings' colour, made lighter or darker. sRGB encodes light c as 1.055 c^(1/2.4) - 0.055,
//! except in the darkest colours. So when light is multiplied by r, the encoding plus an offset is multiplied by
//! r^(1/2.4). Luma plus that offset, and chroma, are each divided by the encoding of the cell's luminance. These shares
//! are the same for all pixels of a cell, and they are what is enlarged. Times the encoding of a pixel's own luminance,
//! they give the pixel.

use multiversion::multiversion;

use super::lanes::{LANES, Lanes, between, mixed, upper_half};
use super::levels::{BLACK, HIGHEST, SPAN, WHITE};
use super::luminance::{Luminance, expand};
use super::ring::Ring;
use crate::calibration::{BANDS, Calibration};
use crate::colour::Encoder;
use crate::frame::CELL;
use crate::reconstruct::balance::LOW_BITS;
use crate::reconstruct::{Mixes, picture_row, quarters, weights};
use crate::ycc::{CHROMA, LUMA};

/// Rows of cells that are kept.
const KEPT: usize = 4;

/// The offset of sRGB's encoding, on the scale of 255.
const ENCODING_OFFSET: i16 = 14;

/// Parts of an 8-bit step in which luma and chroma are computed.
const PARTS: i16 = 8;

/// The encoding of white, with its offset, in [`PARTS`].
const ENCODED_WHITE: f32 = 8.0 * (255.0 + ENCODING_OFFSET as f32);

/// The number that stands for a share of 1. Its product with an encoding, divided by 65536, is in [`PARTS`].
const SHARE: f32 = 8192.0;

/// The number that stands for the encoding of white.
const ENCODED: f32 = ENCODED_WHITE * 65_536.0 / SHARE;

/// Level from which light is counted. It is below black, because ratios would be noise in the dark.
const FLOOR: f32 = (BLACK - 31) as f32;

/// Luma and both chromas.
const COMPONENTS: usize = 3;

/// Colours a picture.
#[derive(Debug, Clone)]
pub(super) struct Colour {
    mixes: Mixes,
    /// Pixels between chroma values.
    step: usize,
    /// Levels of a row of cells, brought to their cells' means: four rows one after another.
    levelled: Vec<u16>,
    /// For each pixel of a row its cell's mean, and how much to subtract from its level to bring it there.
    of_cell: Ring<u16>,
    excess: Ring<i16>,
    /// Pixels and gray values of a row of cells.
    rgb: Vec<u8>,
    gray: Vec<f32>,
    colours: [Vec<f32>; 3],
    /// Shares of luma and chroma: one value per cell, and one more on either side.
    cells: [Vec<i16>; COMPONENTS],
    /// The same, enlarged across; one row per row of cells.
    shares: [Ring<i16>; COMPONENTS],
    /// Encoded luminance of two rows of pixels.
    encoded: Ring<i16>,
    /// For each chroma value of a row: the encoding, and how far from gray it may be.
    of_chroma: Ring<i16>,
    limits: Ring<i16>,
}

impl Colour {
    pub(super) fn new(calibration: &Calibration) -> Self {
        let levels = |level: u16| [f32::from(level); BANDS];
        Self {
            mixes: Mixes::new(weights(calibration), &levels(BLACK), &levels(WHITE)),
            step: 1,
            levelled: Vec::new(),
            of_cell: Ring::default(),
            excess: Ring::default(),
            rgb: Vec::new(),
            gray: Vec::new(),
            colours: Default::default(),
            cells: Default::default(),
            shares: Default::default(),
            encoded: Ring::default(),
            of_chroma: Ring::default(),
            limits: Ring::default(),
        }
    }

    /// Prepares for pictures of `cells` cells per row and `per_cell` pixels along each side of a cell, with a chroma
    /// value for every `step` (1 or 2) pixels along either side.
    pub(super) fn resize(&mut self, cells: usize, per_cell: usize, step: usize) {
        self.step = step;
        let width = cells * per_cell;
        self.levelled.resize(CELL * CELL * cells, 0);
        self.of_cell.resize(width, 1);
        self.excess.resize(width, 1);
        self.rgb.resize(3 * cells, 0);
        self.gray.resize(cells, 0.0);
        self.colours.iter_mut().for_each(|line| line.resize(cells, 0.0));
        self.cells.iter_mut().for_each(|line| line.resize(cells + 2, 0));

        let [luma, blue, red] = &mut self.shares;
        luma.resize(width, KEPT);
        blue.resize(width / step, KEPT);
        red.resize(width / step, KEPT);

        self.encoded.resize(width, 2);
        self.of_chroma.resize(width / step, 1);
        self.limits.resize(width / step, 1);
    }

    /// Makes the colours of the row of cells `y` from its `levels`, the `means` of its cells, and
    /// its luminance, which has `per_cell` pixels along each side of a cell.
    pub(super) fn make_cells(
        &mut self,
        y: usize,
        per_cell: usize,
        levels: &Ring<u16>,
        means: &[u16],
        luminance: &Luminance,
        encoder: &Encoder,
    ) {
        let width = CELL * means.len();
        repeat(means, per_cell, self.of_cell.row_mut(0));
        // With two by two pixels per cell, two rows of samples share one row of pixels.
        let shared = CELL / per_cell;
        for (row, levelled) in self.levelled.chunks_exact_mut(shared * width).enumerate() {
            excess_row(luminance.lanes(per_cell * y + row), self.of_cell.lanes(0), self.excess.lanes_mut(0));

            for (below, levelled) in levelled.chunks_exact_mut(width).enumerate() {
                let levels = levels.row(CELL * y + shared * row + below);
                if per_cell == CELL {
                    level_singles(levels, self.excess.row(0), levelled);
                } else {
                    level_pairs(levels, self.excess.row(0), levelled);
                }
            }
        }

        let rows = quarters(&self.levelled);
        colour_cells(&self.mixes, rows, encoder, &mut self.colours, &mut self.rgb, &mut self.gray);

        let count = means.len();
        let cells = self.cells.each_mut().map(|cells| &mut cells[1..=count]);
        share_cells(&self.rgb, &self.gray, cells);

        let [luma, blue, red] = &mut self.cells;
        expand(luma, per_cell, self.shares[0].row_mut(y));
        expand(blue, per_cell / self.step, self.shares[1].row_mut(y));
        expand(red, per_cell / self.step, self.shares[2].row_mut(y));
    }

    /// Makes luma of pixel row `row` in the row of cells `y`, one of `cells`. Needs the colours of the next row of
    /// cells. Rows must be made one after another.
    pub(super) fn make_luma(
        &mut self,
        (y, cells): (usize, usize),
        row: usize,
        per_cell: usize,
        luminance: &Luminance,
        luma: &mut [u8],
    ) {
        let place = per_cell * y + row;
        let (near, eighths) = between(row, per_cell, y, cells);
        let shares = [self.shares[0].lanes(y), self.shares[0].lanes(near)];
        luma_row(shares, eighths, luminance.lanes(place), self.encoded.lanes_mut(place), luma);
    }

    /// Makes blue's and red's chroma of the same row, and of the one above it if two rows share chroma. Their luma must
    /// have been made before.
    pub(super) fn make_chroma(
        &mut self,
        (y, cells): (usize, usize),
        row: usize,
        per_cell: usize,
        luminance: &Luminance,
        chroma: [&mut [u8]; 2],
    ) {
        let place = per_cell * y + row;
        let light = luminance.lanes(place);

        if self.step == 1 {
            self.of_chroma.lanes_mut(0).copy_from_slice(self.encoded.lanes(place));
            self.limits.lanes_mut(0).copy_from_slice(light);
        } else {
            let rows = [place - 1, place];
            pair_rows(rows.map(|row| self.encoded.row(row)), self.of_chroma.row_mut(0));
            pair_rows(rows.map(|row| luminance.row(row)), self.limits.row_mut(0));
        }
        limit_row(self.limits.lanes_mut(0));

        let (near, eighths) = between(row / self.step, per_cell / self.step, y, cells);
        for (shares, out) in self.shares[1..].iter().zip(chroma) {
            let shares = [shares.lanes(y), shares.lanes(near)];
            chroma_row(shares, eighths, [self.of_chroma.lanes(0), self.limits.lanes(0)], out);
        }
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn colour_cells(
    mixes: &Mixes,
    rows: [&[u16]; CELL],
    encoder: &Encoder,
    colours: &mut [Vec<f32>; 3],
    rgb: &mut [u8],
    gray: &mut [f32],
) {
    picture_row(mixes, rows, encoder, colours, rgb, gray);
}

/// Gives each of a cell's `per_cell` pixels, 2 or 4, the cell's mean.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn repeat(means: &[u16], per_cell: usize, out: &mut [u16]) {
    if per_cell == 4 {
        out.as_chunks_mut().0.iter_mut().zip(means).for_each(|(out, &mean)| *out = [mean; 4]);
    } else {
        out.as_chunks_mut().0.iter_mut().zip(means).for_each(|(out, &mean)| *out = [mean; 2]);
    }
}

/// How much of each pixel's distance from its cell's mean is to be subtracted: nothing if the distance is small.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn excess_row(luminance: &[Lanes<i16>], means: &[Lanes<u16>], excess: &mut [Lanes<i16>]) {
    for ((excess, luminance), means) in excess.iter_mut().zip(luminance).zip(means) {
        for lane in 0..LANES {
            let above_black = means[lane].saturating_sub(BLACK);
            // Three sixteenths: more than noise and most texture.
            let limit = ((above_black >> 3) + (above_black >> 4)) as i16;

            let difference = luminance[lane] - means[lane] as i16;
            let size = difference.abs();
            let left_alone = size.min(limit).min((3 * limit - size).max(0));
            excess[lane] = if difference < 0 { left_alone - size } else { size - left_alone };
        }
    }
}

/// Subtracts from each level its excess.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn level_singles(levels: &[u16], excess: &[i16], out: &mut [u16]) {
    for ((out, &level), &excess) in out.iter_mut().zip(levels).zip(excess) {
        *out = (level as i16).saturating_sub(excess).clamp(0, HIGHEST as i16) as u16;
    }
}

/// Subtracts from each level its excess, which two neighbours share.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn level_pairs(levels: &[u16], excess: &[i16], out: &mut [u16]) {
    let pairs = out.as_chunks_mut::<2>().0.iter_mut().zip(levels.as_chunks::<2>().0);
    for ((out, levels), &excess) in pairs.zip(excess) {
        for (out, &level) in out.iter_mut().zip(levels) {
            *out = (level as i16).saturating_sub(excess).clamp(0, HIGHEST as i16) as u16;
        }
    }
}

/// What the pixels of each cell have in common: luma with its offset, and chroma, each divided by the encoding of the
/// cell's luminance.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn share_cells(rgb: &[u8], gray: &[f32], cells: [&mut [i16]; COMPONENTS]) {
    let [luma_shares, blue_shares, red_shares] = cells;
    let shares = luma_shares.iter_mut().zip(blue_shares).zip(red_shares);

    for ((((luma_share, blue_share), red_share), pixel), gray) in shares.zip(rgb.as_chunks::<3>().0).zip(gray) {
        let [red, green, blue] = pixel.map(f32::from);
        let luma = LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue;

        let level = (gray * (SPAN / 255.0) + f32::from(BLACK)).max(FLOOR);
        let beside = SHARE / ENCODED_WHITE * f32::from(PARTS) / encoding(level, 1.0, 0.0);
        *luma_share = nearest(beside * (luma + f32::from(ENCODING_OFFSET)));
        *blue_share = nearest(beside * CHROMA[0] * (blue - luma));
        *red_share = nearest(beside * CHROMA[1] * (red - luma));
    }
}

#[inline(always)]
fn nearest(share: f32) -> i16 {
    (share.clamp(-32_767.0, 32_767.0) + 1.5 * LOW_BITS).to_bits() as i16
}

/// `times` x^(1/2.4) + `plus`, where x is the light of a level above [`FLOOR`], 1 for white. The level must not be
/// below [`FLOOR`].
///
/// The power is computed as a quotient of two quadratics. It is within 1.1 % from 1/250 of white on, and 0.06 for no
/// light. An error that is the same at a cell and at a pixel cancels out. To save steps, the quotient's limit is
/// divided out, so that the numerator is linear, and it is written for levels instead of light.
#[inline(always)]
fn encoding(level: f32, times: f32, plus: f32) -> f32 {
    // (a + b x + c x^2) / (d + e x + f x^2) of light x, white 1.
    const ABOVE: [f32; 3] = [0.061_615, 13.9994, 70.8435];
    const BELOW: [f32; 3] = [1.0, 42.9598, 41.1044];

    const LIMIT: f32 = ABOVE[2] / BELOW[2];
    const SLOPE: f32 = (ABOVE[1] - LIMIT * BELOW[1]) / BELOW[2] * SPAN;
    const OFFSET: f32 = (ABOVE[0] - LIMIT * BELOW[0]) / BELOW[2] * SPAN * SPAN - SLOPE * FLOOR;
    const MIDDLE: f32 = BELOW[1] / BELOW[2] * SPAN - 2.0 * FLOOR;
    const LEAST: f32 = BELOW[0] / BELOW[2] * SPAN * SPAN - BELOW[1] / BELOW[2] * SPAN * FLOOR + FLOOR * FLOOR;

    (times * SLOPE * level + times * OFFSET) / ((level + MIDDLE) * level + LEAST) + (times * LIMIT + plus)
}

/// Luma of a row of pixels: the cells' share of it, enlarged, times the pixels' own encodings, which
/// are kept in `encoded`.
///
/// A place whose mean of all bands is white reflects all bands, whatever colour the cells around it have. So where
/// luminance nears white, luma is lifted to white.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn luma_row(
    shares: [&[Lanes<i16>]; 2],
    eighths: u8,
    luminance: &[Lanes<i16>],
    encoded: &mut [Lanes<i16>],
    luma: &mut [u8],
) {
    match eighths {
        1 => luma_lanes::<1>(shares, luminance, encoded, luma),
        2 => luma_lanes::<2>(shares, luminance, encoded, luma),
        _ => luma_lanes::<3>(shares, luminance, encoded, luma),
    }
}

#[inline(always)]
fn luma_lanes<const EIGHTHS: u8>(
    [own, near]: [&[Lanes<i16>]; 2],
    luminance: &[Lanes<i16>],
    encoded: &mut [Lanes<i16>],
    luma: &mut [u8],
) {
    let (whole, rest) = luma.as_chunks_mut();
    let count = whole.len();
    for (x, out) in whole.iter_mut().enumerate() {
        luma_vector::<EIGHTHS>([&own[x], &near[x]], &luminance[x], &mut encoded[x], out);
    }

    if !rest.is_empty() {
        let mut last = [0; LANES];
        luma_vector::<EIGHTHS>([&own[count], &near[count]], &luminance[count], &mut encoded[count], &mut last);
        rest.copy_from_slice(&last[..rest.len()]);
    }
}

#[inline(always)]
fn luma_vector<const EIGHTHS: u8>(
    [own, near]: [&Lanes<i16>; 2],
    luminance: &Lanes<i16>,
    encoded: &mut Lanes<i16>,
    luma: &mut Lanes<u8>,
) {
    // A half is added, to round.
    const OFFSET: i16 = PARTS * ENCODING_OFFSET - PARTS / 2;

    for lane in 0..LANES {
        let level = luminance[lane].max(FLOOR as i16);
        encoded[lane] = encoding(level.into(), ENCODED, LOW_BITS).to_bits() as i16;
    }
    for lane in 0..LANES {
        let lit = upper_half(mixed::<EIGHTHS>(own[lane], near[lane]), encoded[lane]);
        let found = (lit - OFFSET) >> 3;
        luma[lane] = found.max(least(luminance[lane])).clamp(0, 255) as u8;
    }
}

/// The least luma of a pixel of this luminance: one step for every two levels, up to 255 at white.
#[inline(always)]
fn least(luminance: i16) -> i16 {
    (luminance - (WHITE as i16 - 2 * 255)) >> 1
}

/// Chroma of a row: the cells' share of it, enlarged, times the encoding, within limits.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn chroma_row(shares: [&[Lanes<i16>]; 2], eighths: u8, light: [&[Lanes<i16>]; 2], chroma: &mut [u8]) {
    match eighths {
        0 => chroma_lanes::<0>(shares, light, chroma),
        1 => chroma_lanes::<1>(shares, light, chroma),
        2 => chroma_lanes::<2>(shares, light, chroma),
        _ => chroma_lanes::<3>(shares, light, chroma),
    }
}

#[inline(always)]
fn chroma_lanes<const EIGHTHS: u8>([own, near]: [&[Lanes<i16>]; 2], light: [&[Lanes<i16>]; 2], chroma: &mut [u8]) {
    let [encoded, limits] = light;
    let (whole, rest) = chroma.as_chunks_mut();
    let count = whole.len();
    for (x, out) in whole.iter_mut().enumerate() {
        chroma_vector::<EIGHTHS>([&own[x], &near[x]], &encoded[x], &limits[x], out);
    }

    if !rest.is_empty() {
        let mut last = [0; LANES];
        chroma_vector::<EIGHTHS>([&own[count], &near[count]], &encoded[count], &limits[count], &mut last);
        rest.copy_from_slice(&last[..rest.len()]);
    }
}

#[inline(always)]
fn chroma_vector<const EIGHTHS: u8>(
    [own, near]: [&Lanes<i16>; 2],
    encoded: &Lanes<i16>,
    limits: &Lanes<i16>,
    chroma: &mut Lanes<u8>,
) {
    for lane in 0..LANES {
        let lit = upper_half(mixed::<EIGHTHS>(own[lane], near[lane]), encoded[lane]);
        let found = (lit + PARTS / 2) >> 3;
        let limit = limits[lane];
        chroma[lane] = (found.min(limit).max(-limit) + 128) as u8;
    }
}

/// Means of two by two values.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn pair_rows(rows: [&[i16]; 2], out: &mut [i16]) {
    let [upper, lower] = rows.map(|row| row.as_chunks::<2>().0);
    for (out, (upper, lower)) in out.iter_mut().zip(upper.iter().zip(lower)) {
        *out = mean(mean(upper[0], lower[0]), mean(upper[1], lower[1]));
    }
}

/// The mean of two values, rounded down. The sum of two encodings may not fit 16 bits.
#[inline(always)]
fn mean(one: i16, other: i16) -> i16 {
    one + ((other - one) >> 1)
}

/// Turns luminance into the largest distance of chroma from gray. Towards white it falls to 0: no colour.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn limit_row(limits: &mut [Lanes<i16>]) {
    for limits in limits {
        for limit in limits {
            let headroom = 255 - least(*limit);
            *limit = ((headroom >> 1) + (headroom >> 3)).clamp(0, 127);
        }
    }
}
