//! The sensor of the phantom's camera: shot noise, read noise, unequal pixels, saturation, and
//! auto-exposure.

use multiversion::multiversion;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::simulation::normal::standard_normal;

/// Largest count: 10 bit.
pub(super) const FULL_SCALE: f32 = 1023.0;
/// Electrons at [`FULL_SCALE`] (CMV2K-SSM4X4-VIS).
const FULL_WELL: f32 = 12_800.0;
/// Standard deviation of read noise, electrons.
const READ_NOISE: f32 = 13.0;
/// Standard deviation of the pixels' relative response.
const UNEVENNESS: f32 = 0.007;

/// Number of normal deviates stored. Each row starts at a random place among them.
const TABLE: usize = 1 << 16;

/// Noise of a sensor `width` samples wide.
pub(super) struct Sensor {
    /// Normal deviates.
    normal: Vec<f32>,
    /// The counts of these deviates without light.
    dark: Vec<u16>,
    /// Start of each row's fixed pattern among the deviates.
    pattern: Vec<u32>,
    rng: ChaCha8Rng,
}

impl Sensor {
    /// The sensor of a seed, of `width` x `height` samples.
    pub(super) fn new(seed: u64, width: usize, height: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(2);
        let normal: Vec<f32> = (0..TABLE + width).map(|_| standard_normal(&mut rng) as f32).collect();

        let mut dark = vec![0; normal.len()];
        develop(&mut dark, &vec![0.0; normal.len()], &normal, &normal);

        let pattern = (0..height).map(|_| rng.random_range(0..TABLE as u32)).collect();
        Self { normal, dark, pattern, rng }
    }

    /// Starts of the rows' noise in this exposure.
    pub(super) fn fresh_noise(&mut self) -> Vec<u32> {
        noise(self.pattern.len(), &mut self.rng)
    }

    /// Starts of the rows' noise in an exposure whose noise is drawn from `rng`.
    pub(super) fn noise_of(&self, rng: &mut impl Rng) -> Vec<u32> {
        noise(self.pattern.len(), rng)
    }

    /// Writes the counts of row `y` into `out`: where light fell, `expected` counts with noise from column `left` on;
    /// elsewhere, darkness.
    pub(super) fn read_row(&self, out: &mut [u16], y: usize, left: usize, expected: &[f32], noise: u32) {
        let noise = noise as usize;
        out.copy_from_slice(&self.dark[noise..noise + out.len()]);

        let span = left..left + expected.len();
        let pattern = &self.normal[self.pattern[y] as usize..][span.clone()];
        develop(&mut out[span.clone()], expected, pattern, &self.normal[noise..][span]);
    }
}

fn noise(rows: usize, rng: &mut impl Rng) -> Vec<u32> {
    (0..rows).map(|_| rng.random_range(0..TABLE as u32)).collect()
}

/// Turns expected counts into noisy ones: in electrons, variance = signal + read noise squared (photon
/// transfer).
#[multiversion(targets("x86_64+avx2+fma"))]
fn develop(out: &mut [u16], expected: &[f32], pattern: &[f32], noise: &[f32]) {
    const COUNTS_PER_ELECTRON: f32 = FULL_SCALE / FULL_WELL;
    const READ_VARIANCE: f32 = READ_NOISE * READ_NOISE * COUNTS_PER_ELECTRON * COUNTS_PER_ELECTRON;
    // Adding 2^23 leaves the nearest integer in an f32's lowest bits: a rounding that vectorises.
    const ROUND: f32 = 8_388_608.0;

    let samples = out.iter_mut().zip(expected).zip(pattern.iter().zip(noise));
    for ((out, &expected), (&pattern, &noise)) in samples {
        let signal = expected * (1.0 + UNEVENNESS * pattern);
        let spread = (signal * COUNTS_PER_ELECTRON + READ_VARIANCE).sqrt();
        let count = (signal + spread * noise).clamp(0.0, FULL_SCALE);
        *out = (count + ROUND).to_bits() as u16;
    }
}

/// Auto-exposure: brings the bright parts of the picture to most of the full scale, in small steps.
#[derive(Debug, Clone)]
pub(super) struct AutoExposure {
    gain: f32,
}

