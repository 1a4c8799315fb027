//! Development at half and full size: how close the picture is to scenes that are known exactly. It must neither invent
//! patterns nor depend on earlier frames.

mod measures;
mod scenes;

use measures::{amplitude_kept, ciede2000, lab, psnr, quantile};
use parfocal_imaging::{
    BANDS, CELL, Calibration, Developer, GrayImage, MosaicFrame, Reconstructor, Reference, RgbImage, Size,
};
use scenes::{SIDE, Scene};

/// Cells along each side of a scene.
const CELLS: usize = SIDE / CELL;

fn developed(mosaic: &MosaicFrame, size: Size) -> (RgbImage, GrayImage) {
    developed_by(&mut Developer::new(&Calibration::default()), mosaic, size)
}

fn developed_by(developer: &mut Developer, mosaic: &MosaicFrame, size: Size) -> (RgbImage, GrayImage) {
    let mut rgb = RgbImage::default();
    let mut gray = GrayImage::default();
    developer.develop(mosaic, size, &mut rgb, &mut gray);
    (rgb, gray)
}

/// The luminance of each pixel, 0 to 1.
fn luminance(mosaic: &MosaicFrame, size: Size) -> Vec<f32> {
    let mut gray = GrayImage::default();
    Developer::new(&Calibration::default()).luminance(mosaic, size, &mut gray);
    assert_eq!((gray.width, gray.height), size.of(mosaic));
    gray.data.iter().map(|value| value / 255.0).collect()
}

/// `picture`, with one value per cell, enlarged `scale` times by cubic interpolation (Catmull and Rom).
fn enlarged(picture: &[f32], scale: usize) -> Vec<f32> {
    let side = scale * CELLS;
    let weights = |index: usize| {
        let place = (index as f32 + 0.5) / scale as f32 - 0.5;
        let part = place - place.floor();
        let weights = [
            ((2.0 - part) * part - 1.0) * part / 2.0,
            1.0 + (1.5 * part - 2.5) * part * part,
            ((4.0 - 3.0 * part) * part + 1.0) * part / 2.0,
            (part - 1.0) * part * part / 2.0,
        ];
        [0, 1, 2, 3].map(|tap| {
            let cell = (place.floor() as isize + tap - 1).clamp(0, CELLS as isize - 1);
            (cell as usize, weights[tap as usize])
        })
    };

    let value = |index: usize| {
        let across = weights(index % side);
        let row = |y: usize| across.iter().map(|&(x, weight)| weight * picture[y * CELLS + x]).sum::<f32>();
        weights(index / side).iter().map(|&(y, weight)| weight * row(y)).sum()
    };
    (0..side * side).map(value).collect()
}

/// How luminance at full size compares with the truth: dB above the enlarged cell picture, and the share of amplitude
/// kept at 0.12 to 0.2 and at 0.2 to 0.35 cycles per sample.
fn luminance_quality(name: &str, scene: &Scene, seed: u64) -> [f64; 3] {
    let truth = scene.mean();
    let mosaic = scene.mosaic(seed);
    let found = luminance(&mosaic, Size::Full);
    let cells = enlarged(&luminance(&mosaic, Size::Cell), CELL);

    let gain = psnr(&found, &truth) - psnr(&cells, &truth);
    let middle = amplitude_kept(&found, &truth, 0.12..0.2);
    let fine = amplitude_kept(&found, &truth, 0.2..0.35);
    println!("{name}: {:.1} dB, {gain:.1} dB above the cells; kept {middle:.2}, {fine:.2}", psnr(&found, &truth));
    [gain, middle, fine]
}

/// The colours of the picture if the sensor measured every band at every place.
fn true_colours(scene: &Scene) -> Vec<[u8; 3]> {
    let mut reconstructor = Reconstructor::default();
    let mut rgb = RgbImage::default();
    let mut gray = GrayImage::default();
    let mut colours = vec![[0; 3]; SIDE * SIDE];

    for place in 0..BANDS {
        let (x, y) = (place % CELL, place / CELL);
        reconstructor.reconstruct(&scene.mosaic_of_places(x, y), &mut rgb, &mut gray);
        for (cell, pixel) in rgb.data.as_chunks::<3>().0.iter().enumerate() {
            colours[(CELL * (cell / CELLS) + y) * SIDE + CELL * (cell % CELLS) + x] = *pixel;
        }
    }
    colours
}

