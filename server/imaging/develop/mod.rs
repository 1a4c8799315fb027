//! Development: a mosaic's picture at any [`Size`].
//!
//! At the size of the cells, [`Reconstructor`] makes it. At the larger ones luminance comes from
//! every sample, colour from the cells. Everything is made in one pass from top to bottom, a row of
//! cells at a time, and keeps only the rows that the next ones need.

mod colour;
mod levels;
mod luminance;
mod ring;

use super::calibration::Calibration;
use super::frame::{CELL, GrayImage, MosaicFrame, RgbImage};
use super::reconstruct::Reconstructor;
use super::size::Size;
use colour::Colour;
use levels::Levels;
use luminance::Luminance;
use ring::Ring;

/// Rows of cells of which levels are kept: those that one step reads, and the one that it makes.
const KEPT: usize = 6;
/// Rows of cells that must be begun before one is finished.
const AHEAD: usize = 5;

/// Develops mosaics by one calibration. Keep one and reuse it: its buffers stay from frame to
/// frame.
#[derive(Debug, Clone)]
pub struct Developer {
    reconstructor: Reconstructor,
    levels: Levels,
    /// Levels of the samples.
    samples: Ring<u16>,
    /// Means of blocks of two by two of them.
    blocks: Ring<u16>,
    /// Mean levels of the cells.
    means: Ring<u16>,
    luminance: Luminance,
    colour: Colour,
}

impl Developer {
    /// A developer for mosaics of the sensor that `calibration` belongs to. Fits the colour matrix,
    /// which takes some milliseconds.
    #[must_use]
    pub fn new(calibration: &Calibration) -> Self {
        Self {
            reconstructor: Reconstructor::new(calibration),
            levels: Levels::new(calibration),
            samples: Ring::default(),
            blocks: Ring::default(),
            means: Ring::default(),
            luminance: Luminance::default(),
            colour: Colour::new(calibration),
        }
    }

    /// What makes pictures of one value a cell, by the same calibration.
    #[must_use]
    pub const fn reconstructor(&self) -> &Reconstructor {
        &self.reconstructor
    }

    /// Makes the picture of `mosaic` at `size` into `rgb` (sRGB), and the gray picture of its cells
    /// (0..=255) into `gray`; resizes both as needed.
    ///
    /// Gray is the same at every size, to a twentieth of a level, but that at the larger sizes a
    /// sample counts as at most twice as bright as white. References per pixel apply to mosaics of
    /// their own size, as for [`Reconstructor::reconstruct`].
    pub fn develop(&mut self, mosaic: &MosaicFrame, size: Size, rgb: &mut RgbImage, gray: &mut GrayImage) {
        if size == Size::Cell {
            return self.reconstructor.reconstruct(mosaic, rgb, gray);
        }

        (rgb.width, rgb.height) = size.of(mosaic);
        rgb.data.resize(3 * rgb.width * rgb.height, 0);

        let length = 3 * rgb.width * size.per_cell();
        let mut rows = self.rows(mosaic, size, gray);
        for pixels in rgb.data.chunks_exact_mut(length) {
            rows.next_into(pixels);
        }
    }

