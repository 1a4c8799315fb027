//! The latest rows of a picture, each with a margin on either side.

use super::lanes::{LANES, Lanes};

/// Values beside a row, on either side, that filters may read: a whole vector, so that rows begin where a vector does.
pub(super) const MARGIN: usize = LANES;

/// Values of a margin that filters really read, and that are therefore filled: more than the side of a mosaic cell.
const FILLED: usize = 8;

/// Bytes of a cache line. A vector that lies across two lines takes twice as long to read.
const LINE: usize = 64;

/// The latest rows of a picture that is made from top to bottom.
///
/// Rows are made and read in whole vectors, so some values beyond a row's end are made too. Nothing
/// depends on them: filters read the margins, which are filled afterwards.
#[derive(Debug, Clone, Default)]
pub(super) struct Ring<T> {
    values: Vec<T>,
    /// Unused values before the first row, so that the row begins at a cache line.
    skipped: usize,
    width: usize,
    rows: usize,
}

impl<T: Copy + Default> Ring<T> {
    /// Makes room for `rows` rows of `width` values; keeps its memory if that is large enough.
    pub(super) fn resize(&mut self, width: usize, rows: usize) {
        self.width = width;
        self.rows = rows;
        let spare = LINE / size_of::<T>();
        self.values.resize(self.stride() * rows + spare, T::default());
        self.skipped = self.values.as_ptr().align_offset(LINE).min(spare);
    }

    /// Values from one row to the next: the whole vectors of a row, and a margin on either side.
    const fn stride(&self) -> usize {
        self.whole() + 2 * MARGIN
    }

    /// Values of the whole vectors that hold a row.
    const fn whole(&self) -> usize {
        self.width.next_multiple_of(LANES)
    }

    /// Row `y` of the picture, without its margins.
    pub(super) fn row(&self, y: usize) -> &[T] {
        &self.padded(y)[MARGIN..][..self.width]
    }

    /// Row `y` of the picture, without its margins.
    pub(super) fn row_mut(&mut self, y: usize) -> &mut [T] {
        let width = self.width;
        &mut self.padded_mut(y)[MARGIN..][..width]
    }

    /// The vectors of row `y`.
    pub(super) fn lanes(&self, y: usize) -> &[Lanes<T>] {
        self.shifted(y, 0)
    }

    /// The vectors of row `y`.
    pub(super) fn lanes_mut(&mut self, y: usize) -> &mut [Lanes<T>] {
        let whole = self.whole();
        self.padded_mut(y)[MARGIN..][..whole].as_chunks_mut().0
    }

    /// The vectors of row `y`, starting `by` values further right (left if negative), at most [`MARGIN`].
    pub(super) fn shifted(&self, y: usize, by: isize) -> &[Lanes<T>] {
        self.padded(y)[MARGIN.saturating_add_signed(by)..][..self.whole()].as_chunks().0
    }

    /// The vectors of row `y` with its margins.
    pub(super) fn padded_lanes(&self, y: usize) -> &[Lanes<T>] {
        self.padded(y).as_chunks().0
    }

    /// The vectors of row `y` with its margins.
    pub(super) fn padded_lanes_mut(&mut self, y: usize) -> &mut [Lanes<T>] {
        self.padded_mut(y).as_chunks_mut().0
    }

    /// The vectors of the `N` rows from `y` on. Both `y` and the ring's number of rows are multiples of `N`.
    pub(super) fn rows_mut<const N: usize>(&mut self, y: usize) -> [&mut [Lanes<T>]; N] {
        let whole = self.whole();
        self.some_mut(y).map(|row| row[MARGIN..][..whole].as_chunks_mut().0)
    }

    /// The vectors of the `N` rows from `y` on, with their margins.
    pub(super) fn padded_rows_mut<const N: usize>(&mut self, y: usize) -> [&mut [Lanes<T>]; N] {
        self.some_mut(y).map(|row| row.as_chunks_mut().0)
    }

    /// The `N` rows from `y` on, with their margins.
    fn some_mut<const N: usize>(&mut self, y: usize) -> [&mut [T]; N] {
        let stride = self.stride();
        let rows = &mut self.values[self.skipped + y % self.rows * stride..][..N * stride];
        let mut rows = rows.chunks_exact_mut(stride);
        std::array::from_fn(|_| rows.next().unwrap_or_default())
    }

    fn padded(&self, y: usize) -> &[T] {
        let stride = self.stride();
        &self.values[self.skipped + y % self.rows * stride..][..stride]
    }

    fn padded_mut(&mut self, y: usize) -> &mut [T] {
        let stride = self.stride();
        &mut self.values[self.skipped + y % self.rows * stride..][..stride]
    }

    /// Fills the margins of row `y` with the row's first and last `period` values, over and over.
    ///
    /// `period` divides [`FILLED`]. If the period is the side of a mosaic cell, each place in the margin gets a value
    /// of the band that would be there.
    pub(super) fn fill_margins(&mut self, y: usize, period: usize) {
        let end = MARGIN + self.width;
        let row = self.padded_mut(y);
        for place in (0..FILLED).step_by(period) {
            row.copy_within(MARGIN..MARGIN + period, MARGIN - FILLED + place);
            row.copy_within(end - period..end, end + place);
        }
    }
}

/// Row `y`. If that is outside the picture's `rows` rows, the nearest row that holds the same bands. A row of cells has
/// `cell` rows.
pub(super) fn same_bands(y: isize, rows: usize, cell: usize) -> usize {
    let phase = y.rem_euclid(cell as isize) as usize;
    match usize::try_from(y) {
        Err(_) => phase,
        Ok(y) if y >= rows => rows - cell + phase,
        Ok(y) => y,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_continue_the_bands() {
        let mut ring = Ring::default();
        ring.resize(8, 3);
        ring.row_mut(4).copy_from_slice(&[1, 2, 3, 4, 5, 6, 7, 8]);
        ring.fill_margins(4, 4);
        let row = ring.padded(4);
        assert_eq!(row[MARGIN - 6..MARGIN], [3, 4, 1, 2, 3, 4]);
        assert_eq!(row[MARGIN + 8..MARGIN + 14], [5, 6, 7, 8, 5, 6]);
    }

    #[test]
    fn rows_beyond_the_picture_continue_the_bands() {
        assert_eq!([-1, -8, 0, 11, 12, 19].map(|y| same_bands(y, 12, 4)), [3, 0, 0, 11, 8, 11]);
        assert_eq!([-1, 2, 3].map(|y| same_bands(y, 2, 2)), [1, 0, 1]);
    }
}
