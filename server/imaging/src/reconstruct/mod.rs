//! From a mosaic to pictures: RGB for people, gray for the content area, and the gray patch for
//! policies.

mod avx2;
pub(super) mod balance;
mod mix;
#[cfg(test)]
mod tests;

use std::sync::{Arc, LazyLock};

use multiversion::multiversion;

use super::calibration::{BANDS, Calibration};
use super::colour::Encoder;
use super::frame::{CELL, GrayImage, MosaicFrame, RgbImage};
use super::geometry::{PATCH_SIDE, Patch, PatchArea};
use super::view::{Square, View};
use avx2::Kernel;
use balance::PixelBalance;
use mix::Mix;

/// Makes pictures of one pixel per mosaic cell, by one calibration. Keep one and reuse it.
///
/// Colour is made from the spectrally corrected bands. Gray is the mean of the white-balanced bands before that
/// correction. The correction subtracts bands from one another, which would add noise to the focus metrics.
#[derive(Debug, Clone)]
pub struct Reconstructor {
    of_counts: Mixes,
    /// For references per pixel: the balance, and the mixes for the balanced samples. The balance is large, so clones
    /// share it.
    of_balanced: Option<(Arc<PixelBalance>, Mixes)>,
    encoder: Encoder,
    lines: Lines,
}

/// The weighted sums over the 16 samples of a cell.
#[derive(Debug, Clone)]
pub(super) struct Mixes {
    /// Red, green and blue, each as an index of an [`Encoder`], and gray.
    picture: Mix<4>,
    /// The same in integers, if the processor has AVX2 and FMA.
    kernel: Option<Kernel>,
    /// Gray alone.
    gray: Mix<1>,
}

impl Mixes {
    /// Weighted sums. `weights` are for samples scaled to 0 for dark and 1 for white. The samples given later are
    /// unscaled: they are `dark` for dark and `white` for white.
    pub(super) fn new(weights: [[f32; BANDS]; 4], dark: &[f32; BANDS], white: &[f32; BANDS]) -> Self {
        let picture = Mix::new(weights, dark, white);
        Self { kernel: Kernel::new(&picture), picture, gray: Mix::new([weights[3]], dark, white) }
    }
}

/// Working memory for one row of cells.
#[derive(Debug, Clone, Default)]
struct Lines {
    /// Four rows of white-balanced samples.
    balanced: Vec<u16>,
    /// One row of each colour.
    colours: [Vec<f32>; 3],
}

impl Default for Reconstructor {
    /// The reconstructor of the default calibration. Its colour matrix is fitted only once, because reading pictures
    /// from files asks for this reconstructor again and again.
    fn default() -> Self {
        static FITTED: LazyLock<Reconstructor> = LazyLock::new(|| Reconstructor::new(&Calibration::default()));
        FITTED.clone()
    }
}

impl Reconstructor {
    /// A reconstructor for mosaics of the sensor that `calibration` belongs to. Fits the colour matrix,
    /// which takes some milliseconds.
    pub fn new(calibration: &Calibration) -> Self {
        let weights = weights(calibration);
        let mixes = |dark, white| Mixes::new(weights, dark, white);
        let balanced = |balance| (Arc::new(balance), mixes(&[balance::DARK; BANDS], &[balance::WHITE; BANDS]));

        Self {
            of_counts: mixes(&calibration.dark.band_means(), &calibration.white.band_means()),
            of_balanced: PixelBalance::new(calibration).map(balanced),
            encoder: Encoder::new(),
            lines: Lines::default(),
        }
    }

