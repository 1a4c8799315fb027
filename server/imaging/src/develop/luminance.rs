//! Luminance at every sample: the mean of all bands at the sample's place, estimated from its one band.
//!
//! A sample senses one band, so its level must be turned into the mean that all bands would have there. The samples of
//! the same band around it, and the mean of all bands at those places, show how the two are related. If a surface is
//! only lit more or less, they stay in proportion. If something white is added, they differ by a constant. [`SHARES`]
//! is a compromise between the two.
//!
//! This fails where that relation changes quickly, at the edge between two colours. The error then differs from sample
//! to sample and looks like a maze. Detail that changes from sample to sample is therefore kept only as far as coarser
//! detail is there too.
//!
//! The idea of carrying the mean of all bands over to each sample is that of Mihoubi, Losson,
//! Mathon, Macaire: "Multispectral demosaicing using pseudo-panchromatic image", IEEE Transactions
//! on Computational Imaging 3(4), 2017.

use multiversion::multiversion;

use super::lanes::{LANES, Lanes, between, halfway, mixed, upper_half, weighted};
use super::levels::{BLACK, HIGHEST, SPAN, WHITE};
use super::ring::{Ring, same_bands};
use crate::reconstruct::balance::LOW_BITS;

/// A band's deviation is taken to be in proportion to a weighted sum of the band's own mean and the mean of all bands.
/// These are the two weights. With the first alone a band deviates in proportion to its level; with the second alone
/// all bands deviate by the same amount.
const SHARES: [i16; 2] = [2, 1];

/// Least weighted sum (see [`SHARES`]) by which a deviation is divided: that of a band 64 levels above black, while the
/// mean of all bands is black.
const LEAST: i16 = 128;

/// A sample of this level or above may be saturated, so it does not show that its place is darker than the places
/// around it.
const SATURATED: u16 = WHITE - 16;

/// Largest detail, so that the sum of four fits 16 bits.
const MOST_DETAIL: i16 = 8191;

/// Mean detail that noise alone makes, in levels.
const NOISE: f32 = SPAN / 1000.0;

/// Rows of cells that are kept of each intermediate result that the next rows need.
const KEPT: usize = 4;

/// Makes luminance from the levels of a mosaic whose cells have `cell` x `cell` values.
#[derive(Debug, Clone, Default)]
pub(super) struct Luminance {
    /// Values along a cell's side: 4 for the sensor's mosaic; 2 for the means of its blocks of two by two.
    cell: usize,
    width: usize,
    height: usize,
    /// Weight of fine detail's energy against that of coarse detail.
    doubt: f32,
    /// The mean of all bands around each value.
    mean: Ring<u16>,
    /// Levels and means, smoothed across over the same band's values.
    smooth_levels: Ring<u16>,
    smooth_means: Ring<u16>,
    /// How far the mean of all bands at each value lies from `mean`; and the same, smoothed across.
    detail: Ring<i16>,
    smooth_detail: Ring<i16>,
    /// The mean with the coarse part of the detail.
    coarse: Ring<i16>,
    /// The rest of the detail.
    fine: Ring<i16>,
    /// The share of the fine detail that is kept, of 32767; one row per row of cells.
    trust: Ring<i16>,
    result: Ring<i16>,
    lines: Lines,
}

/// Working memory of a row of cells.
#[derive(Debug, Clone, Default)]
struct Lines {
    /// Sums of levels down the columns, for each row of values.
    levels: Ring<u16>,
    /// Absolute detail summed down the columns of a row of cells.
    coarse: Ring<u16>,
    fine: Ring<u16>,
    /// One value per cell, and one more on either side.
    cells: Vec<i16>,
}