/// Four colour differences. The median difference to the enlarged cell picture: of the developed picture, and of the
/// truth. Then the difference to the truth, in hue and chroma only, that 1 place in 20 exceeds: of the enlarged cell
/// picture, and of the developed picture.
fn colour_quality(name: &str, scene: &Scene, seed: u64) -> [f64; 4] {
    let mosaic = scene.mosaic(seed);
    let cells = developed(&mosaic, Size::Cell).0.data;
    let channel = |component: usize| {
        let values: Vec<f32> = cells.iter().skip(component).step_by(3).map(|&value| f32::from(value)).collect();
        enlarged(&values, CELL)
    };
    let channels = [channel(0), channel(1), channel(2)];

    let truth: Vec<[f64; 3]> = true_colours(scene).into_iter().map(lab).collect();
    let full = developed(&mosaic, Size::Full).0.data;
    let found: Vec<[f64; 3]> = full.as_chunks::<3>().0.iter().map(|&pixel| lab(pixel)).collect();
    let enlarged: Vec<[f64; 3]> =
        (0..SIDE * SIDE).map(|place| lab([0, 1, 2].map(|k| channels[k][place].round() as u8))).collect();

    let to_cells =
        |of: &[[f64; 3]]| quantile(of.iter().zip(&enlarged).map(|(one, other)| ciede2000(*one, *other)).collect(), 0.5);
    let fringe = |of: &[[f64; 3]]| {
        // With the truth's lightness, so that only hue and chroma differ.
        let differences = of.iter().zip(&truth).map(|(one, truth)| ciede2000([truth[0], one[1], one[2]], *truth));
        quantile(differences.collect(), 0.95)
    };

    let quality = [to_cells(&found), to_cells(&truth), fringe(&enlarged), fringe(&found)];
    let [median, of_truth, before, after] = quality;
    println!("{name}: {median:.2} to the cells, the truth {of_truth:.2}; fringes {before:.1} -> {after:.1}");
    quality
}

#[test]
fn luminance_at_full_size_is_near_the_truth() {
    // The method was chosen on leaves 11 to 16. These scenes were not used for that.
    for seed in [101, 102, 103] {
        let [gain, middle, fine] = luminance_quality(&format!("leaves {seed}"), &Scene::leaves(seed), seed);
        assert!(gain >= 5.0 && middle >= 0.75 && fine >= 0.45, "leaves {seed}: {gain} {middle} {fine}");
    }

    for seed in [201, 202, 203] {
        let [gain, middle, fine] = luminance_quality(&format!("brain {seed}"), &Scene::brain(seed), seed);
        assert!(gain >= 5.0 && middle >= 0.75 && fine >= 0.45, "brain {seed}: {gain} {middle} {fine}");
    }
}

#[test]
fn luminance_at_half_size_is_near_the_truth() {
    for (name, scene) in [("leaves", Scene::leaves(104)), ("brain", Scene::brain(204))] {
        let blocks = |values: &[f32]| -> Vec<f32> {
            let side = SIDE / 2;
            let corners = |i: usize| (2 * (i / side)) * SIDE + 2 * (i % side);
            let mean = |first: usize| [0, 1, SIDE, SIDE + 1].map(|step| values[first + step]).iter().sum::<f32>() / 4.0;
            (0..side * side).map(|i| mean(corners(i))).collect()
        };
        let error = |found: &[f32], truth: &[f32]| {
            let squares = found.iter().zip(truth).map(|(one, other)| f64::from(one - other).powi(2));
            -10.0 * (squares.sum::<f64>() / found.len() as f64).log10()
        };

        let truth = blocks(&scene.mean());
        let mosaic = scene.mosaic(9);
        let found = error(&luminance(&mosaic, Size::Half), &truth);
        let cells = error(&enlarged(&luminance(&mosaic, Size::Cell), 2), &truth);
        println!("{name}, half: {found:.1} dB, {:.1} dB above the cells", found - cells);
        assert!(found - cells > 4.0, "{name}: {found} {cells}");
    }
}