/// Count that one sample in [`BRIGHT_SHARE`] should exceed.
const BRIGHT: f32 = 0.8 * FULL_SCALE;
/// One sample in this many should exceed [`BRIGHT`].
const BRIGHT_SHARE: usize = 40;
/// Share of the way, in stops, that the gain moves in one frame.
const SPEED: f32 = 0.15;
/// Least and greatest gain: a camera cannot change its exposure time without limit either.
const GAINS: (f32, f32) = (0.1, 10.0);

impl AutoExposure {
    pub(super) const fn new() -> Self {
        Self { gain: 1.5 }
    }

    /// The gain at which auto-exposure settles over a scene that would give `counts` at gain 1.
    pub(super) fn settled(mut counts: Vec<f32>) -> f32 {
        if counts.is_empty() {
            return Self::new().gain;
        }

        let index = counts.len() - 1 - counts.len() / BRIGHT_SHARE;
        let (_, bright, _) = counts.select_nth_unstable_by(index, f32::total_cmp);
        (BRIGHT / bright.max(1e-3)).clamp(GAINS.0, GAINS.1)
    }

    /// Light gathered, relative to the light that brings a white target to full scale.
    pub(super) const fn gain(&self) -> f32 {
        self.gain
    }

    /// Moves the gain a step towards the one that `samples`, some of an exposure's, call for.
    pub(super) fn adjust(&mut self, samples: impl Iterator<Item = u16>) {
        let mut histogram = [0_usize; 1024];
        let mut total = 0;
        for sample in samples {
            histogram[usize::from(sample.min(1023))] += 1;
            total += 1;
        }

        let mut left = total / BRIGHT_SHARE;
        let bright = histogram.iter().rposition(|&count| {
            let here = count > left;
            left = left.saturating_sub(count);
            here
        });

        let Some(bright) = bright else { return };
        let ratio = (BRIGHT / (bright as f32).max(1.0)).clamp(0.25, 4.0);
        self.gain = (self.gain * ratio.powf(SPEED)).clamp(GAINS.0, GAINS.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 2048;

    /// Rows of one level of light, each with fresh noise.
    fn rows(level: f32, rows: usize) -> Vec<Vec<u16>> {
        let mut sensor = Sensor::new(7, WIDTH, rows);
        let noise = sensor.fresh_noise();

        let mut out = vec![vec![0; WIDTH]; rows];
        for (y, row) in out.iter_mut().enumerate() {
            sensor.read_row(row, y, 0, &vec![level; WIDTH], noise[y]);
        }

        out
    }

    #[test]
    fn noise_follows_the_photon_transfer_curve() {
        for level in [100.0_f32, 400.0, 800.0] {
            let samples: Vec<f64> = rows(level, 200).concat().into_iter().map(f64::from).collect();
            let mean = samples.iter().sum::<f64>() / samples.len() as f64;
            let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / samples.len() as f64;

            // Electrons: shot (= signal) + read^2 + (PRNU * signal)^2; then counts, and rounding's 1/12.
            let electrons = f64::from(level) * 12_800.0 / 1023.0;
            let expected = (electrons + 13.0 * 13.0 + (0.007 * electrons).powi(2)) * (1023.0_f64 / 12_800.0).powi(2);

            assert!((mean - f64::from(level)).abs() < 0.01 * f64::from(level), "mean {mean} at {level}");
            assert!((variance / (expected + 1.0 / 12.0) - 1.0).abs() < 0.04, "variance {variance} {expected}");
        }
    }

    #[test]
    fn too_much_light_saturates_and_none_stays_near_zero() {
        assert!(rows(3000.0, 4).concat().iter().all(|&sample| sample == 1023));
        assert!(rows(0.0, 4).concat().iter().all(|&sample| sample < 8));
    }

    #[test]
    fn two_exposures_have_different_noise() {
        let mut sensor = Sensor::new(7, WIDTH, 16);
        assert_ne!(sensor.fresh_noise(), sensor.fresh_noise());
    }

    #[test]
    fn auto_exposure_converges_from_both_sides() {
        for start in [0.1, 8.0] {
            let mut exposure = AutoExposure { gain: start };
            // A scene whose brightest 5 % reflect half of what falls on them and the rest a tenth.
            for _ in 0..100 {
                let counts = [0.5, 0.1].map(|part| (part * exposure.gain() * FULL_SCALE).min(FULL_SCALE) as u16);
                exposure.adjust((0..1000).map(|index| counts[usize::from(index % 20 != 0)]));
            }

            assert!((exposure.gain() - 1.6).abs() < 0.05, "{}", exposure.gain());
        }
    }
}