impl Luminance {
    /// Prepares for pictures of `width` x `height` values, `cell` x `cell` of them per cell.
    pub(super) fn resize(&mut self, cell: usize, width: usize, height: usize) {
        self.cell = cell;
        self.width = width;
        self.height = height;
        // Two by two samples together are less noisy, and differ less in colour.
        self.doubt = if cell == 4 { 0.6 } else { 0.15 };

        self.mean.resize(width, KEPT * cell);
        self.smooth_levels.resize(width, KEPT * cell);
        self.smooth_means.resize(width, KEPT * cell);
        self.detail.resize(width, KEPT * cell);
        self.smooth_detail.resize(width, KEPT * cell);
        self.coarse.resize(width, 2 * cell);
        self.fine.resize(width, 2 * cell);
        self.trust.resize(width, KEPT);
        self.result.resize(width, 2 * cell);

        let Lines { levels, coarse, fine, cells } = &mut self.lines;
        levels.resize(width, cell);
        coarse.resize(width, 1);
        fine.resize(width, 1);
        cells.resize(width / cell + 2, 0);
    }

    /// Row `y` of the luminance, in levels.
    pub(super) fn row(&self, y: usize) -> &[i16] {
        self.result.row(y)
    }

    /// The vectors of row `y` of the luminance, in levels.
    pub(super) fn lanes(&self, y: usize) -> &[Lanes<i16>] {
        self.result.lanes(y)
    }

    /// Makes the means around the row of cells `y`. Needs the levels of the next row.
    pub(super) fn make_means(&mut self, levels: &Ring<u16>, y: usize) {
        let cell = self.cell;
        let step = cell as isize;
        let across = [-step, 0, step];
        let sums = &mut self.lines.levels;

        if cell == 4 {
            let first = 4 * y as isize - 2;
            let near = |by: isize| levels.padded_lanes(same_bands(first + by, self.height, cell));
            sum_rows([0, 1, 2, 3, 4, 5, 6, 7].map(near), sums.padded_rows_mut(0));
        }

        for row in cell * y..cell * (y + 1) {
            if cell == 4 {
                mean_of_five([-2, -1, 0, 1, 2].map(|by| sums.shifted(row, by)), self.mean.lanes_mut(row));
            } else {
                let near = |by: isize| levels.padded_lanes(same_bands(row as isize + by, self.height, cell));
                smooth([-1, 0, 1].map(near), sums.padded_lanes_mut(row));
                smooth([-1, 0, 1].map(|by| sums.shifted(row, by)), self.mean.lanes_mut(row));
            }

            self.mean.fill_margins(row, cell);
            smooth(across.map(|by| levels.shifted(row, by)), self.smooth_levels.lanes_mut(row));
            smooth(across.map(|by| self.mean.shifted(row, by)), self.smooth_means.lanes_mut(row));
        }
    }

    /// Makes the detail of the row of cells `y`. Needs the means of the next row.
    pub(super) fn make_detail(&mut self, levels: &Ring<u16>, y: usize) {
        let cell = self.cell;
        let step = cell as isize;

        for row in cell * y..cell * (y + 1) {
            let near = [-step, 0, step].map(|by| same_bands(row as isize + by, self.height, cell));
            let band = near.map(|row| self.smooth_levels.lanes(row));
            let all = near.map(|row| self.smooth_means.lanes(row));
            detail_row(levels.lanes(row), self.mean.lanes(row), band, all, self.detail.lanes_mut(row));
            self.detail.fill_margins(row, 1);
            let across = [-1, 0, 1].map(|by| self.detail.shifted(row, by));
            smooth_detail(across, self.smooth_detail.lanes_mut(row));
        }
    }

    /// Splits the detail of the row of cells `y` into coarse and fine, and finds how far to trust the fine part. Needs
    /// the detail of the next row.
    pub(super) fn part(&mut self, y: usize) {
        let cell = self.cell;
        if cell == 4 {
            self.part_cells::<4, 6>(y);
        } else {
            self.part_cells::<2, 4>(y);
        }

        let Lines { coarse, fine, cells, .. } = &mut self.lines;
        let count = self.width / cell;
        trust_row(cell, self.doubt, coarse.row(0), fine.row(0), &mut cells[1..=count]);
        expand(cells, cell, self.trust.row_mut(y));
    }