#[test]
fn colours_are_those_of_the_cells_without_fringes_at_edges() {
    let scenes = [
        ("leaves 105", Scene::leaves(105)),
        ("leaves 106", Scene::leaves(106)),
        ("brain 205", Scene::brain(205)),
        ("brain 206", Scene::brain(206)),
    ];
    for (name, scene) in scenes {
        let [to_cells, of_truth, before, after] = colour_quality(name, &scene, 7);
        // The leaves have strong detail nearly everywhere, which the cell picture does not show.
        let limit = if name.starts_with("brain") { 2.0 } else { 3.0 };
        assert!(to_cells < limit, "{name}: {to_cells}");
        assert!(to_cells < of_truth, "{name}: {to_cells}, and the truth itself {of_truth}");
        assert!(after < 0.85 * before, "{name}: {before} {after}");
    }
}

/// A mosaic of `width` x `height` samples, each given by `count` from band, column and row.
fn mosaic(width: usize, height: usize, count: impl Fn(usize, usize, usize) -> f32) -> MosaicFrame {
    let samples = (0..width * height).map(|place| {
        let x = place % width;
        let y = place / width;
        count(CELL * (y % CELL) + x % CELL, x, y).round().clamp(0.0, 1023.0) as u16
    });
    MosaicFrame::new(width, height, samples.collect()).unwrap()
}

/// Very unequal bands, like those of a deep red surface.
fn reflectance(band: usize) -> f32 {
    [0.9, 0.8, 0.95, 1.0, 0.35, 0.3, 0.4, 0.5, 0.2, 0.25, 0.3, 0.3, 0.1, 0.12, 0.15, 0.2][band]
}

#[test]
fn an_even_surface_has_no_pattern_up_to_the_edges() {
    for (width, height) in [(4, 4), (8, 4), (4, 12), (40, 24), (68, 20)] {
        let seen = mosaic(width, height, |band, _, _| 700.0 * reflectance(band));
        let (cells, _) = developed(&seen, Size::Cell);

        for size in [Size::Half, Size::Full] {
            let (rgb, gray) = developed(&seen, size);
            assert_eq!((rgb.width, rgb.height), size.of(&seen));
            assert_eq!((gray.width, gray.height), (width / CELL, height / CELL));

            for pixel in rgb.data.as_chunks::<3>().0 {
                let near = pixel.iter().zip(&cells.data[..3]).all(|(one, other)| one.abs_diff(*other) <= 2);
                assert!(near, "{size:?} of {width}x{height}: {pixel:?} {:?}", &cells.data[..3]);
            }
        }
    }
}

#[test]
fn light_that_changes_from_sample_to_sample_is_kept() {
    // Stripes of 7 samples, the same in all bands. A cell covers about half of one.
    let light = |x: usize| 1.0 + 0.25 * (std::f32::consts::TAU * x as f32 / 7.0).cos();
    let seen = mosaic(160, 80, |band, x, _| 500.0 * reflectance(band) * light(x));
    let mean = (0..BANDS).map(reflectance).sum::<f32>() / 16.0 * 500.0 / 1023.0;

    let found = luminance(&seen, Size::Full);
    let places = (16..64).flat_map(|y| (17..143).map(move |x| (x, y)));
    let mut common = 0.0;
    let mut whole = 0.0;
    for (x, y) in places {
        common += (found[y * 160 + x] / mean - 1.0) * (light(x) - 1.0);
        whole += (light(x) - 1.0).powi(2);
    }
    let kept = common / whole;
    assert!((0.8..1.15).contains(&kept), "{kept}");
}

#[test]
fn highlights_are_white_and_darken_nothing_beside_them() {
    // Each band reaches white at another count, so the bands saturate at different levels.
    let white: [f32; BANDS] = std::array::from_fn(|band| 500.0 + 30.0 * band as f32);
    let calibration = Calibration { white: Reference::PerBand(white), ..Calibration::default() };
    let inside = |x: usize, y: usize| (x as f32 - 80.3).hypot(y as f32 - 40.8) < 14.0;
    let seen = mosaic(160, 80, |band, x, y| {
        let surface = 0.5 * reflectance(band) * white[band];
        if inside(x, y) { 4.0 * white[band] } else { surface }
    });

    for size in [Size::Half, Size::Full] {
        let (rgb, _) = developed_by(&mut Developer::new(&calibration), &seen, size);
        let times = CELL / size.per_cell();
        let pixel = |x: usize, y: usize| rgb.data.as_chunks::<3>().0[y * rgb.width + x];
        let surface = pixel(4, 4);

        for y in 0..rgb.height {
            for x in 0..rgb.width {
                let (column, row) = (x * times, y * times);
                let distance = (column as f32 - 80.3).hypot(row as f32 - 40.8);
                if distance < 10.0 {
                    assert!(pixel(x, y).iter().all(|&value| value >= 240), "{size:?} ({x}, {y}): {:?}", pixel(x, y));
                }
                if distance > 20.0 {
                    let darker = i32::from(pixel(x, y)[0]) - i32::from(surface[0]);
                    assert!(darker > -40, "{size:?} ({x}, {y}): {:?} {surface:?}", pixel(x, y));
                }
            }
        }
    }
}

