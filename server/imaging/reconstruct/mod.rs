//! From a mosaic to pictures: RGB for people, gray for the content area, and the gray patch for policies.

mod balance;
mod mix;

use multiversion::multiversion;

use super::calibration::{BANDS, Calibration};
use super::colour::{Encoder, linear_srgb_from_bands};
use super::frame::{CELL, GrayImage, MosaicFrame, RgbImage};
use super::geometry::{PATCH_SIDE, Patch, PatchArea};
use balance::PixelBalance;
use mix::Mix;

/// Makes pictures of one value a mosaic cell from mosaics, by one calibration. Keep one and reuse it.
///
/// Colour is made from the spectrally corrected bands. Gray is the mean of the white-balanced bands before that
/// correction, which subtracts bands from one another and so would add noise to the focus metrics.
#[derive(Debug, Clone)]
pub struct Reconstructor {
    of_counts: Mixes,
    /// Where references are per pixel: the balance, and what is then mixed of balanced samples.
    of_balanced: Option<(PixelBalance, Mixes)>,
    encoder: Encoder,
    lines: Lines,
}

/// What is made of the 16 samples of a cell.
#[derive(Debug, Clone)]
struct Mixes {
    /// Red, green and blue, each as an index of an [`Encoder`], and gray.
    picture: Mix<4>,
    /// Gray alone.
    gray: Mix<1>,
}

/// Memory for one row of cells on its way.
#[derive(Debug, Clone, Default)]
struct Lines {
    /// Four rows of white-balanced samples.
    balanced: Vec<f32>,
    /// One row of each colour.
    colours: [Vec<f32>; 3],
}

impl Reconstructor {
    /// A reconstructor for mosaics of the sensor that `calibration` belongs to. Fits the colour matrix, which takes some
    /// milliseconds.
    #[must_use]
    pub fn new(calibration: &Calibration) -> Self {
        let weights = weights(calibration);
        let (dark, white) = (calibration.dark.band_means(), calibration.white.band_means());
        let balanced = Mixes { picture: Mix::new(weights), gray: Mix::new([weights[3]]) };
        Self {
            of_counts: Mixes {
                picture: balanced.picture.of_counts(&dark, &white),
                gray: balanced.gray.of_counts(&dark, &white),
            },
            of_balanced: PixelBalance::new(calibration).map(|balance| (balance, balanced)),
            encoder: Encoder::new(),
            lines: Lines::default(),
        }
    }

    /// Makes `rgb` (sRGB) and `gray` (0..=255) from `mosaic`, one pixel a cell; both are resized as needed.
    ///
    /// References per pixel hold for mosaics of their own size (see [`Calibration::fits`]); one of another size is made
    /// with the means of their bands.
    pub fn reconstruct(&mut self, mosaic: &MosaicFrame, rgb: &mut RgbImage, gray: &mut GrayImage) {
        let (width, height) = (mosaic.band_width(), mosaic.band_height());
        (rgb.width, rgb.height, gray.width, gray.height) = (width, height, width, height);
        rgb.data.resize(3 * width * height, 0);
        gray.data.resize(width * height, 0.0);
        self.lines.colours.iter_mut().for_each(|line| line.resize(width, 0.0));
        match self.of_balanced.as_ref().filter(|(balance, _)| balance.fits(mosaic)) {
            None => picture_of_counts(&self.of_counts, mosaic, &self.encoder, &mut self.lines, rgb, gray),
            Some((balance, mixes)) => {
                self.lines.balanced.resize(CELL * mosaic.width(), 0.0);
                picture_of_balanced(balance, mixes, mosaic, &self.encoder, &mut self.lines, rgb, gray);
            }
        }
    }

    /// The patch of the gray picture at `area` (in cells), computing just those cells; black where `area` leaves the
    /// picture.
    #[must_use]
    pub fn gray_patch(&self, mosaic: &MosaicFrame, area: PatchArea) -> Patch {
        let mut patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        if area.x >= mosaic.band_width() {
            return patch;
        }
        match self.of_balanced.as_ref().filter(|(balance, _)| balance.fits(mosaic)) {
            None => patch_of_counts(&self.of_counts, mosaic, area, &mut patch),
            Some((balance, mixes)) => patch_of_balanced(balance, mixes, mosaic, area, &mut patch),
        }
        patch
    }
}