    /// [`part_rows`] for the row of cells `y`, which has `ROWS` rows of values.
    fn part_cells<const ROWS: usize, const AROUND: usize>(&mut self, y: usize) {
        let first = ROWS * y;
        let last = self.height - 1;
        let around = std::array::from_fn(|row| self.smooth_detail.lanes((first + row).saturating_sub(1).min(last)));
        let detail = std::array::from_fn(|row| self.detail.lanes(first + row));
        let mean = std::array::from_fn(|row| self.mean.lanes(first + row));

        let parts = (self.coarse.rows_mut(first), self.fine.rows_mut(first));
        let sums = (self.lines.coarse.lanes_mut(0), self.lines.fine.lanes_mut(0));
        part_rows::<ROWS, AROUND>(around, detail, mean, parts, sums);
    }

    /// Makes the luminance of the row of cells `y`. Needs the parts of the next row.
    pub(super) fn join(&mut self, y: usize) {
        for row in 0..self.cell {
            let place = self.cell * y + row;
            let (near, eighths) = between(row, self.cell, y, self.height / self.cell);
            let trust = [self.trust.lanes(y), self.trust.lanes(near)];
            let parts = [self.coarse.lanes(place), self.fine.lanes(place)];
            join_row(parts, trust, eighths, self.result.lanes_mut(place));
        }
    }
}

/// Enlarges a row of one value per cell to `per_cell` values (1, 2 or 4) per cell, linearly between the cells' centres.
/// The first and the last of `cells` lie beside the row, and are set here.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
pub(super) fn expand(cells: &mut [i16], per_cell: usize, out: &mut [i16]) {
    let count = cells.len() - 2;
    cells[0] = cells[1];
    cells[count + 1] = cells[count];
    let neighbours = cells[..count].iter().zip(&cells[1..=count]).zip(&cells[2..]);

    match per_cell {
        1 => out.copy_from_slice(&cells[1..=count]),
        2 => {
            for (((&left, &here), &right), out) in neighbours.zip(out.as_chunks_mut::<2>().0) {
                *out = [mixed::<2>(here, left), mixed::<2>(here, right)];
            }
        }
        _ => {
            for (((&left, &here), &right), out) in neighbours.zip(out.as_chunks_mut::<4>().0) {
                let before = [mixed::<3>(here, left), mixed::<1>(here, left)];
                let after = [mixed::<1>(here, right), mixed::<3>(here, right)];
                *out = [before[0], before[1], after[0], after[1]];
            }
        }
    }
}

/// The mean of five neighbours that covers four samples: the outer two count half.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn mean_of_five(near: [&[Lanes<u16>]; 5], out: &mut [Lanes<u16>]) {
    let near = near.map(|values| &values[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        for lane in 0..LANES {
            let inner = near[1][x][lane] + near[2][x][lane] + near[3][x][lane];
            out[lane] = mean_of(near[0][x][lane], inner, near[4][x][lane]);
        }
    }
}

/// Like [`mean_of_five`], but down the columns: makes four rows from the eight around them.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn sum_rows(near: [&[Lanes<u16>]; 8], out: [&mut [Lanes<u16>]; 4]) {
    let count = out[0].len();
    let near = near.map(|values| &values[..count]);
    let [first, second, third, fourth] = out.map(|values| &mut values[..count]);

    for x in 0..count {
        for lane in 0..LANES {
            let inner = [
                near[1][x][lane] + near[2][x][lane] + near[3][x][lane],
                near[2][x][lane] + near[3][x][lane] + near[4][x][lane],
                near[3][x][lane] + near[4][x][lane] + near[5][x][lane],
                near[4][x][lane] + near[5][x][lane] + near[6][x][lane],
            ];
            first[x][lane] = mean_of(near[0][x][lane], inner[0], near[4][x][lane]);
            second[x][lane] = mean_of(near[1][x][lane], inner[1], near[5][x][lane]);
            third[x][lane] = mean_of(near[2][x][lane], inner[2], near[6][x][lane]);
            fourth[x][lane] = mean_of(near[3][x][lane], inner[3], near[7][x][lane]);
        }
    }
}