#[test]
fn references_per_pixel_even_out_the_pixels() {
    let (width, height) = (160, 96);
    let uneven = |x: usize, y: usize| 0.7 + 0.3 * ((x * 29 + y * 53) % 97) as f32 / 97.0;
    let dark = mosaic(width, height, |_, x, y| 20.0 + ((x + 3 * y) % 9) as f32);
    let white = mosaic(width, height, |_, x, y| 950.0 * uneven(x, y));
    let light = |x: usize, y: usize| 0.5 + 0.2 * (0.9 * x as f32 + 0.4 * y as f32).sin();
    let seen = mosaic(width, height, |band, x, y| {
        let place = y * width + x;
        let of = |frame: &MosaicFrame| f32::from(frame.samples()[place]);
        of(&dark) + light(x, y) * reflectance(band) * (of(&white) - of(&dark))
    });
    let even = mosaic(width, height, |band, x, y| 1023.0 * light(x, y) * reflectance(band));
    let calibration =
        Calibration { dark: Reference::PerPixel(dark), white: Reference::PerPixel(white), ..Calibration::default() };

    for size in Size::ALL {
        let (found, gray) = developed_by(&mut Developer::new(&calibration), &seen, size);
        let (expected, expected_gray) = developed(&even, size);
        let differences = found.data.iter().zip(&expected.data).map(|(one, other)| f64::from(one.abs_diff(*other)));
        let largest = quantile(differences.collect(), 0.999);
        // Counts are whole numbers, so dark bands have rounding errors.
        assert!(largest <= 6.0, "{size:?}: {largest}");
        assert!(gray.data.iter().zip(&expected_gray.data).all(|(one, other)| (one - other).abs() < 0.5));
    }
}

#[test]
fn bands_of_a_calibration_decide_the_colour_at_every_size() {
    let mut other = Calibration::default();
    other.bands.reverse();
    let seen = mosaic(64, 64, |band, _, _| 700.0 * reflectance(band));

    for size in Size::ALL {
        let pixel = |calibration: &Calibration| {
            let (rgb, _) = developed_by(&mut Developer::new(calibration), &seen, size);
            rgb.data.as_chunks::<3>().0[rgb.width * rgb.height / 2]
        };
        let [red, _, blue] = pixel(&Calibration::default());
        assert!(red > blue, "long waves are reflected");
        let [red, _, blue] = pixel(&other);
        assert!(blue > red, "short waves are reflected");
    }
}

#[test]
fn gray_is_that_of_the_cells_at_every_size() {
    let seen = Scene::leaves(107).mosaic(3);
    let (_, cells) = developed(&seen, Size::Cell);
    for size in [Size::Half, Size::Full] {
        let (_, gray) = developed(&seen, size);
        let largest = gray.data.iter().zip(&cells.data).map(|(one, other)| (one - other).abs()).fold(0.0, f32::max);
        assert!(largest < 0.05, "{size:?}: {largest}");
    }
}

#[test]
fn a_cell_picture_is_the_reconstructors() {
    let seen = Scene::leaves(108).mosaic(3);
    let mut rgb = RgbImage::default();
    let mut gray = GrayImage::default();
    Reconstructor::default().reconstruct(&seen, &mut rgb, &mut gray);
    assert_eq!(developed(&seen, Size::Cell), (rgb, gray));
}

#[test]
fn a_developer_remembers_nothing_of_other_frames_and_sizes() {
    let large = Scene::leaves(109).mosaic(3);
    let small = mosaic(64, 40, |band, x, y| 300.0 + ((band * 31 + x * 17 + y * 23) % 400) as f32);
    let mut developer = Developer::new(&Calibration::default());

    for (seen, size) in [
        (&large, Size::Full),
        (&small, Size::Full),
        (&large, Size::Half),
        (&large, Size::Cell),
        (&small, Size::Half),
        (&large, Size::Full),
    ] {
        assert_eq!(developed_by(&mut developer, seen, size), developed(seen, size), "{size:?}");
    }
}
