//! Weighted sums over the 16 samples of each mosaic cell.

use crate::calibration::BANDS;
use crate::frame::CELL;

/// Cells worked on at once: a 256-bit register holds a value of each.
const LANES: usize = 8;

/// Makes `K` values from the 16 samples of a cell: a weighted sum each, plus an offset.
#[derive(Debug, Clone)]
pub(super) struct Mix<const K: usize> {
    pub(super) weights: [[f32; BANDS]; K],
    pub(super) offsets: [f32; K],
}

impl<const K: usize> Mix<K> {
    /// Sums weighted by the rows of `weights`. These are for samples scaled to 0 for dark and 1 for white. The samples
    /// given later are unscaled: they are `dark` for dark and `white` for white.
    pub(super) fn new(weights: [[f32; BANDS]; K], dark: &[f32; BANDS], white: &[f32; BANDS]) -> Self {
        let weights = weights.map(|row| std::array::from_fn(|band| row[band] / (white[band] - dark[band])));
        let offsets =
            weights.map(|row: [f32; BANDS]| -row.iter().zip(dark).map(|(weight, dark)| weight * dark).sum::<f32>());
        Self { weights, offsets }
    }

    /// Mixes one row of cells, given as its four rows of samples, into `K` rows of one value per cell.
    #[inline(always)]
    pub(super) fn apply(&self, rows: [&[u16]; CELL], mut mixed: [&mut [f32]; K]) {
        let cells = rows.map(|row| row.as_chunks::<CELL>().0);
        let count = cells[0].len();
        let whole = count - count % LANES;

        for first in (0..whole).step_by(LANES) {
            self.block::<LANES>(cells, first, &mut mixed);
        }
        for first in whole..count {
            self.block::<1>(cells, first, &mut mixed);
        }
    }

    /// Mixes the `L` cells from `first` on.
    #[inline(always)]
    fn block<const L: usize>(&self, cells: [&[[u16; CELL]]; CELL], first: usize, mixed: &mut [&mut [f32]; K]) {
        let mut sums = self.offsets.map(|offset| [offset; L]);

        for (row, cells) in cells.iter().enumerate() {
            let cells = &cells[first..first + L];
            for column in 0..CELL {
                let samples: [f32; L] = std::array::from_fn(|lane| cells[lane][column].into());
                for (sums, weights) in sums.iter_mut().zip(&self.weights) {
                    let weight = weights[CELL * row + column];
                    for (sum, sample) in sums.iter_mut().zip(samples) {
                        *sum += weight * sample;
                    }
                }
            }
        }

        for (mixed, sums) in mixed.iter_mut().zip(sums) {
            mixed[first..first + L].copy_from_slice(&sums);
        }
    }
}
