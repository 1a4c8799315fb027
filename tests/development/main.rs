//! Development at half and full size: how near the picture comes to scenes that are known exactly,
//! and that it neither invents patterns nor remembers other frames.

mod measures;
mod scenes;

use measures::{amplitude_kept, ciede2000, lab, psnr, quantile};
use parfocal::imaging::{
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
    let mut developer = Developer::new(&Calibration::default());
    let mut cells = GrayImage::default();
    let (width, height) = size.of(mosaic);
    let mut pixels = vec![0; 3 * width * size.per_cell()];
    let mut gray = vec![0.0; width * height];

    let mut rows = developer.rows(mosaic, size, &mut cells);
    let mut lines = gray.chunks_exact_mut(width);
    while rows.next_into(&mut pixels) {
        for row in 0..size.per_cell() {
            rows.gray_into(row, lines.next().unwrap());
        }
    }
    gray.iter().map(|value| value / 255.0).collect()
}

/// `picture`, one value a cell, enlarged `scale` times by cubic interpolation (Catmull and Rom).
fn enlarged(picture: &[f32], scale: usize) -> Vec<f32> {
    let side = scale * CELLS;
    let weights = |index: usize| {
        let place = (index as f32 + 0.5) / scale as f32 - 0.5;
        let part = place - place.floor();
        let weights = [
            ((2.0 - part) * part - 1.0) * part / 2.0,
            ((3.0 * part - 5.0) * part * part + 2.0) / 2.0,
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

/// How luminance at full size compares with the truth: dB above the enlarged cell picture, and the
/// share of amplitude kept at 0.12 to 0.2 and at 0.2 to 0.35 cycles a sample.
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

/// The colours that the sensor would show if it sensed every band at every place.
fn true_colours(scene: &Scene) -> Vec<[u8; 3]> {
    let mut reconstructor = Reconstructor::new(&Calibration::default());
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

/// Colour differences: the median to the enlarged cell picture; and of hue and chroma to the truth,
/// which 1 place in 20 exceeds, of the enlarged cell picture and of the developed one.
fn colour_quality(name: &str, scene: &Scene, seed: u64) -> [f64; 3] {
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

    let to_cells = found.iter().zip(&enlarged).map(|(one, other)| ciede2000(*one, *other)).collect();
    let fringe = |of: &[[f64; 3]]| {
        // Of the truth's lightness, so that only hue and chroma differ.
        let differences = of.iter().zip(&truth).map(|(one, truth)| ciede2000([truth[0], one[1], one[2]], *truth));
        quantile(differences.collect(), 0.95)
    };

    let quality = [quantile(to_cells, 0.5), fringe(&enlarged), fringe(&found)];
    let [median, before, after] = quality;
    println!("{name}: {median:.2} to the cells; fringes {before:.1} -> {after:.1}");
    quality
}

#[test]
fn luminance_at_full_size_is_near_the_truth() {
    // Other seeds than those that the method was chosen on.
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
        let [to_cells, before, after] = colour_quality(name, &scene, 7);
        assert!(to_cells < 2.0, "{name}: {to_cells}");
        assert!(after < before, "{name}: {before} {after}");
    }
}
