//! Multispectral scenes with every band known at every place, and the mosaics that a sensor would take of them.

use parfocal_devices::simulation::phantom::Scene as Brain;
use parfocal_imaging::{BANDS, CELL, Calibration, MosaicFrame};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Width and height of a scene, in samples.
pub const SIDE: usize = 288;

/// Electrons at full scale.
const FULL_WELL: f32 = 12_800.0;
/// The sensor's read noise, in electrons.
const READ_NOISE: f32 = 13.0;
/// The largest count.
const FULL_SCALE: f32 = 1023.0;

/// Number of leaves of a scene, the ground below them included.
const LEAVES: usize = 400;

/// Wavelengths at which spectra are sampled, in nm.
const WAVELENGTHS: std::ops::Range<u32> = 400..701;

/// The value of each band at each place, 0 for black and 1 for white.
pub struct Scene {
    pub bands: [Vec<f32>; BANDS],
}

impl Scene {
    /// Overlapping coloured leaves under uneven light. Each has its own spectrum and a pattern of a second spectrum. So
    /// there are sharp edges between colours, and detail down to a sample.
    pub fn leaves(seed: u64) -> Self {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let spectra = |rng: &mut ChaCha8Rng| (0..LEAVES).map(|_| in_bands(&spectrum(rng))).collect::<Vec<_>>();
        let ground = spectra(rng);
        let pattern = spectra(rng);

        // Twice the resolution, for soft edges.
        let fine = 2 * SIDE;
        let labels = leaves(fine, ground.len(), rng);
        let share = noise(&[3.0, 7.0, 19.0], rng);
        let light = noise(&[2.5, 6.0, 15.0, 60.0], rng);

        let band = |band: usize| {
            let values: Vec<f32> = (0..SIDE * SIDE)
                .map(|place| {
                    let x = 2 * (place % SIDE);
                    let y = 2 * (place / SIDE);
                    let corners = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| labels[y * fine + x]);
                    let mean = |of: &[[f32; BANDS]]| corners.iter().map(|&leaf| of[leaf][band]).sum::<f32>() / 4.0;

                    let part = 0.125 + 0.125 * share[place].tanh();
                    let colour = (1.0 - part) * mean(&ground) + part * mean(&pattern);
                    0.75 * colour * (0.15 * light[place]).exp()
                })
                .collect();
            softened(&values)
        };
        Self { bands: std::array::from_fn(band) }
    }

    /// The surface of a phantom's brain with two samples per texel, as bright as the camera exposes it. This is nearer
    /// than the phantom's camera ever is, so there is finer detail than it ever shows.
    pub fn brain(seed: u64) -> Self {
        const TEXELS: usize = SIDE / 2 + 1;
        let brain = Brain::new(seed);
        let bands = Calibration::default().bands.map(|band| {
            let texels = brain.sharp_band(&band, TEXELS, TEXELS).data;
            let between = |place: usize| {
                let first = place / SIDE / 2 * TEXELS + place % SIDE / 2;
                let right = place % 2;
                let below = place / SIDE % 2 * TEXELS;
                let corners = [first, first + right, first + below, first + right + below];
                corners.iter().map(|&texel| texels[texel]).sum::<f32>() / 4.0
            };
            (0..SIDE * SIDE).map(between).collect::<Vec<f32>>()
        });

        let mut means: Vec<f32> = (0..SIDE * SIDE).map(|place| mean_at(&bands, place)).collect();
        means.sort_by(f32::total_cmp);
        let bright = means[means.len() * 39 / 40];
        Self { bands: bands.map(|band| band.iter().map(|value| 0.8 * value / bright).collect()) }
    }

    /// The mean of all bands, each limited to the sensor's full scale.
    pub fn mean(&self) -> Vec<f32> {
        (0..SIDE * SIDE).map(|place| self.bands.iter().map(|band| band[place].min(1.0)).sum::<f32>() / 16.0).collect()
    }

    /// The mosaic that a 10-bit sensor takes of the scene, with shot noise and read noise.
    pub fn mosaic(&self, seed: u64) -> MosaicFrame {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let samples = (0..SIDE * SIDE).map(|place| {
            let band = CELL * (place / SIDE % CELL) + place % SIDE % CELL;
            let electrons = FULL_WELL * self.bands[band][place].clamp(0.0, 1.0);
            let deviation = (electrons + READ_NOISE * READ_NOISE).sqrt();
            let counted = (electrons + deviation * normal(rng)) / FULL_WELL * FULL_SCALE;
            counted.round().clamp(0.0, FULL_SCALE) as u16
        });
        MosaicFrame::new(SIDE, SIDE, samples.collect()).unwrap()
    }

    /// A mosaic in which all samples of a cell show the same place, each in its own band. So its picture at the size of
    /// cells has the scene's true colour at that place. The place is `x`, `y` samples from the cell's first sample.
    pub fn mosaic_of_places(&self, x: usize, y: usize) -> MosaicFrame {
        let samples = (0..SIDE * SIDE).map(|place| {
            let column = (place % SIDE / CELL * CELL + x).min(SIDE - 1);
            let row = (place / SIDE / CELL * CELL + y).min(SIDE - 1);
            let band = CELL * (place / SIDE % CELL) + place % SIDE % CELL;
            (FULL_SCALE * self.bands[band][row * SIDE + column].clamp(0.0, 1.0)).round() as u16
        });
        MosaicFrame::new(SIDE, SIDE, samples.collect()).unwrap()
    }
}

