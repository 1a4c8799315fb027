//! Checks pictures made from mosaics against closed forms.

use super::*;
use crate::{Reference, Scale, block_means};

fn mosaic(width: usize, height: usize, sample: impl Fn(usize, usize) -> u16) -> MosaicFrame {
    let samples = (0..width * height).map(|i| sample(i % width, i / width)).collect();
    MosaicFrame::new(width, height, samples).unwrap()
}

/// Uneven samples, all bands different, between 100 and 900.
fn texture(x: usize, y: usize) -> u16 {
    100 + ((x * 37 + y * 101 + x * y / 3) % 800) as u16
}

fn pictures(calibration: &Calibration, mosaic: &MosaicFrame) -> (RgbImage, GrayImage) {
    let mut rgb = RgbImage::default();
    let mut gray = GrayImage::default();
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
        let left = 4 * (index % 11);
        let top = 4 * (index / 11);
        let sum: u32 = (0..16).map(|band| u32::from(texture(left + band % 4, top + band / 4))).sum();
        let expected = 255.0 * f64::from(sum) / 16.0 / 1023.0;

        // Weights are whole numbers: rounding one changes it by at most 1/2000 of a sixteenth of the mean.
        assert!((f64::from(*found) - expected).abs() < 0.02, "{found} {expected}");
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

    let (rgb, gray) = pictures(&halved, &seen);
    let (plain, _) = pictures(&dimmed, &seen);

    assert!(rgb.data.iter().zip(&plain.data).all(|(one, other)| one.abs_diff(*other) <= 1));
    assert_eq!(gray, pictures(&Calibration::default(), &seen).1);
}

#[test]
fn references_per_pixel_correct_each_pixel() {
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
fn equal_references_make_equal_pictures() {
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
        assert!(found.1.data.iter().zip(&expected.1.data).all(|(one, other)| (one - other).abs() < 0.02));
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
                let column = x + index % 32;
                let row = y + index / 32;
                let inside = column < 42 && row < 37;
                let expected = if inside { gray.data[row * 42 + column] } else { 0.0 };
                assert!((found - expected).abs() < 0.02, "({column}, {row}): {found} {expected}");
            }
        }
    }
}

#[test]
fn wider_patches_are_means_of_the_gray_picture() {
    let seen = mosaic(640, 560, texture);
    let flat = |count: u16| Reference::PerPixel(mosaic(640, 560, |_, _| count));
    for calibration in [Calibration::default(), calibration(flat(40), flat(900))] {
        let (_, gray) = pictures(&calibration, &seen);
        let reconstructor = Reconstructor::new(&calibration);
        let area = PatchArea { x: 70, y: 40, width: 32, height: 32 };
        let view = reconstructor.gray_view(&seen, area);
        assert_eq!(view.patch, reconstructor.gray_patch(&seen, area));

        // The widest patch would begin 8 cells above the picture, so it is moved down.
        for (patch, (scale, left, top)) in view.wider.into_iter().zip([(Scale::Two, 54, 24), (Scale::Four, 22, 0)]) {
            let expected = block_means(&gray.data[top * 160 + left..], 160, scale);
            let pairs = patch.as_ref().unwrap().0.iter().zip(&expected.0);
            assert!(pairs.into_iter().all(|(one, other)| (one - other).abs() < 0.02), "scale {scale:?}");
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

#[test]
fn integers_agree_with_single_precision() {
    let by_band = |dark: f32, white: f32| {
        let uneven = |value: f32| std::array::from_fn(|band| value * (1.0 + 0.05 * (band as f32 * 1.7).sin()));
        calibration(Reference::PerBand(uneven(dark)), Reference::PerBand(uneven(white)))
    };

    // 10-bit counts, and counts over all of 16 bits.
    for (calibration, scale) in [(by_band(40.0, 900.0), 1), (by_band(2000.0, 60_000.0), 64)] {
        let seen = mosaic(172, 40, |x, y| scale * texture(x, y));

        let mut plain = Reconstructor::new(&calibration);
        plain.of_counts.kernel = None;
        let mut rgb = RgbImage::default();
        let mut gray = GrayImage::default();
        plain.reconstruct(&seen, &mut rgb, &mut gray);

        let found = pictures(&calibration, &seen);
        assert!(found.0.data.iter().zip(&rgb.data).all(|(one, other)| one.abs_diff(*other) <= 1));
        assert!(found.1.data.iter().zip(&gray.data).all(|(one, other)| (one - other).abs() < 0.02));
    }
}
