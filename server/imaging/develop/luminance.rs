//! Luminance at every sample: what each sample says of the mean of all bands at its own place.
//!
//! A sample senses one band, so its level must be turned into the mean that all bands would have
//! there. The samples of the same band around it, and the mean of all bands at those places, tell
//! how the two go together: where a surface is only lit more or less, they stay in proportion;
//! where something white is added, they differ by a constant. [`SHARE_OF_MEAN`] stands between the
//! two.
//!
//! That is wrong where bands change quickly beside one another, at the edge between two colours:
//! the error then differs from sample to sample and shows as a maze. Detail that changes from
//! sample to sample is therefore kept only as far as coarser detail is there too.
//!
//! The idea of carrying the mean of all bands over to each sample is that of Mihoubi, Losson,
//! Mathon, Macaire: "Multispectral demosaicing using pseudo-panchromatic image", IEEE Transactions
//! on Computational Imaging 3(4), 2017.

use multiversion::multiversion;

use super::levels::{BLACK, HIGHEST, LOW_BITS, SPAN, WHITE};
use super::ring::{MARGIN, Ring, same_bands};

/// How much of the mean of all bands stands beside a band's own mean as that to which a band's
/// deviation is in proportion. At 0 a band deviates in proportion to its level; at infinity all
/// bands deviate by the same amount.
const SHARE_OF_MEAN: f32 = 0.5;

/// Least level above black by which a deviation is divided.
const LEAST: f32 = 64.0;

/// A sample from here on may be saturated, so that it cannot tell that its place is darker than the
/// places around it.
const SATURATED: u16 = WHITE - 16;

/// Largest detail, so that four of them fit 16 bits.
const MOST_DETAIL: f32 = 8191.0;

/// Mean detail that noise alone makes, in levels.
const NOISE: f32 = SPAN / 1000.0;

/// Rows of cells that are kept of what a row is made from, and of what is made from it.
const KEPT: usize = 4;

/// Makes luminance from the levels of a mosaic whose cells have `cell` x `cell` values.
#[derive(Debug, Clone, Default)]
pub(super) struct Luminance {
    /// 4 for the sensor's mosaic; 2 for the means of its blocks of two by two.
    cell: usize,
    width: usize,
    height: usize,
    /// Weight of fine detail's energy against that of coarse detail.
    doubt: f32,
    /// The mean of all bands around each value.
    mean: Ring<u16>,
    /// What a value says beyond that mean.
    detail: Ring<i16>,
    /// The mean with the coarse part of the detail.
    coarse: Ring<i16>,
    /// The rest of the detail.
    fine: Ring<i16>,
    /// The share of the fine detail that is kept, a row of cells each.
    trust: Ring<u16>,
    result: Ring<u16>,
    lines: Lines,
}

/// Working memory of one row.
#[derive(Debug, Clone, Default)]
struct Lines {
    /// Sums down the columns, with margins.
    levels: Vec<u16>,
    means: Vec<u16>,
    details: Vec<i16>,
    /// Smooth levels of each sample's band, and smooth means of all bands.
    band: Vec<u16>,
    all: Vec<u16>,
    /// Absolute detail summed down the columns of a row of cells.
    coarse: Vec<u16>,
    fine: Vec<u16>,
    /// A value a cell, and one more on either side.
    cells: Vec<u16>,
}

impl Luminance {
    /// Makes ready for pictures of `width` x `height` values, `cell` x `cell` of them a cell.
    pub(super) fn resize(&mut self, cell: usize, width: usize, height: usize) {
        self.cell = cell;
        self.width = width;
        self.height = height;
        // Two by two samples together are less noisy, and differ less in colour.
        self.doubt = if cell == 4 { 0.6 } else { 0.15 };

        self.mean.resize(width, KEPT * cell);
        self.detail.resize(width, KEPT * cell);
        self.coarse.resize(width, 2 * cell);
        self.fine.resize(width, 2 * cell);
        self.trust.resize(width, KEPT);
        self.result.resize(width, 2 * cell);

        let padded = width + 2 * MARGIN;
        self.lines.levels.resize(padded, 0);
        self.lines.means.resize(padded, 0);
        self.lines.details.resize(padded, 0);
        self.lines.band.resize(width, 0);
        self.lines.all.resize(width, 0);
        self.lines.coarse.resize(width, 0);
        self.lines.fine.resize(width, 0);
        self.lines.cells.resize(width / cell + 2, 0);
    }