fn mean_at(bands: &[Vec<f32>; BANDS], place: usize) -> f32 {
    bands.iter().map(|band| band[place]).sum::<f32>() / BANDS as f32
}

/// A smooth random reflectance at [`WAVELENGTHS`].
fn spectrum(rng: &mut ChaCha8Rng) -> Vec<f32> {
    let hills: Vec<(f32, f32)> = (0..8_u8).map(|hill| (400.0 + 300.0 * f32::from(hill) / 7.0, normal(rng))).collect();
    let base = -2.5 + 4.0 * rng.random::<f32>();
    let strength = 0.1 + 0.6 * rng.random::<f32>();

    let at = |nm: u32| {
        let wave = |&(centre, height): &(f32, f32)| height * (-0.5 * ((nm as f32 - centre) / 40.0).powi(2)).exp();
        let sum: f32 = hills.iter().map(wave).sum();
        1.0 / (1.0 + (-base - strength * sum).exp())
    };
    WAVELENGTHS.map(at).collect()
}

/// The value of each band of the default sensor for a spectrum.
fn in_bands(spectrum: &[f32]) -> [f32; BANDS] {
    Calibration::default().bands.map(|band| {
        let weight = |nm: u32| (-2.772_589 * ((f64::from(nm) - band.centre_nm) / band.fwhm_nm).powi(2)).exp() as f32;
        let seen: f32 = WAVELENGTHS.zip(spectrum).map(|(nm, value)| weight(nm) * value).sum();
        seen / WAVELENGTHS.map(weight).sum::<f32>()
    })
}

/// Index of the uppermost of `count` leaves at each place of a square.
fn leaves(side: usize, count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut labels = vec![count - 1; side * side];

    for leaf in (0..count - 1).rev() {
        let radius = (16.0 / (0.002 + 0.998 * rng.random::<f32>()).sqrt()).min(280.0);
        let thin = 0.15 + 0.85 * rng.random::<f32>();
        let [x, y] = [(); 2].map(|()| side as f32 * rng.random::<f32>());
        let (sin, cos) = (std::f32::consts::PI * rng.random::<f32>()).sin_cos();

        let range = |centre: f32| (centre - radius).max(0.0) as usize..((centre + radius) as usize + 1).min(side);
        for row in range(y) {
            for column in range(x) {
                let across = column as f32 - x;
                let down = row as f32 - y;
                let along = (across * cos + down * sin) / radius;
                let beside = (down * cos - across * sin) / (radius * thin);
                if along * along + beside * beside < 1.0 {
                    labels[row * side + column] = leaf;
                }
            }
        }
    }

    labels
}

/// Smooth noise with bumps of each of `sizes`, of standard deviation about 1. Larger bumps are higher, as in nature.
fn noise(sizes: &[f32], rng: &mut ChaCha8Rng) -> Vec<f32> {
    let mut sum = vec![0.0; SIDE * SIDE];
    let squares: f32 = sizes.iter().sum();
    for &size in sizes {
        let knots = (SIDE as f32 / size) as usize + 2;
        let heights: Vec<f32> = (0..knots * knots).map(|_| normal(rng)).collect();

        for (place, sum) in sum.iter_mut().enumerate() {
            let x = (place % SIDE) as f32 / size;
            let y = (place / SIDE) as f32 / size;
            let first = y as usize * knots + x as usize;
            let row = |from: usize| heights[from] + x.fract() * (heights[from + 1] - heights[from]);
            let value = row(first) + y.fract() * (row(first + knots) - row(first));
            *sum += 1.5 * value * (size / squares).sqrt();
        }
    }
    sum
}

/// A picture as blurred slightly by a lens: Gaussian of half a sample.
fn softened(values: &[f32]) -> Vec<f32> {
    const WEIGHTS: [f32; 3] = [0.107, 0.786, 0.107];
    let across: Vec<f32> = (0..values.len()).map(|place| weighted(values, place, place % SIDE, 1, WEIGHTS)).collect();
    (0..values.len()).map(|place| weighted(&across, place, place / SIDE, SIDE, WEIGHTS)).collect()
}

fn weighted(values: &[f32], place: usize, index: usize, step: usize, weights: [f32; 3]) -> f32 {
    let before = if index > 0 { place - step } else { place };
    let after = if index + 1 < SIDE { place + step } else { place };
    weights[0] * values[before] + weights[1] * values[place] + weights[2] * values[after]
}

/// A normal deviate, by Box and Muller.
pub fn normal(rng: &mut ChaCha8Rng) -> f32 {
    let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
    radius * (std::f32::consts::TAU * rng.random::<f32>()).cos()
}