    /// Makes the same pictures row by row; see [`Rows`]. `gray` is complete when the last row is
    /// made.
    pub fn rows<'a>(&'a mut self, mosaic: &'a MosaicFrame, size: Size, gray: &'a mut GrayImage) -> Rows<'a> {
        let cells = mosaic.band_width();
        gray.width = cells;
        gray.height = mosaic.band_height();
        gray.data.resize(gray.width * gray.height, 0.0);

        let per_cell = size.per_cell();
        if size != Size::Cell {
            self.resize(mosaic, size);
        }
        Rows { developer: self, mosaic, per_cell, gray, begun: 0, done: 0 }
    }

    /// Makes room for `mosaic` at one of the larger sizes.
    fn resize(&mut self, mosaic: &MosaicFrame, size: Size) {
        let cells = mosaic.band_width();
        let (width, height) = size.of(mosaic);
        self.levels.resize(mosaic.width());
        self.samples.resize(mosaic.width(), KEPT * CELL);
        self.blocks.resize(mosaic.width() / 2, KEPT * CELL / 2);
        self.means.resize(cells, KEPT);
        self.luminance.resize(size.per_cell(), width, height);
        self.colour.resize(cells, size.per_cell());
    }

    /// Begins the row of cells `y`, and moves those above it on, each as far as that allows.
    fn step(&mut self, mosaic: &MosaicFrame, per_cell: usize, y: usize, gray: &mut GrayImage) {
        let rows = mosaic.band_height();
        let above = |by: usize| y.checked_sub(by).filter(|&row| row < rows);

        if y < rows {
            let balance = self.reconstructor.pixel_balance(mosaic);
            self.levels.make(mosaic, balance, y, &mut self.samples, self.means.row_mut(y), gray);
            if per_cell < CELL {
                levels::make_blocks(&self.samples, y, &mut self.blocks);
            }
        }

        let values = if per_cell == CELL { &self.samples } else { &self.blocks };
        if let Some(row) = above(1) {
            self.luminance.make_means(values, row);
        }
        if let Some(row) = above(2) {
            self.luminance.make_detail(values, row);
        }
        if let Some(row) = above(3) {
            self.luminance.part(row);
        }
        if let Some(row) = above(4) {
            self.luminance.join(row);
            let means = self.means.row(row);
            let encoder = self.reconstructor.encoder();
            self.colour.make_cells(row, per_cell, &self.samples, means, &self.luminance, encoder);
        }
    }
}

/// A picture in the making, from top to bottom.
///
/// Each call of [`Rows::next_into`] makes the pixels of one row of cells.
#[derive(Debug)]
pub struct Rows<'a> {
    developer: &'a mut Developer,
    mosaic: &'a MosaicFrame,
    per_cell: usize,
    gray: &'a mut GrayImage,
    /// Rows of cells begun.
    begun: usize,
    /// Rows of cells made.
    done: usize,
}

impl Rows<'_> {
    /// Makes the pixels of the next row of cells into `rgb`: as many rows of the picture as a cell
    /// has at this size, one after another. Returns whether there was such a row of cells.
    /// Allocates nothing.
    pub fn next_into(&mut self, rgb: &mut [u8]) -> bool {
        let y = self.done;
        let cells = self.mosaic.band_height();
        if y >= cells {
            return false;
        }

        self.done += 1;
        if self.per_cell == 1 {
            let cells = self.mosaic.band_width();
            let gray = &mut self.gray.data[y * cells..][..cells];
            self.developer.reconstructor.reconstruct_rows(self.mosaic, y, rgb, gray);
            return true;
        }

        while self.begun <= y + AHEAD {
            self.developer.step(self.mosaic, self.per_cell, self.begun, self.gray);
            self.begun += 1;
        }

        let width = self.per_cell * self.mosaic.band_width();
        for (row, pixels) in rgb.chunks_exact_mut(3 * width).take(self.per_cell).enumerate() {
            let luminance = self.developer.luminance.row(self.per_cell * y + row);
            self.developer.colour.row((y, cells), row, self.per_cell, luminance, pixels);
        }

        true
    }
    /// The gray levels (0..=255) of row `row` of the pixels just made: luminance, the mean of all
    /// bands, at the picture's own size.
    pub fn gray_into(&self, row: usize, gray: &mut [f32]) {
        let Some(y) = self.done.checked_sub(1) else { return };

        if self.per_cell == 1 {
            let width = self.gray.width;
            gray.copy_from_slice(&self.gray.data[y * width..][..width]);
            return;
        }

        let levels = self.developer.luminance.row(self.per_cell * y + row);
        for (gray, &level) in gray.iter_mut().zip(levels) {
            *gray = levels::gray(level);
        }
    }
}