    /// Row `y` of the luminance, in levels.
    pub(super) fn row(&self, y: usize) -> &[u16] {
        self.result.row(y)
    }

    /// Makes the means around the row of cells `y`; needs the levels of the next.
    pub(super) fn make_means(&mut self, levels: &Ring<u16>, y: usize) {
        for row in self.cell * y..self.cell * (y + 1) {
            let near = |offset: isize| levels.padded(same_bands(row as isize + offset, self.height, self.cell));
            let sums = &mut self.lines.levels;

            if self.cell == 4 {
                mean_of_five([-2, -1, 0, 1, 2].map(near), sums);
                let sums: &[u16] = sums;
                let across = [0, 1, 2, 3, 4].map(|offset| &sums[MARGIN + offset - 2..][..self.width]);
                mean_of_five(across, self.mean.row_mut(row));
            } else {
                mean_of_three([-1, 0, 1].map(near), sums);
                let sums: &[u16] = sums;
                let across = [0, 1, 2].map(|offset| &sums[MARGIN + offset - 1..][..self.width]);
                mean_of_three(across, self.mean.row_mut(row));
            }

            self.mean.fill_margins(row, self.cell);
        }
    }

    /// Makes the detail of the row of cells `y`; needs the means of the next.
    pub(super) fn make_detail(&mut self, levels: &Ring<u16>, y: usize) {
        let cell = self.cell;

        for row in cell * y..cell * (y + 1) {
            let near = [-1, 0, 1].map(|cells| same_bands(row as isize + cells * cell as isize, self.height, cell));
            smooth(near.map(|row| levels.padded(row)), &mut self.lines.levels);
            smooth(near.map(|row| self.mean.padded(row)), &mut self.lines.means);

            let places = [MARGIN - cell, MARGIN, MARGIN + cell];
            let across = places.map(|place| &self.lines.levels[place..][..self.width]);
            smooth(across, &mut self.lines.band);
            let across = places.map(|place| &self.lines.means[place..][..self.width]);
            smooth(across, &mut self.lines.all);
            let smooth = (&self.lines.band[..], &self.lines.all[..]);
            detail_row(levels.row(row), self.mean.row(row), smooth, self.detail.row_mut(row));
            self.detail.fill_margins(row, 1);
        }
    }

    /// Parts the detail of the row of cells `y` into coarse and fine, and finds how far to trust
    /// the fine part; needs the detail of the next.
    pub(super) fn part(&mut self, y: usize) {
        let cell = self.cell;
        self.lines.coarse.fill(0);
        self.lines.fine.fill(0);

        for row in cell * y..cell * (y + 1) {
            let near = [row.saturating_sub(1), row, (row + 1).min(self.height - 1)];
            smooth_detail(near.map(|row| self.detail.padded(row)), &mut self.lines.details);

            let places = [MARGIN - 1, MARGIN, MARGIN + 1];
            let around = places.map(|place| &self.lines.details[place..][..self.width]);
            let parts = (self.coarse.row_mut(row), self.fine.row_mut(row));
            let sums = (&mut self.lines.coarse[..], &mut self.lines.fine[..]);
            part_row(around, self.detail.row(row), self.mean.row(row), parts, sums);
        }

        let cells = self.width / cell;
        trust_row(cell, self.doubt, &self.lines.coarse, &self.lines.fine, &mut self.lines.cells[1..=cells]);
        expand(&mut self.lines.cells, cell, self.trust.row_mut(y));
    }

