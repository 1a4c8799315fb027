//! Measures of a picture against the truth: error, amplitude kept, and colour difference.

use std::f64::consts::PI;

use super::scenes::SIDE;

/// Side of the square in the middle of a scene of which spectra are computed: a power of two.
const SQUARE: usize = 256;
/// Width of the border, in samples, that is not measured.
const EDGE: usize = 8;

/// Peak signal-to-noise ratio in dB of values from 0 to 1.
pub fn psnr(found: &[f32], truth: &[f32]) -> f64 {
    let inside = |place: &usize| {
        let within = EDGE..SIDE - EDGE;
        within.contains(&(place % SIDE)) && within.contains(&(place / SIDE))
    };
    let places: Vec<usize> = (0..SIDE * SIDE).filter(inside).collect();
    let squares = places.iter().map(|&place| f64::from(found[place] - truth[place]).powi(2));
    -10.0 * (squares.sum::<f64>() / places.len() as f64).log10()
}

/// The share of the truth's amplitude that `found` has, in phase, at spatial frequencies within `cycles` (per sample).
pub fn amplitude_kept(found: &[f32], truth: &[f32], cycles: std::ops::Range<f64>) -> f64 {
    let found = spectrum(found);
    let truth = spectrum(truth);

    let frequency = |index: usize| index.min(SQUARE - index) as f64 / SQUARE as f64;
    let places = (0..SQUARE * SQUARE).filter(|i| cycles.contains(&frequency(i % SQUARE).hypot(frequency(i / SQUARE))));

    let mut common = 0.0;
    let mut whole = 0.0;
    for place in places {
        common += found[place][0] * truth[place][0] + found[place][1] * truth[place][1];
        whole += truth[place][0].powi(2) + truth[place][1].powi(2);
    }
    common / whole
}

/// The Fourier transform of the square in the middle of a picture, under a Hann window.
fn spectrum(picture: &[f32]) -> Vec<[f64; 2]> {
    let first = (SIDE - SQUARE) / 2;
    let value = |i: usize| f64::from(picture[(first + i / SQUARE) * SIDE + first + i % SQUARE]);
    let mean = (0..SQUARE * SQUARE).map(value).sum::<f64>() / (SQUARE * SQUARE) as f64;
    let window = |index: usize| 0.5 - 0.5 * (2.0 * PI * index as f64 / SQUARE as f64).cos();

    let mut values: Vec<[f64; 2]> =
        (0..SQUARE * SQUARE).map(|i| [(value(i) - mean) * window(i % SQUARE) * window(i / SQUARE), 0.0]).collect();
    for _ in 0..2 {
        values.chunks_exact_mut(SQUARE).for_each(transform);
        values = (0..SQUARE * SQUARE).map(|i| values[i % SQUARE * SQUARE + i / SQUARE]).collect();
    }
    values
}

/// The discrete Fourier transform, in place. The number of values must be a power of two.
fn transform(values: &mut [[f64; 2]]) {
    let count = values.len();
    if count == 1 {
        return;
    }

    let mut even: Vec<_> = values.iter().copied().step_by(2).collect();
    let mut odd: Vec<_> = values.iter().copied().skip(1).step_by(2).collect();
    transform(&mut even);
    transform(&mut odd);

    for (index, (even, odd)) in even.into_iter().zip(odd).enumerate() {
        let (sin, cos) = (-2.0 * PI * index as f64 / count as f64).sin_cos();
        let turned = [odd[0] * cos - odd[1] * sin, odd[0] * sin + odd[1] * cos];
        values[index] = [even[0] + turned[0], even[1] + turned[1]];
        values[index + count / 2] = [even[0] - turned[0], even[1] - turned[1]];
    }
}

