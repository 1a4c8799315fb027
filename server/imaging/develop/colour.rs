//! Colour: that of the cells, lit by the luminance of each pixel.
//!
//! The 16 samples of a cell lie at 16 places, so at an edge they would disagree in brightness, and
//! that would look like colour. So the samples are first brought to their cell's mean luminance.
//! Differences below three sixteenths of that mean stay, so that where there is no strong edge the
//! colours are the cells' own; from nine sixteenths on nothing stays.

use multiversion::multiversion;

use super::levels::{BLACK, HIGHEST, LOW_BITS, SPAN, WHITE};
use super::luminance::{Luminance, between, expand, mixed, mixed_row};
use super::ring::Ring;
use crate::imaging::calibration::{BANDS, Calibration};
use crate::imaging::colour::Encoder;
use crate::imaging::frame::CELL;
use crate::imaging::reconstruct::{Mixes, picture_row, quarters, weights};

/// Rows of cells that are kept.
const KEPT: usize = 4;

/// sRGB's encoding of c is 1.055 c^(1/2.4) - 0.055, but for the darkest colours. So light times r
/// makes the encoding plus this offset (of 255) times r^(1/2.4).
const ENCODING_OFFSET: u16 = 14;

/// Parts of an 8-bit step in which the cells' colours are kept.
const PARTS: u16 = 64;

/// A gain of 1.
const UNITY: f32 = 16_384.0;

/// Level, below black, from which ratios are taken: they would be noise in the dark.
const FLOOR: f32 = BLACK as f32 - 0.004 * SPAN;

/// Colours a picture.
#[derive(Debug, Clone)]
pub(super) struct Colour {
    mixes: Mixes,
    /// Levels of a row of cells, brought to their cells' means: four rows one after another.
    levelled: Vec<u16>,
    /// How much to subtract from each level for that.
    excess: Vec<i16>,
    /// Pixels and gray values of a row of cells.
    rgb: Vec<u8>,
    gray: Vec<f32>,
    colours: [Vec<f32>; 3],
    cells: Vec<u16>,
    /// Red, green, blue and mean of all bands, enlarged across; a row of cells each.
    planes: [Ring<u16>; 4],
    /// Mean of all bands of the cells around each pixel of a row, and the pixel's gain.
    means: Vec<u16>,
    gains: Vec<u16>,
    components: [Vec<u8>; 3],
}

impl Colour {
    pub(super) fn new(calibration: &Calibration) -> Self {
        let levels = |level: u16| [f32::from(level); BANDS];
        Self {
            mixes: Mixes::new(weights(calibration), &levels(BLACK), &levels(WHITE)),
            levelled: Vec::new(),
            excess: Vec::new(),
            rgb: Vec::new(),
            gray: Vec::new(),
            colours: Default::default(),
            cells: Vec::new(),
            planes: Default::default(),
            means: Vec::new(),
            gains: Vec::new(),
            components: Default::default(),
        }
    }

    /// Makes ready for pictures of `cells` cells a row, `per_cell` pixels each.
    pub(super) fn resize(&mut self, cells: usize, per_cell: usize) {
        let width = cells * per_cell;
        self.levelled.resize(CELL * CELL * cells, 0);
        self.excess.resize(width, 0);
        self.rgb.resize(3 * cells, 0);
        self.gray.resize(cells, 0.0);
        self.colours.iter_mut().for_each(|line| line.resize(cells, 0.0));
        self.cells.resize(cells + 2, 0);
        self.planes.iter_mut().for_each(|plane| plane.resize(width, KEPT));
        self.means.resize(width, 0);
        self.gains.resize(width, 0);
        self.components.iter_mut().for_each(|line| line.resize(width, 0));
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
        for (row, levelled) in self.levelled.chunks_exact_mut(width).enumerate() {
            // With two by two pixels a cell, two rows of samples share one row of pixels.
            if per_cell == CELL {
                excess_row::<CELL>(luminance.row(CELL * y + row), means, &mut self.excess);
                level_row::<1>(levels.row(CELL * y + row), &self.excess, levelled);
            } else {
                excess_row::<2>(luminance.row(2 * y + row / 2), means, &mut self.excess);
                level_row::<2>(levels.row(CELL * y + row), &self.excess, levelled);
            }
        }

        let rows = quarters(&self.levelled);
        colour_cells(&self.mixes, rows, encoder, &mut self.colours, &mut self.rgb, &mut self.gray);

        let count = means.len();
        for (component, plane) in self.planes.iter_mut().enumerate() {
            let cells = &mut self.cells[1..=count];
            match component {
                3 => mean_cells(&self.gray, cells),
                _ => component_cells(&self.rgb, component, cells),
            }
            expand(&mut self.cells, per_cell, plane.row_mut(y));
        }
    }

