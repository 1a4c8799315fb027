//! The latest rows of a picture, each with a margin on either side.

/// Values beside a row, on either side, that filters may read.
pub(super) const MARGIN: usize = 16;

/// The latest rows of a picture that is made from top to bottom.
#[derive(Debug, Clone, Default)]
pub(super) struct Ring<T> {
    values: Vec<T>,
    width: usize,
    rows: usize,
}

impl<T: Copy + Default> Ring<T> {
    /// Makes room for `rows` rows of `width` values; keeps its memory where it is large enough.
    pub(super) fn resize(&mut self, width: usize, rows: usize) {
        self.width = width;
        self.rows = rows;
        self.values.resize((width + 2 * MARGIN) * rows, T::default());
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

    /// Row `y` with its margins.
    pub(super) fn padded(&self, y: usize) -> &[T] {
        let length = self.width + 2 * MARGIN;
        &self.values[y % self.rows * length..][..length]
    }

    fn padded_mut(&mut self, y: usize) -> &mut [T] {
        let length = self.width + 2 * MARGIN;
        &mut self.values[y % self.rows * length..][..length]
    }

    /// Fills the margins of row `y` with the row's first and last `period` values, over and over.
    ///
    /// With the side of a mosaic cell as its period, a place in the margin gets a value of the band
    /// that would be there.
    pub(super) fn fill_margins(&mut self, y: usize, period: usize) {
        let width = self.width;
        let row = self.padded_mut(y);
        for place in 0..MARGIN {
            row[place] = row[MARGIN + place % period];
            row[MARGIN + width + place] = row[MARGIN + width - period + place % period];
        }
    }
}

/// The row `y` of `rows`, or beyond the first and the last one the nearest that holds the same bands,
/// where `cell` rows are a row of cells.
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
