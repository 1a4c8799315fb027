//! Development: a mosaic's picture at any [`Size`].
//!
//! At the size of the cells, [`Reconstructor`] makes it. At the larger sizes luminance comes from every sample and
//! colour from the cells. The picture is made in luma and chroma, as JPEG stores it, which saves a conversion to red,
//! green and blue and back. One pass makes everything from top to bottom, a row of cells at a time, and keeps only the
//! rows that the next ones need.

mod colour;
mod lanes;
mod levels;
mod luminance;
mod ring;

use super::calibration::Calibration;
use super::frame::{CELL, GrayImage, MosaicFrame, RgbImage};
use super::reconstruct::Reconstructor;
use super::size::Size;
use super::ycc::{YccImage, row_in_rgb};
use colour::Colour;
use levels::Levels;
use luminance::Luminance;
use ring::Ring;

/// Rows of cells whose levels are kept: those that one step reads, and the one that it makes.
const KEPT: usize = 6;
/// How many rows of cells below a row must have been begun before its luminance, and its pixels, can be finished.
const AHEAD_OF_LUMINANCE: usize = 4;
const AHEAD_OF_PIXELS: usize = 5;

/// Develops mosaics by one calibration. Keep one and reuse it: its buffers stay from frame to
/// frame.
#[derive(Debug, Clone)]
pub struct Developer {
    reconstructor: Reconstructor,
    levels: Levels,
    /// Levels of the samples.
    samples: Ring<u16>,
    /// Mean levels of blocks of two by two samples.
    blocks: Ring<u16>,
    /// Mean levels of the cells.
    means: Ring<u16>,
    luminance: Luminance,
    colour: Colour,
}

/// A developed picture in the form in which it was made. JPEG is best encoded from this form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Developed {
    /// A picture of [`Size::Cell`].
    Rgb(RgbImage),
    /// A picture of a larger size.
    Ycc(YccImage),
}

impl Default for Developed {
    fn default() -> Self {
        Self::Rgb(RgbImage::default())
    }
}

impl Developer {
    /// A developer for mosaics of the sensor that `calibration` belongs to. Fits the colour matrix,
    /// which takes some milliseconds.
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

    /// The reconstructor of the same calibration, which makes pictures of one pixel per cell.
    pub const fn reconstructor(&self) -> &Reconstructor {
        &self.reconstructor
    }

    /// Makes the picture of `mosaic` at `size` into `rgb` (sRGB), and the gray picture of its cells
    /// (0..=255) into `gray`; resizes both as needed.
    ///
    /// Gray is the same at every size to within a twentieth of a level, with one exception: at the larger sizes a
    /// sample counts as at most twice as bright as white. References per pixel apply to mosaics of their own size, as
    /// for [`Reconstructor::reconstruct`].
    pub fn develop(&mut self, mosaic: &MosaicFrame, size: Size, rgb: &mut RgbImage, gray: &mut GrayImage) {
        if size == Size::Cell {
            return self.reconstructor.reconstruct(mosaic, rgb, gray);
        }

        let (width, height) = size.of(mosaic);
        rgb.resize(width, height);

        let mut luma = vec![0; width];
        let mut blue = vec![0; width];
        let mut red = vec![0; width];

        let mut rows = self.begin(mosaic, size, 1, gray);
        for pixels in rgb.data.chunks_exact_mut((3 * width).max(1)) {
            rows.next_into(&mut luma, Some([&mut blue, &mut red]));
            row_in_rgb(&luma, [&blue, &red], pixels);
        }
    }

    /// Like [`Self::develop`], but makes a picture of a larger size as JPEG stores it, with one chroma value for two by
    /// two pixels. That takes less time than RGB.
    pub fn develop_for_jpeg(
        &mut self,
        mosaic: &MosaicFrame,
        size: Size,
        picture: &mut Developed,
        gray: &mut GrayImage,
    ) {
        *picture = match (std::mem::take(picture), size) {
            (Developed::Rgb(rgb), Size::Cell) => Developed::Rgb(self.make_rgb(mosaic, rgb, gray)),
            (Developed::Ycc(_), Size::Cell) => Developed::Rgb(self.make_rgb(mosaic, RgbImage::default(), gray)),
            (Developed::Ycc(ycc), _) => Developed::Ycc(self.make_ycc(mosaic, size, ycc, gray)),
            (Developed::Rgb(_), _) => Developed::Ycc(self.make_ycc(mosaic, size, YccImage::default(), gray)),
        };
    }