    /// Makes the pixels of row `row` of the row of cells `y`, of `cells` such rows; needs the
    /// colours of the next.
    pub(super) fn row(
        &mut self,
        (y, cells): (usize, usize),
        row: usize,
        per_cell: usize,
        luminance: &[u16],
        rgb: &mut [u8],
    ) {
        let (near, weights) = between(row, per_cell, y, cells);
        let [red, green, blue, means] = self.planes.each_ref().map(|plane| [plane.row(y), plane.row(near)]);

        mixed_row(means, weights, &mut self.means);
        gain_row(luminance, &self.means, &mut self.gains);
        for (plane, component) in [red, green, blue].into_iter().zip(&mut self.components) {
            component_row(plane, weights, (&self.gains, luminance), component);
        }

        interleave(self.components.each_ref().map(Vec::as_slice), rgb);
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

/// The levels of gray values.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn mean_cells(gray: &[f32], cells: &mut [u16]) {
    for (cell, gray) in cells.iter_mut().zip(gray) {
        *cell = (gray * (SPAN / 255.0) + f32::from(BLACK) + LOW_BITS).to_bits() as u16;
    }
}

/// One component of pixels, with its offset, in [`PARTS`].
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn component_cells(rgb: &[u8], component: usize, cells: &mut [u16]) {
    for (cell, &value) in cells.iter_mut().zip(rgb.iter().skip(component).step_by(3)) {
        *cell = (u16::from(value) + ENCODING_OFFSET) * PARTS + 2;
    }
}

/// How far the luminance of each pixel lies from its cell's mean, where that is far.
fn excess_row<const PER_CELL: usize>(luminance: &[u16], means: &[u16], excess: &mut [i16]) {
    if PER_CELL == CELL { excess_of_four(luminance, means, excess) } else { excess_of_two(luminance, means, excess) }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn excess_of_four(luminance: &[u16], means: &[u16], excess: &mut [i16]) {
    excess_of(luminance.as_chunks::<4>().0, means, excess.as_chunks_mut::<4>().0);
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn excess_of_two(luminance: &[u16], means: &[u16], excess: &mut [i16]) {
    excess_of(luminance.as_chunks::<2>().0, means, excess.as_chunks_mut::<2>().0);
}

#[inline(always)]
fn excess_of<const PER_CELL: usize>(luminance: &[[u16; PER_CELL]], means: &[u16], excess: &mut [[i16; PER_CELL]]) {
    for ((excess, luminance), &mean) in excess.iter_mut().zip(luminance).zip(means) {
        let above_black = mean.saturating_sub(BLACK);
        // Three sixteenths: more than noise and most texture.
        let limit = ((above_black >> 3) + (above_black >> 4)) as i16;

        for (excess, &luminance) in excess.iter_mut().zip(luminance) {
            let difference = luminance as i16 - mean as i16;
            let size = difference.abs();
            let left_alone = size.min(limit).min((3 * limit - size).max(0));
            *excess = if difference < 0 { left_alone - size } else { size - left_alone };
        }
    }
}

/// Subtracts from each level its excess, which `SAMPLES` neighbours share.
fn level_row<const SAMPLES: usize>(levels: &[u16], excess: &[i16], out: &mut [u16]) {
    if SAMPLES == 1 { level_singles(levels, excess, out) } else { level_pairs(levels, excess, out) }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn level_singles(levels: &[u16], excess: &[i16], out: &mut [u16]) {
    for ((out, &level), &excess) in out.iter_mut().zip(levels).zip(excess) {
        *out = (level as i16).saturating_sub(excess).clamp(0, HIGHEST as i16) as u16;
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn level_pairs(levels: &[u16], excess: &[i16], out: &mut [u16]) {
    let pairs = out.as_chunks_mut::<2>().0.iter_mut().zip(levels.as_chunks::<2>().0);
    for ((out, levels), &excess) in pairs.zip(excess) {
        for (out, &level) in out.iter_mut().zip(levels) {
            *out = (level as i16).saturating_sub(excess).clamp(0, HIGHEST as i16) as u16;
        }
    }
}

/// The gain of each pixel's encoded colour: r^(1/2.4), of [`UNITY`], for a pixel r times as bright
/// as its surroundings.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn gain_row(luminance: &[u16], means: &[u16], gains: &mut [u16]) {
    // A quotient of two quadratics that is within 0.8 % of r^(1/2.4) from 1/20 to 6, and 1 at 1.
    const ABOVE: [f32; 3] = [0.166_25, 3.680_4, 2.407_6];
    const BELOW: [f32; 3] = [1.0, 4.604_25, 0.65];

    for (gain, (&luminance, &mean)) in gains.iter_mut().zip(luminance.iter().zip(means)) {
        let mean = (f32::from(mean) - FLOOR).max(1.0);
        let here = (f32::from(luminance) - FLOOR).max(0.0).min(6.0 * mean);
        let found = UNITY * quadratic(ABOVE, mean, here) / quadratic(BELOW, mean, here);
        *gain = (found + LOW_BITS).to_bits() as u16;
    }
}

#[inline(always)]
fn quadratic([a, b, c]: [f32; 3], mean: f32, here: f32) -> f32 {
    (a * mean + b * here) * mean + c * (here * here)
}

/// One component of a row of pixels: the cells' colours, enlarged, times the gains.
///
/// A place whose mean of all bands is white reflects all bands, whatever colour the cells around it
/// have: towards white every component is lifted to it.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn component_row(plane: [&[u16]; 2], weights: [u16; 2], (gains, luminance): (&[u16], &[u16]), out: &mut [u8]) {
    // Colour and gain together have 64 * 16384 / 65536 = 16 parts a step.
    const OFFSET: u16 = 16 * ENCODING_OFFSET - 8;
    // Two levels a step, up to white.
    const LIFTED: u16 = WHITE - 2 * 255;

    let count = out.len();
    let gains = &gains[..count];
    let luminance = &luminance[..count];
    let plane = plane.map(|values| &values[..count]);

    for (x, out) in out.iter_mut().enumerate() {
        let colour = mixed([plane[0][x], plane[1][x]], weights);
        let lit = ((u32::from(colour) * u32::from(gains[x])) >> 16) as u16;
        let least = luminance[x].saturating_sub(LIFTED) >> 1;
        *out = (lit.saturating_sub(OFFSET) >> 4).max(least).min(255) as u8;
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn interleave([red, green, blue]: [&[u8]; 3], rgb: &mut [u8]) {
    let components = red.iter().zip(green).zip(blue);
    for (pixel, ((&red, &green), &blue)) in rgb.as_chunks_mut::<3>().0.iter_mut().zip(components) {
        *pixel = [red, green, blue];
    }
}