/// The mean of five values, given the sum of the inner three.
#[inline(always)]
fn mean_of(first: u16, inner: u16, last: u16) -> u16 {
    (halfway(first, last) + inner + 2) >> 2
}

/// The mean of three values with the middle one counted twice. For neighbours, it covers two values.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn smooth(near: [&[Lanes<u16>]; 3], out: &mut [Lanes<u16>]) {
    let near = near.map(|values| &values[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        for lane in 0..LANES {
            out[lane] = weighted([near[0][x][lane], near[1][x][lane], near[2][x][lane]]);
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn smooth_detail(near: [&[Lanes<i16>]; 3], out: &mut [Lanes<i16>]) {
    let near = near.map(|values| &values[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        for lane in 0..LANES {
            out[lane] = smooth_of([near[0][x][lane], near[1][x][lane], near[2][x][lane]]);
        }
    }
}

#[inline(always)]
fn smooth_of([left, here, right]: [i16; 3]) -> i16 {
    (left + 2 * here + right + 2) >> 2
}

/// The detail of a row: how far the mean of all bands at each value lies from the mean `around` it. `band` and `all`
/// are the levels of the value's band and the means of all bands, smoothed across, in the row of cells above, here and
/// below.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn detail_row(
    levels: &[Lanes<u16>],
    around: &[Lanes<u16>],
    band: [&[Lanes<u16>]; 3],
    all: [&[Lanes<u16>]; 3],
    detail: &mut [Lanes<i16>],
) {
    let count = detail.len();
    let (levels, around) = (&levels[..count], &around[..count]);
    let band = band.map(|row| &row[..count]);
    let all = all.map(|row| &row[..count]);

    for (x, detail) in detail.iter_mut().enumerate() {
        for lane in 0..LANES {
            let level = levels[x][lane];
            let of_band = weighted([band[0][x][lane], band[1][x][lane], band[2][x][lane]]) as i16;
            let of_all = weighted([all[0][x][lane], all[1][x][lane], all[2][x][lane]]) as i16;

            let light = of_all - BLACK as i16;
            let divisor = (SHARES[0] * (of_band - BLACK as i16) + SHARES[1] * light).max(LEAST);
            let deviation = (SHARES[0] + SHARES[1]) * (level as i16 - of_band);
            let here = f32::from(light) * f32::from(deviation) / f32::from(divisor);

            let most = f32::from(MOST_DETAIL);
            let found = rounded(here.clamp(-most, most)) + (of_all - around[x][lane] as i16);
            let least = if level >= SATURATED { 0 } else { -MOST_DETAIL };
            detail[lane] = found.clamp(least, MOST_DETAIL);
        }
    }
}

/// The whole number nearest to `value`, which must fit 16 bits. Cheaper than a cast, which must handle NaN.
#[inline(always)]
fn rounded(value: f32) -> i16 {
    // 1.5 * 2^23: a number of either sign is then in the lowest bits.
    (value + 1.5 * LOW_BITS).to_bits() as i16
}

/// Rows that are to be written.
type Rows<'a, const ROWS: usize> = [&'a mut [Lanes<i16>]; ROWS];

/// Splits the detail of a row of cells (`ROWS` rows of values) into a smooth part, which is added to the mean, and the
/// rest. Sums the absolute values of both down the columns. `around` is the detail smoothed across, in those rows and
/// in the one above and below them: `AROUND` rows.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn part_rows<const ROWS: usize, const AROUND: usize>(
    around: [&[Lanes<i16>]; AROUND],
    detail: [&[Lanes<i16>]; ROWS],
    mean: [&[Lanes<u16>]; ROWS],
    (coarse, fine): (Rows<'_, ROWS>, Rows<'_, ROWS>),
    (coarse_sum, fine_sum): (&mut [Lanes<u16>], &mut [Lanes<u16>]),
) {
    let count = coarse_sum.len();
    let around = around.map(|values| &values[..count]);
    let detail = detail.map(|values| &values[..count]);
    let mean = mean.map(|values| &values[..count]);
    let coarse = coarse.map(|values| &mut values[..count]);
    let fine = fine.map(|values| &mut values[..count]);
    let fine_sum = &mut fine_sum[..count];

    for x in 0..count {
        let mut sums = [[0; LANES]; 2];
        for row in 0..ROWS {
            let near = [around[row][x], around[row + 1][x], around[row + 2][x]];
            let (detail, mean) = (detail[row][x], mean[row][x]);
            let mut parts = [[0; LANES]; 2];
            for lane in 0..LANES {
                let smooth = smooth_of([near[0][lane], near[1][lane], near[2][lane]]);
                let rest = detail[lane] - smooth;
                parts[0][lane] = mean[lane] as i16 + smooth;
                parts[1][lane] = rest;
                sums[0][lane] += smooth.unsigned_abs();
                sums[1][lane] += rest.unsigned_abs();
            }
            [coarse[row][x], fine[row][x]] = parts;
        }
        [coarse_sum[x], fine_sum[x]] = sums;
    }
}

/// How far fine detail is trusted in each cell, of 32767: the share of the coarse detail's energy in that of both.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn trust_row(cell: usize, doubt: f32, coarse: &[u16], fine: &[u16], trust: &mut [i16]) {
    let least = (NOISE * (cell * cell) as f32).powi(2);
    if cell == 4 {
        trust_cells(doubt, least, coarse.as_chunks::<4>().0, fine.as_chunks::<4>().0, trust);
    } else {
        trust_cells(doubt, least, coarse.as_chunks::<2>().0, fine.as_chunks::<2>().0, trust);
    }
}