/// Converts an 8-bit sRGB pixel to CIE L*a*b* under D65.
pub fn lab(pixel: [u8; 3]) -> [f64; 3] {
    let [red, green, blue] = pixel.map(|value| {
        let encoded = f64::from(value) / 255.0;
        if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
    });

    let f = |value: f64| if value > 0.008_856 { value.cbrt() } else { 7.787 * value + 16.0 / 116.0 };
    let x = f((0.4124 * red + 0.3576 * green + 0.1805 * blue) / 0.950_47);
    let y = f(0.2126 * red + 0.7152 * green + 0.0722 * blue);
    let z = f((0.0193 * red + 0.1192 * green + 0.9505 * blue) / 1.088_83);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The colour difference CIEDE2000 (Sharma, Wu, Dalal, Color Research and Application 30(1), 2005).
pub fn ciede2000(one: [f64; 3], other: [f64; 3]) -> f64 {
    let power = |chroma: f64| (chroma.powi(7) / (chroma.powi(7) + 25.0_f64.powi(7))).sqrt();
    let mean_chroma = f64::midpoint(one[1].hypot(one[2]), other[1].hypot(other[2]));
    let stretch = 1.0 + 0.5 * (1.0 - power(mean_chroma));
    let polar = |[_, a, b]: [f64; 3]| {
        let a = a * stretch;
        (a.hypot(b), b.atan2(a).to_degrees().rem_euclid(360.0))
    };

    let (chroma_one, hue_one) = polar(one);
    let (chroma_other, hue_other) = polar(other);
    let is_gray = chroma_one * chroma_other == 0.0;
    let turn = match hue_other - hue_one {
        _ if is_gray => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let hue = match hue_one + hue_other {
        sum if is_gray => sum,
        sum if (hue_one - hue_other).abs() <= 180.0 => sum / 2.0,
        sum if sum < 360.0 => f64::midpoint(sum, 360.0),
        sum => f64::midpoint(sum, -360.0),
    };

    let cos = |degrees: f64| degrees.to_radians().cos();
    let lightness = f64::midpoint(one[0], other[0]);
    let chroma = f64::midpoint(chroma_one, chroma_other);
    let t = 1.0 - 0.17 * cos(hue - 30.0) + 0.24 * cos(2.0 * hue) + 0.32 * cos(3.0 * hue + 6.0)
        - 0.20 * cos(4.0 * hue - 63.0);

    let away = (lightness - 50.0).powi(2);
    let by_lightness = (other[0] - one[0]) / (1.0 + 0.015 * away / (20.0 + away).sqrt());
    let by_chroma = (chroma_other - chroma_one) / (1.0 + 0.045 * chroma);
    let hue_distance = 2.0 * (chroma_one * chroma_other).sqrt() * (turn / 2.0).to_radians().sin();
    let by_hue = hue_distance / (1.0 + 0.015 * chroma * t);

    let angle = 60.0 * (-((hue - 275.0) / 25.0).powi(2)).exp();
    let rotation = -2.0 * power(chroma) * angle.to_radians().sin();
    (by_lightness.powi(2) + by_chroma.powi(2) + by_hue.powi(2) + rotation * by_chroma * by_hue).max(0.0).sqrt()
}

/// The value below which the share `share` of all values lies.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

#[test]
fn colour_differences_are_those_that_were_published() {
    // Pairs 1, 7, 17, 20 and 25 of the paper's test data.
    for (one, other, expected) in [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [50.0, 3.2592, 0.3350], 1.0),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
    ] {
        assert!((ciede2000(one, other) - expected).abs() < 1e-3, "{}", ciede2000(one, other));
    }
}

#[test]
fn amplitude_is_that_of_the_same_frequency() {
    let wave = |cycles: f64| -> Vec<f32> {
        (0..SIDE * SIDE).map(|i| (2.0 * PI * cycles * (i % SIDE) as f64).cos() as f32).collect()
    };
    let half: Vec<f32> = wave(0.15).iter().map(|value| 0.5 * value).collect();
    assert!((amplitude_kept(&half, &wave(0.15), 0.12..0.2) - 0.5).abs() < 1e-3);
    assert!(amplitude_kept(&wave(0.3), &wave(0.15), 0.12..0.2).abs() < 1e-3);
}