    /// Makes `rgb` (sRGB) and `gray` (0..=255) from `mosaic`, one pixel per cell; resizes both as needed.
    ///
    /// References per pixel apply to mosaics of their own size (see [`Calibration::fits`]); for a
    /// mosaic of another size the means of their bands are used.
    pub fn reconstruct(&mut self, mosaic: &MosaicFrame, rgb: &mut RgbImage, gray: &mut GrayImage) {
        let width = mosaic.band_width();
        rgb.resize(width, mosaic.band_height());
        gray.resize(width, mosaic.band_height());
        let (rgb, gray) = (&mut *rgb.data, &mut *gray.data);

        let lines = &mut self.lines;
        lines.colours.iter_mut().for_each(|line| line.resize(width, 0.0));
        match self.of_balanced.as_ref().filter(|(balance, _)| balance.fits(mosaic)) {
            None => rows_of_counts(&self.of_counts, mosaic, &self.encoder, lines, rgb, gray),
            Some(of_balanced) => {
                lines.balanced.resize(CELL * mosaic.width(), 0);
                rows_of_balanced(of_balanced, mosaic, &self.encoder, lines, rgb, gray);
            }
        }
    }

    /// The balance by references per pixel, if there are any and they have the size of `mosaic`.
    pub(super) fn pixel_balance(&self, mosaic: &MosaicFrame) -> Option<&PixelBalance> {
        self.of_balanced.as_ref().map(|(balance, _)| balance.as_ref()).filter(|balance| balance.fits(mosaic))
    }

    /// The table that encodes linear colours as sRGB.
    pub(super) const fn encoder(&self) -> &Encoder {
        &self.encoder
    }

    /// The patch of the gray picture at `area` (in cells), computing just those cells; black where
    /// `area` leaves the picture.
    pub fn gray_patch(&self, mosaic: &MosaicFrame, area: PatchArea) -> Patch {
        let mut patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        self.fill_gray(mosaic, Square { x: area.x, y: area.y, side: PATCH_SIDE }, &mut patch.0);
        patch
    }

    /// The policies' view of the gray picture with the patch at `area` (in cells), computing just those
    /// cells.
    pub fn gray_view(&self, mosaic: &MosaicFrame, area: PatchArea) -> View {
        let size = (mosaic.band_width(), mosaic.band_height());
        View::around(self.gray_patch(mosaic, area), (area.x, area.y), size, |square| self.gray_square(mosaic, square))
    }

    /// The gray picture within `square` (in cells), row after row; black where the square leaves the picture.
    pub fn gray_square(&self, mosaic: &MosaicFrame, square: Square) -> Vec<f32> {
        let mut gray = vec![0.0; square.side * square.side];
        self.fill_gray(mosaic, square, &mut gray);
        gray
    }

    /// Fills `gray` with the gray picture within `square` (in cells), row after row; leaves values
    /// outside the picture as they are.
    fn fill_gray(&self, mosaic: &MosaicFrame, square: Square, gray: &mut [f32]) {
        if square.x >= mosaic.band_width() {
            return;
        }

        match self.of_balanced.as_ref().filter(|(balance, _)| balance.fits(mosaic)) {
            None => square_of_counts(&self.of_counts, mosaic, square, gray),
            Some((balance, mixes)) => square_of_balanced(balance, mixes, mosaic, square, gray),
        }
    }
}