    /// Makes the gray picture of `mosaic` (0..=255) at `size`: luminance, the mean of all bands.
    pub fn luminance(&mut self, mosaic: &MosaicFrame, size: Size, luminance: &mut GrayImage) {
        if size == Size::Cell {
            self.reconstructor.reconstruct(mosaic, &mut RgbImage::default(), luminance);
            return;
        }

        let (width, height) = size.of(mosaic);
        luminance.resize(width, height);

        self.resize(mosaic, size, 1);
        let mut cells = GrayImage::default();
        cells.resize(mosaic.band_width(), mosaic.band_height());
        let per_cell = size.per_cell();

        for y in 0..mosaic.band_height() + AHEAD_OF_LUMINANCE {
            self.step(mosaic, per_cell, y, &mut cells);
            let Some(done) = y.checked_sub(AHEAD_OF_LUMINANCE) else { continue };
            for row in per_cell * done..per_cell * (done + 1) {
                let values = &mut luminance.data[row * width..][..width];
                for (value, &level) in values.iter_mut().zip(self.luminance.row(row)) {
                    *value = levels::gray(level);
                }
            }
        }
    }

    fn make_rgb(&mut self, mosaic: &MosaicFrame, mut rgb: RgbImage, gray: &mut GrayImage) -> RgbImage {
        self.reconstructor.reconstruct(mosaic, &mut rgb, gray);
        rgb
    }

    fn make_ycc(&mut self, mosaic: &MosaicFrame, size: Size, mut ycc: YccImage, gray: &mut GrayImage) -> YccImage {
        let (width, height) = size.of(mosaic);
        ycc.resize(width, height);
        let [luma, blue, red] = ycc.split_mut();
        let of_chroma = (width / 2).max(1);
        let mut chroma_rows = blue.chunks_exact_mut(of_chroma).zip(red.chunks_exact_mut(of_chroma));

        let mut rows = self.begin(mosaic, size, 2, gray);
        for (y, luma) in luma.chunks_exact_mut(width.max(1)).enumerate() {
            // Chroma of two rows is made with the second one.
            let chroma = if y % 2 == 1 { chroma_rows.next() } else { None };
            rows.next_into(luma, chroma.map(|(blue, red)| [blue, red]));
        }
        ycc
    }

    /// Begins a picture with a chroma value for every `step` pixels along either side.
    fn begin<'a>(&'a mut self, mosaic: &'a MosaicFrame, size: Size, step: usize, gray: &'a mut GrayImage) -> Rows<'a> {
        gray.resize(mosaic.band_width(), mosaic.band_height());
        self.resize(mosaic, size, step);
        Rows { developer: self, mosaic, per_cell: size.per_cell(), gray, begun: 0, done: 0 }
    }

    /// Makes room for `mosaic` at one of the larger sizes.
    fn resize(&mut self, mosaic: &MosaicFrame, size: Size, step: usize) {
        let cells = mosaic.band_width();
        let (width, height) = size.of(mosaic);
        self.levels.resize(mosaic.width());
        self.samples.resize(mosaic.width(), KEPT * CELL);
        self.blocks.resize(mosaic.width() / 2, KEPT * CELL / 2);
        self.means.resize(cells, KEPT);
        self.luminance.resize(size.per_cell(), width, height);
        self.colour.resize(cells, size.per_cell(), step);
    }

    /// Begins the row of cells `y`, and continues the luminance of the rows above it as far as possible. This finishes
    /// the luminance of the row [`AHEAD_OF_LUMINANCE`] above it.
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
        if let Some(row) = above(AHEAD_OF_LUMINANCE) {
            self.luminance.join(row);
        }
    }

    /// Makes the colours of the row of cells whose luminance [`Self::step`] at `y` has finished.
    fn colour_cells(&mut self, mosaic: &MosaicFrame, per_cell: usize, y: usize) {
        let finished = y.checked_sub(AHEAD_OF_LUMINANCE).filter(|&row| row < mosaic.band_height());
        let Some(row) = finished else { return };

        let means = self.means.row(row);
        let encoder = self.reconstructor.encoder();
        self.colour.make_cells(row, per_cell, &self.samples, means, &self.luminance, encoder);
    }
}

/// A picture of a larger size in the making, from top to bottom.
struct Rows<'a> {
    developer: &'a mut Developer,
    mosaic: &'a MosaicFrame,
    per_cell: usize,
    gray: &'a mut GrayImage,
    /// Rows of cells begun.
    begun: usize,
    /// Rows of pixels made.
    done: usize,
}

impl Rows<'_> {
    /// Makes luma of the next row. If `chroma` is given, also makes chroma of all rows since chroma was last made.
    fn next_into(&mut self, luma: &mut [u8], chroma: Option<[&mut [u8]; 2]>) {
        let y = self.done / self.per_cell;
        let row = self.done % self.per_cell;
        self.done += 1;

        while self.begun <= y + AHEAD_OF_PIXELS {
            self.developer.step(self.mosaic, self.per_cell, self.begun, self.gray);
            self.developer.colour_cells(self.mosaic, self.per_cell, self.begun);
            self.begun += 1;
        }

        let Developer { colour, luminance, .. } = &mut *self.developer;
        let place = (y, self.mosaic.band_height());
        colour.make_luma(place, row, self.per_cell, luminance, luma);
        if let Some(chroma) = chroma {
            colour.make_chroma(place, row, self.per_cell, luminance, chroma);
        }
    }
}