#[inline(always)]
fn trust_cells<const CELL: usize>(
    doubt: f32,
    least: f32,
    coarse: &[[u16; CELL]],
    fine: &[[u16; CELL]],
    trust: &mut [i16],
) {
    for ((trust, coarse), fine) in trust.iter_mut().zip(coarse).zip(fine) {
        let mut sums = [0.0, 0.0];
        for (&coarse, &fine) in coarse.iter().zip(fine) {
            sums[0] += f32::from(coarse);
            sums[1] += f32::from(fine);
        }

        let coarse = sums[0] * sums[0];
        let share = coarse / (coarse + doubt * sums[1] * sums[1] + least);
        *trust = (32_767.0 * share + LOW_BITS).to_bits() as i16;
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn join_row(parts: [&[Lanes<i16>]; 2], trust: [&[Lanes<i16>]; 2], eighths: u8, out: &mut [Lanes<i16>]) {
    match eighths {
        1 => join_lanes::<1>(parts, trust, out),
        2 => join_lanes::<2>(parts, trust, out),
        _ => join_lanes::<3>(parts, trust, out),
    }
}

#[inline(always)]
fn join_lanes<const EIGHTHS: u8>(
    [coarse, fine]: [&[Lanes<i16>]; 2],
    trust: [&[Lanes<i16>]; 2],
    out: &mut [Lanes<i16>],
) {
    let count = out.len();
    let (coarse, fine) = (&coarse[..count], &fine[..count]);
    let trust = trust.map(|values| &values[..count]);

    for (x, out) in out.iter_mut().enumerate() {
        for lane in 0..LANES {
            let trust = mixed::<EIGHTHS>(trust[0][x][lane], trust[1][x][lane]);
            let kept = upper_half(2 * fine[x][lane], trust);
            out[lane] = coarse[x][lane].saturating_add(kept).clamp(0, HIGHEST as i16);
        }
    }
}