/// The weights of [`Mixes::picture`] for white-balanced samples.
pub(super) fn weights(calibration: &Calibration) -> [[f32; BANDS]; 4] {
    let scaled = |colour: [f32; BANDS]| colour.map(|weight| Encoder::SCALE * weight);
    let [red, green, blue] = calibration.linear_srgb().map(scaled);
    [red, green, blue, [255.0 / 16.0; BANDS]]
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn rows_of_counts(
    mixes: &Mixes,
    mosaic: &MosaicFrame,
    encoder: &Encoder,
    lines: &mut Lines,
    rgb: &mut [u8],
    gray: &mut [f32],
) {
    let width = mosaic.band_width();
    let rows = rgb.chunks_exact_mut(3 * width).zip(gray.chunks_exact_mut(width));
    for (y, (rgb, gray)) in rows.enumerate() {
        picture_row(mixes, cell_row(mosaic, 0, y, width), encoder, &mut lines.colours, rgb, gray);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn rows_of_balanced(
    (balance, mixes): &(Arc<PixelBalance>, Mixes),
    mosaic: &MosaicFrame,
    encoder: &Encoder,
    lines: &mut Lines,
    rgb: &mut [u8],
    gray: &mut [f32],
) {
    let width = mosaic.band_width();
    let rows = rgb.chunks_exact_mut(3 * width).zip(gray.chunks_exact_mut(width));
    for (y, (rgb, gray)) in rows.enumerate() {
        balance.apply(cell_row(mosaic, 0, y, width), 0, y, &mut lines.balanced);
        picture_row(mixes, quarters(&lines.balanced), encoder, &mut lines.colours, rgb, gray);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn square_of_counts(mixes: &Mixes, mosaic: &MosaicFrame, square: Square, gray: &mut [f32]) {
    let cells = square.side.min(mosaic.band_width() - square.x);

    for (y, gray) in (square.y..mosaic.band_height()).zip(gray.chunks_exact_mut(square.side)) {
        let gray = &mut gray[..cells];
        mixes.gray.apply(cell_row(mosaic, square.x, y, cells), [gray]);
        clamp_gray(gray);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn square_of_balanced(balance: &PixelBalance, mixes: &Mixes, mosaic: &MosaicFrame, square: Square, gray: &mut [f32]) {
    let cells = square.side.min(mosaic.band_width() - square.x);
    let mut balanced = vec![0; CELL * CELL * cells];

    for (y, gray) in (square.y..mosaic.band_height()).zip(gray.chunks_exact_mut(square.side)) {
        let gray = &mut gray[..cells];
        balance.apply(cell_row(mosaic, square.x, y, cells), CELL * square.x, y, &mut balanced);
        mixes.gray.apply(quarters(&balanced), [gray]);
        clamp_gray(gray);
    }
}

/// The four rows of samples of `cells` cells from cell (`x`, `y`) on.
fn cell_row(mosaic: &MosaicFrame, x: usize, y: usize, cells: usize) -> [&[u16]; CELL] {
    std::array::from_fn(|row| &mosaic.samples()[(CELL * y + row) * mosaic.width()..][CELL * x..][..CELL * cells])
}

pub(super) fn quarters(values: &[u16]) -> [&[u16]; CELL] {
    let length = values.len() / CELL;
    std::array::from_fn(|row| &values[row * length..][..length])
}

/// Makes one row of pixels and of gray values from four rows of samples: whole vectors in integers, the rest in
/// floating point.
#[inline(always)]
pub(super) fn picture_row(
    mixes: &Mixes,
    rows: [&[u16]; CELL],
    encoder: &Encoder,
    colours: &mut [Vec<f32>; 3],
    rgb: &mut [u8],
    gray: &mut [f32],
) {
    let mut done = 0;
    if let Some(kernel) = &mixes.kernel {
        let (gray, _) = gray.as_chunks_mut();
        kernel.row(encoder, rows.map(|row| row.as_chunks().0), rgb.as_chunks_mut().0, gray);
        done = avx2::CELLS * gray.len();
    }
    if done == gray.len() {
        return;
    }

    let rgb = &mut rgb[3 * done..];
    let gray = &mut gray[done..];
    let [red, green, blue] = colours.each_mut().map(|line| &mut line[done..]);
    mixes.picture.apply(rows.map(|row| &row[CELL * done..]), [red, green, blue, gray]);

    let pixels = rgb.as_chunks_mut::<3>().0;
    for (((pixel, &mut red), &mut green), &mut blue) in pixels.iter_mut().zip(red).zip(green).zip(blue) {
        *pixel = [red, green, blue].map(|colour| encoder.at(Encoder::index(colour)));
    }

    clamp_gray(gray);
}

#[inline(always)]
fn clamp_gray(gray: &mut [f32]) {
    for value in gray {
        *value = value.clamp(0.0, 255.0);
    }
}