    /// Makes the luminance of the row of cells `y`; needs the parts of the next.
    pub(super) fn join(&mut self, y: usize) {
        for row in 0..self.cell {
            let place = self.cell * y + row;
            let (near, weights) = between(row, self.cell, y, self.height / self.cell);
            let trust = [self.trust.row(y), self.trust.row(near)];
            join_row(self.coarse.row(place), self.fine.row(place), trust, weights, self.result.row_mut(place));
        }
    }
}

/// For row `row` of the row of cells `y`: the nearest other row of cells, and the weights (of
/// 65536) of the own one and of that, by their centres' distances.
pub(super) fn between(row: usize, cell: usize, y: usize, cells: usize) -> (usize, [u16; 2]) {
    let near = if row < cell / 2 { y.saturating_sub(1) } else { (y + 1).min(cells - 1) };
    // At least 1, so that the own weight fits 16 bits.
    let distance = (2 * row + 1).abs_diff(cell);
    let other = 65_536 * distance / (2 * cell);
    (near, [(65_536 - other) as u16, other as u16])
}

/// A value between two, by weights of 65536.
#[inline(always)]
pub(super) fn mixed(values: [u16; 2], weights: [u16; 2]) -> u16 {
    let own = (u32::from(values[0]) * u32::from(weights[0])) >> 16;
    let other = (u32::from(values[1]) * u32::from(weights[1])) >> 16;
    own as u16 + other as u16
}

/// A row between two.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
pub(super) fn mixed_row([own, near]: [&[u16]; 2], weights: [u16; 2], out: &mut [u16]) {
    for (out, (&own, &near)) in out.iter_mut().zip(own.iter().zip(near)) {
        *out = mixed([own, near], weights);
    }
}

/// Enlarges a row of one value a cell to `cell` values a cell, linearly between the cells' centres.
/// The first and last of `cells` are beside the row, and are set here.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
pub(super) fn expand(cells: &mut [u16], cell: usize, out: &mut [u16]) {
    let count = cells.len() - 2;
    cells[0] = cells[1];
    cells[count + 1] = cells[count];
    let neighbours = cells[..count].iter().zip(&cells[1..=count]).zip(&cells[2..]);

    if cell == 4 {
        for (((&left, &here), &right), out) in neighbours.zip(out.as_chunks_mut::<4>().0) {
            let (left, here, right) = (u32::from(left), u32::from(here), u32::from(right));
            *out = [
                ((3 * left + 5 * here + 4) >> 3) as u16,
                ((left + 7 * here + 4) >> 3) as u16,
                ((7 * here + right + 4) >> 3) as u16,
                ((5 * here + 3 * right + 4) >> 3) as u16,
            ];
        }
    } else {
        for (((&left, &here), &right), out) in neighbours.zip(out.as_chunks_mut::<2>().0) {
            let (left, here, right) = (u32::from(left), u32::from(here), u32::from(right));
            *out = [((left + 3 * here + 2) >> 2) as u16, ((3 * here + right + 2) >> 2) as u16];
        }
    }
}

/// The mean of five neighbours that covers four samples: the outer two count half.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn mean_of_five(near: [&[u16]; 5], out: &mut [u16]) {
    let near = near.map(|values| &values[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        let outer = (near[0][x] + near[4][x] + 1) >> 1;
        *out = (outer + near[1][x] + near[2][x] + near[3][x] + 2) >> 2;
    }
}

/// The mean of three neighbours that covers two samples.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn mean_of_three(near: [&[u16]; 3], out: &mut [u16]) {
    let near = near.map(|values| &values[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        *out = (near[0][x] + 2 * near[1][x] + near[2][x] + 2) >> 2;
    }
}

