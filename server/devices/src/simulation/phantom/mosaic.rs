//! Turns abundances on the grid of mosaic cells into expected counts of each sample, at its own place within the cell.

use multiversion::multiversion;

use super::field::UNIT;
use super::sensor::FULL_SCALE;
use super::spectra::{ENDMEMBERS, endmembers_in_band};
use super::view::{Line, WIDTH};
use parfocal_imaging::{BANDS, CELL, Calibration};

/// Response of each band to each endmember, in counts at gain 1 for one unit of abundance.
pub(super) struct Bands([[f32; ENDMEMBERS]; BANDS]);

impl Bands {
    /// The bands of a sensor whose white is full scale, as the default calibration has it.
    pub(super) fn new(calibration: &Calibration) -> Self {
        Self(
            calibration.bands.map(|band| {
                endmembers_in_band(band.centre_nm, band.fwhm_nm).map(|value| value as f32 * FULL_SCALE / UNIT)
            }),
        )
    }

    /// Mean response over the bands, for a gray value on the 0..255 scale.
    pub(super) fn gray(&self) -> [f32; ENDMEMBERS] {
        let share = 255.0 / FULL_SCALE / BANDS as f32;
        std::array::from_fn(|k| share * self.0.iter().map(|band| band[k]).sum::<f32>())
    }

    /// Expected counts at gain 1 of a cell that sees `light`.
    pub(super) fn counts(&self, light: [f32; ENDMEMBERS]) -> [f32; BANDS] {
        self.0.map(|band| band.iter().zip(light).map(|(response, light)| response * light).sum())
    }

    /// Writes the expected counts of sensor row `row` (0..4) of a cell row, for the cells in `columns`, into `out` (4
    /// for each cell). `lines` are the cell rows above, here and below.
    pub(super) fn expose(&self, out: &mut [f32], lines: [&Line; 3], row: usize, columns: (usize, usize), gain: f32) {
        let (vertical, neighbour) = shift(row);
        let next = if neighbour < 0 { lines[0] } else { lines[2] };

        let weights: [[f32; ENDMEMBERS]; CELL] =
            std::array::from_fn(|column| self.0[CELL * row + column].map(|response| gain * response));

        let mut between = [[0.0; WIDTH + 2]; ENDMEMBERS];
        for ((between, here), next) in between.iter_mut().zip(lines[1]).zip(next) {
            lerp(between, here, next, vertical);
        }

        mix(&mut out[..(columns.1 - columns.0) * CELL], &between, columns.0, &weights);
    }
}

/// Distance of sample `index` of a cell from the cell's centre, in cells, and on which side (-1: left or above, 1:
/// right or below).
fn shift(index: usize) -> (f32, i32) {
    [(0.375, -1), (0.125, -1), (0.125, 1), (0.375, 1)][index]
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn lerp(out: &mut [f32], from: &[f32], to: &[f32], part: f32) {
    for ((out, from), to) in out.iter_mut().zip(from).zip(to) {
        *out = from + part * (to - from);
    }
}

/// Mixes the endmembers of the cells from column `first` on into each of a row's four bands.
#[multiversion(targets("x86_64+avx2+fma"))]
fn mix(out: &mut [f32], planes: &[[f32; WIDTH + 2]; ENDMEMBERS], first: usize, weights: &[[f32; ENDMEMBERS]; CELL]) {
    let cells = out.len() / CELL;
    // Planes have one column of darkness on the left.
    let [left, here, right] = [0, 1, 2].map(|shift| planes.each_ref().map(|plane| &plane[first + shift..][..cells]));

    for (x, out) in out.as_chunks_mut::<CELL>().0.iter_mut().enumerate() {
        let mut counts = [0.0; CELL];
        for k in 0..ENDMEMBERS {
            let left = left[k][x];
            let here = here[k][x];
            let right = right[k][x];

            counts[0] += weights[0][k] * (here + 0.375 * (left - here));
            counts[1] += weights[1][k] * (here + 0.125 * (left - here));
            counts[2] += weights[2][k] * (here + 0.125 * (right - here));
            counts[3] += weights[3][k] * (here + 0.375 * (right - here));
        }
        *out = counts;
    }
}