/// The weights of [`Mixes::picture`] for white-balanced samples.
fn weights(calibration: &Calibration) -> [[f32; BANDS]; 4] {
    let corrected = |colour: [f32; BANDS]| {
        std::array::from_fn(|band| {
            let through = calibration.correction.iter().zip(colour).map(|(from, weight)| weight * from[band]);
            Encoder::SCALE * through.sum::<f32>()
        })
    };
    let [red, green, blue] = linear_srgb_from_bands(&calibration.bands).map(corrected);
    [red, green, blue, [255.0 / 16.0; BANDS]]
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn picture_of_counts(
    mixes: &Mixes,
    mosaic: &MosaicFrame,
    encoder: &Encoder,
    lines: &mut Lines,
    rgb: &mut RgbImage,
    gray: &mut GrayImage,
) {
    let width = mosaic.band_width();
    let rows = rgb.data.chunks_exact_mut(3 * width).zip(gray.data.chunks_exact_mut(width));
    for (y, (rgb, gray)) in rows.enumerate() {
        let [red, green, blue] = &mut lines.colours;
        mixes.picture.apply(cell_row(mosaic, 0, y, width), [red, green, blue, gray]);
        finish(&lines.colours, encoder, rgb, gray);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn picture_of_balanced(
    balance: &PixelBalance,
    mixes: &Mixes,
    mosaic: &MosaicFrame,
    encoder: &Encoder,
    lines: &mut Lines,
    rgb: &mut RgbImage,
    gray: &mut GrayImage,
) {
    let width = mosaic.band_width();
    let rows = rgb.data.chunks_exact_mut(3 * width).zip(gray.data.chunks_exact_mut(width));
    for (y, (rgb, gray)) in rows.enumerate() {
        balance.apply(cell_row(mosaic, 0, y, width), 0, y, &mut lines.balanced);
        let [red, green, blue] = &mut lines.colours;
        mixes.picture.apply(quarters(&lines.balanced), [red, green, blue, gray]);
        finish(&lines.colours, encoder, rgb, gray);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn patch_of_counts(mixes: &Mixes, mosaic: &MosaicFrame, area: PatchArea, patch: &mut Patch) {
    let cells = PATCH_SIDE.min(mosaic.band_width() - area.x);
    for (y, gray) in (area.y..mosaic.band_height()).zip(patch.0.chunks_exact_mut(PATCH_SIDE)) {
        let gray = &mut gray[..cells];
        mixes.gray.apply(cell_row(mosaic, area.x, y, cells), [gray]);
        clamp_gray(gray);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn patch_of_balanced(balance: &PixelBalance, mixes: &Mixes, mosaic: &MosaicFrame, area: PatchArea, patch: &mut Patch) {
    let cells = PATCH_SIDE.min(mosaic.band_width() - area.x);
    let mut balanced = [0.0; CELL * CELL * PATCH_SIDE];
    let balanced = &mut balanced[..CELL * CELL * cells];
    for (y, gray) in (area.y..mosaic.band_height()).zip(patch.0.chunks_exact_mut(PATCH_SIDE)) {
        let gray = &mut gray[..cells];
        balance.apply(cell_row(mosaic, area.x, y, cells), CELL * area.x, y, balanced);
        mixes.gray.apply(quarters(balanced), [gray]);
        clamp_gray(gray);
    }
}

/// The four rows of samples of `cells` cells from cell (`x`, `y`) on.
fn cell_row(mosaic: &MosaicFrame, x: usize, y: usize, cells: usize) -> [&[u16]; CELL] {
    std::array::from_fn(|row| &mosaic.samples()[(CELL * y + row) * mosaic.width()..][CELL * x..][..CELL * cells])
}

fn quarters(values: &[f32]) -> [&[f32]; CELL] {
    let length = values.len() / CELL;
    std::array::from_fn(|row| &values[row * length..][..length])
}

/// Encodes a row of colours and brings a row of gray into range.
#[inline(always)]
#[allow(clippy::inline_always, reason = "it takes on the instruction set of the function that it is called from")]
fn finish(colours: &[Vec<f32>; 3], encoder: &Encoder, rgb: &mut [u8], gray: &mut [f32]) {
    let [red, green, blue] = colours;
    let pixels = rgb.as_chunks_mut::<3>().0;
    for (((pixel, &red), &green), &blue) in pixels.iter_mut().zip(red).zip(green).zip(blue) {
        *pixel = [red, green, blue].map(|colour| encoder.at(colour));
    }
    clamp_gray(gray);
}

#[inline(always)]
#[allow(clippy::inline_always, reason = "it takes on the instruction set of the function that it is called from")]
fn clamp_gray(gray: &mut [f32]) {
    for value in gray {
        *value = value.clamp(0.0, 255.0);
    }
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "test pictures"
)]
mod tests {
    use super::*;
    use crate::imaging::Reference;

    fn mosaic(width: usize, height: usize, sample: impl Fn(usize, usize) -> u16) -> MosaicFrame {
        let samples = (0..width * height).map(|i| sample(i % width, i / width)).collect();
        MosaicFrame::new(width, height, samples).unwrap()
    }

    /// Uneven samples, all bands different, between 100 and 900.
    fn texture(x: usize, y: usize) -> u16 {
        100 + ((x * 37 + y * 101 + x * y / 3) % 800) as u16
    }

    fn pictures(calibration: &Calibration, mosaic: &MosaicFrame) -> (RgbImage, GrayImage) {
        let (mut rgb, mut gray) = (RgbImage::default(), GrayImage::default());
        Reconstructor::new(calibration).reconstruct(mosaic, &mut rgb, &mut gray);
        (rgb, gray)
    }

    fn calibration(dark: Reference, white: Reference) -> Calibration {
        Calibration { dark, white, ..Calibration::default() }
    }

    #[test]
    fn a_white_target_is_white_and_a_dark_one_black() {
        let dark: [f32; BANDS] = std::array::from_fn(|band| 20.0 + band as f32);
        let white: [f32; BANDS] = std::array::from_fn(|band| 500.0 + 30.0 * band as f32);
        let calibration = calibration(Reference::PerBand(dark), Reference::PerBand(white));
        // At half of white every component is 188, the sRGB encoding of 0.5.
        for (share, encoded) in [(0.0, 0), (0.5, 188), (1.0, 255)] {
            let seen = mosaic(72, 40, |x, y| {
                let band = 4 * (y % 4) + x % 4;
                (dark[band] + share * (white[band] - dark[band])).round() as u16
            });
            let (rgb, gray) = pictures(&calibration, &seen);
            assert_eq!((rgb.width, rgb.height, gray.width, gray.height), (18, 10, 18, 10));
            assert!(rgb.data.iter().all(|value| value.abs_diff(encoded) <= 1), "{:?}", &rgb.data[..6]);
            assert!(gray.data.iter().all(|value| (value - 255.0 * share).abs() < 0.1), "{}", gray.data[0]);
        }
    }

    #[test]
    fn gray_is_the_mean_of_the_bands() {
        let seen = mosaic(44, 12, texture);
        let (_, gray) = pictures(&Calibration::default(), &seen);
        for (index, found) in gray.data.iter().enumerate() {
            let (left, top) = (4 * (index % 11), 4 * (index / 11));
            let sum: u32 = (0..16).map(|band| u32::from(texture(left + band % 4, top + band / 4))).sum();
            let expected = 255.0 * f64::from(sum) / 16.0 / 1023.0;
            assert!((f64::from(*found) - expected).abs() < 1e-3, "{found} {expected}");
        }
    }

    #[test]
    fn neighbouring_lit_bands_have_the_hue_of_their_wavelengths() {
        // Rows of the cell from the last: 460 to 485 nm, 496 to 524 nm, 532 to 560 nm, 570 to 595 nm.
        let lit = |row: usize| {
            let seen = mosaic(64, 64, |_, y| if y % 4 == row { 900 } else { 30 });
            let pixel = &pictures(&Calibration::default(), &seen).0.data[..3];
            (i32::from(pixel[0]), i32::from(pixel[1]), i32::from(pixel[2]))
        };
        let (red, green, blue) = lit(3);
        assert!(blue > red + 60 && blue > green + 60, "blue: {red} {green} {blue}");
        let (red, green, blue) = lit(2);
        assert!(green > red + 60 && green > blue, "blue-green: {red} {green} {blue}");
        let (red, green, blue) = lit(1);
        assert!(green > red + 60 && green > blue + 60, "green: {red} {green} {blue}");
        let (red, green, blue) = lit(0);
        assert!(red > green + 60 && red > blue + 60, "red: {red} {green} {blue}");
    }

    #[test]
    fn the_correction_is_done_before_the_colours_and_not_for_gray() {
        let seen = mosaic(64, 32, texture);
        let mut halved = Calibration::default();
        halved.correction.iter_mut().flatten().for_each(|weight| *weight *= 0.5);
        let dimmed = calibration(Reference::PerBand([0.0; BANDS]), Reference::PerBand([2046.0; BANDS]));
        let ((rgb, gray), (plain, _)) = (pictures(&halved, &seen), pictures(&dimmed, &seen));
        assert!(rgb.data.iter().zip(&plain.data).all(|(one, other)| one.abs_diff(*other) <= 1));
        assert_eq!(gray, pictures(&Calibration::default(), &seen).1);
    }

    #[test]
    fn references_per_pixel_undo_what_each_pixel_does() {
        let (width, height) = (160, 136);
        let dark = mosaic(width, height, |x, y| 30 + (x % 5 + y % 3) as u16);
        let white = mosaic(width, height, |x, y| 700 + ((x * 13 + y * 7) % 200) as u16);
        let half = mosaic(width, height, |x, y| {
            let index = y * width + x;
            u16::midpoint(dark.samples()[index], white.samples()[index])
        });
        let calibration = calibration(Reference::PerPixel(dark), Reference::PerPixel(white));
        let (rgb, gray) = pictures(&calibration, &half);
        assert!(gray.data.iter().all(|value| (value - 127.5).abs() < 0.3), "{}", gray.data[0]);
        assert!(rgb.data.iter().all(|value| value.abs_diff(188) <= 1));
    }

    #[test]
    fn references_that_say_the_same_make_the_same() {
        let seen = mosaic(160, 136, texture);
        let by_band = calibration(Reference::PerBand([40.0; BANDS]), Reference::PerBand([900.0; BANDS]));
        let flat = |count: u16| Reference::PerPixel(mosaic(160, 136, |_, _| count));
        let expected = pictures(&by_band, &seen);
        for by_pixel in [
            calibration(flat(40), flat(900)),
            calibration(flat(40), Reference::PerBand([900.0; BANDS])),
            calibration(Reference::PerPixel(mosaic(8, 8, |_, _| 40)), flat(900)),
        ] {
            let found = pictures(&by_pixel, &seen);
            assert!(found.1.data.iter().zip(&expected.1.data).all(|(one, other)| (one - other).abs() < 1e-3));
            assert!(found.0.data.iter().zip(&expected.0.data).all(|(one, other)| one.abs_diff(*other) <= 1));
        }
    }

    #[test]
    fn the_patch_is_cut_from_the_gray_picture() {
        let seen = mosaic(168, 148, texture);
        let flat = |count: u16| Reference::PerPixel(mosaic(168, 148, |_, _| count));
        for calibration in [Calibration::default(), calibration(flat(40), flat(900))] {
            let (_, gray) = pictures(&calibration, &seen);
            let reconstructor = Reconstructor::new(&calibration);
            for (x, y) in [(0, 0), (5, 3), (10, 5), (30, 20), (42, 0), (99, 0), (0, 99)] {
                let patch = reconstructor.gray_patch(&seen, PatchArea { x, y, width: 32, height: 32 });
                for (index, found) in patch.0.iter().enumerate() {
                    let (column, row) = (x + index % 32, y + index / 32);
                    let inside = column < 42 && row < 37;
                    let expected = if inside { gray.data[row * 42 + column] } else { 0.0 };
                    assert!((found - expected).abs() < 1e-3, "({column}, {row}): {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn counts_beyond_black_and_white_are_cut() {
        let calibration = calibration(Reference::PerBand([100.0; BANDS]), Reference::PerBand([500.0; BANDS]));
        for (count, expected) in [(0, 0), (u16::MAX, 255)] {
            let (rgb, gray) = pictures(&calibration, &mosaic(32, 32, |_, _| count));
            assert!(rgb.data.iter().all(|value| *value == expected));
            assert!(gray.data.iter().all(|value| (value - f32::from(expected)).abs() < f32::EPSILON));
        }
    }
}