/// The mean of three values, the middle one of which counts twice.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn smooth(near: [&[u16]; 3], out: &mut [u16]) {
    let near = near.map(|values| &values[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        *out = (near[0][x] + 2 * near[1][x] + near[2][x] + 2) >> 2;
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn smooth_detail(near: [&[i16]; 3], out: &mut [i16]) {
    let near = near.map(|values| &values[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        *out = (near[0][x] + 2 * near[1][x] + near[2][x] + 2) >> 2;
    }
}

/// The detail of a row: how far the mean of all bands at each value lies from that around it, from
/// the smooth levels of the value's band and of all bands.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn detail_row(levels: &[u16], around: &[u16], (band, all): (&[u16], &[u16]), detail: &mut [i16]) {
    let values = levels.iter().zip(around).zip(band.iter().zip(all));
    for (detail, ((&level, &around), (&band_mean, &mean))) in detail.iter_mut().zip(values) {
        let deviation = f32::from(level as i16 - band_mean as i16);
        let of_band = f32::from(band_mean as i16 - BLACK as i16);
        let of_all = f32::from(mean as i16 - BLACK as i16);
        let divisor = (of_band + SHARE_OF_MEAN * of_all).max(LEAST);
        let here = (1.0 + SHARE_OF_MEAN) * of_all * deviation / divisor;
        let found = here + f32::from(mean as i16 - around as i16);

        let least = if level >= SATURATED { 0.0 } else { -MOST_DETAIL };
        *detail = rounded(found.clamp(-MOST_DETAIL, MOST_DETAIL).max(least));
    }
}

/// The nearest whole number to one within 16 bits, without the cost of a cast, which must handle
/// NaN.
#[inline(always)]
fn rounded(value: f32) -> i16 {
    // 1.5 * 2^23: a number of either sign then stands in the lowest bits.
    (value + 1.5 * LOW_BITS).to_bits() as i16
}

/// Parts a row's detail into a smooth part, added to the mean, and the rest, and adds the absolute
/// values of both to `sums`. `around` are sums down the columns, to the left, here and to the
/// right.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn part_row(
    around: [&[i16]; 3],
    detail: &[i16],
    mean: &[u16],
    (coarse, fine): (&mut [i16], &mut [i16]),
    (coarse_sum, fine_sum): (&mut [u16], &mut [u16]),
) {
    let count = coarse.len();
    let around = around.map(|values| &values[..count]);
    let (detail, mean, fine) = (&detail[..count], &mean[..count], &mut fine[..count]);
    let (coarse_sum, fine_sum) = (&mut coarse_sum[..count], &mut fine_sum[..count]);

    for x in 0..count {
        let smooth = (around[0][x] + 2 * around[1][x] + around[2][x] + 2) >> 2;
        let rest = detail[x] - smooth;
        coarse[x] = mean[x] as i16 + smooth;
        fine[x] = rest;
        coarse_sum[x] += smooth.unsigned_abs();
        fine_sum[x] += rest.unsigned_abs();
    }
}

/// How far fine detail is trusted in each cell, of 32767: the energy of the coarse detail beside
/// that of both.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn trust_row(cell: usize, doubt: f32, coarse: &[u16], fine: &[u16], trust: &mut [u16]) {
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
    trust: &mut [u16],
) {
    for ((trust, coarse), fine) in trust.iter_mut().zip(coarse).zip(fine) {
        let mut sums = [0.0, 0.0];
        for (&coarse, &fine) in coarse.iter().zip(fine) {
            sums[0] += f32::from(coarse);
            sums[1] += f32::from(fine);
        }

        let coarse = sums[0] * sums[0];
        let share = coarse / (coarse + doubt * sums[1] * sums[1] + least);
        *trust = (32_767.0 * share + LOW_BITS).to_bits() as u16;
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn join_row(coarse: &[i16], fine: &[i16], trust: [&[u16]; 2], weights: [u16; 2], out: &mut [u16]) {
    let count = out.len();
    let (coarse, fine) = (&coarse[..count], &fine[..count]);
    let trust = trust.map(|values| &values[..count]);

    for (x, out) in out.iter_mut().enumerate() {
        let trust = mixed([trust[0][x], trust[1][x]], weights) as i16;
        let kept = ((i32::from(2 * fine[x]) * i32::from(trust)) >> 16) as i16;
        *out = coarse[x].saturating_add(kept).clamp(0, HIGHEST as i16) as u16;
    }
}
