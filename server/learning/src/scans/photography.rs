//! Makes a simulated scene's focal stack look as if a person had photographed it: few pictures, each with its own noise
//! and brightness, and often not aligned.
//!
//! We looked at four real stacks (`docs/notebook.md`). One has pictures that lie 3 to 10 pixels from their neighbours,
//! because magnification follows focus. One has noise that is coarser than a pixel. A mix of two pictures that are not
//! aligned shows everything twice and is less sharp than either. So sharpness first falls on the way to a sharper
//! picture. A policy that has never seen this concludes that it has passed the peak.

use rand::{Rng, RngExt};

use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_devices::simulation::normal::{cheap_normal, standard_normal};
use parfocal_imaging::GrayImage;

/// Least number of positions in a unit of focal power.
const LEAST_PLANES: f64 = 5.0;

/// Limits within which photographed stacks are drawn.
#[derive(Debug, Clone, Copy)]
pub struct PhotographyLimits {
    /// Least noise, in gray levels.
    pub least_noise: f32,
    /// Share of stacks whose pictures are not aligned.
    pub misplaced: f64,
    /// Share of stacks whose noise is coarser than a pixel.
    pub grainy: f64,
    /// Share of stacks whose scans follow what is in view.
    pub followed: f64,
}

/// How one stack is photographed. When the focal plane lies between two pictures, their mix has less noise than either.
#[derive(Debug)]
pub struct Photography {
    /// Pixels of blur from one picture to the next.
    spacing: f32,
    /// Standard deviation of the noise, in gray levels.
    noise: f32,
    /// Standard deviation of a picture's brightness, as a share.
    flicker: f32,
    /// How far the pictures are shifted against one another.
    places: Places,
    /// Standard deviation, in pixels, of the Gaussian that smooths the noise, as a camera's compression does. 0 for
    /// white noise.
    grain: f64,
}

impl Photography {
    /// Draws one within the limits of `manner`.
    pub fn draw(manner: PhotographyLimits, most_blur: f32, rng: &mut impl Rng) -> Self {
        let noise = rng.random_range(manner.least_noise..3.5);
        let flicker = if rng.random_bool(0.5) { rng.random_range(0.0f32..0.03) } else { 0.0 };
        let spacing = rng.random_range(0.3f32..2.0);

        let misplaced = happens(manner.misplaced, rng);
        let places = if misplaced { Places::draw(spacing / most_blur, rng) } else { Places::default() };
        let grain = if happens(manner.grainy, rng) { rng.random_range(0.4..2.0) } else { 0.0 };
        Self { spacing, noise, flicker, places, grain }
    }

    /// Positions of the focal plane, rising, from `most_blur` pixels of blur on one side of the middle to as many on
    /// the other.
    pub fn positions(&self, most_blur: f32) -> Vec<f32> {
        let each_side = (most_blur / self.spacing).ceil() as i32;
        (-each_side..=each_side).map(|plane| plane as f32 * self.spacing).collect()
    }

    /// Least slope, in pixels of blur a unit of focal power, at which the pictures lie close enough together.
    pub fn least_slope(&self) -> f64 {
        LEAST_PLANES * f64::from(self.spacing)
    }

    /// Shifts each of `pictures` (position and picture), changes its brightness and adds noise.
    pub fn spoil(&self, pictures: &mut [(f32, GrayImage)], rng: &mut impl Rng) {
        for (position, picture) in pictures {
            if self.places != Places::default() {
                *picture = moved(picture, self.places.of(*position / self.spacing, rng));
            }

            let gain = (self.flicker * standard_normal(rng) as f32).exp();
            let white = (0..picture.data.len()).map(|_| self.noise * cheap_normal(rng)).collect();
            let noise = smoothed(GrayImage { data: white, ..*picture }, self.grain);
            for (value, noise) in picture.data.iter_mut().zip(&noise.data) {
                *value = (gain * *value + noise).clamp(0.0, 255.0);
            }
        }
    }

    /// If scans follow what is in view, the distance from one picture to the next in pixels of blur. Else `None`.
    pub fn followed(&self, manner: PhotographyLimits, rng: &mut impl Rng) -> Option<f64> {
        happens(manner.followed, rng).then(|| f64::from(self.spacing))
    }
}

/// Draws whether something with probability `share` happens. At 0 it draws nothing from `rng`, so that the scenes of
/// the reference benchmark stay the same.
fn happens(share: f64, rng: &mut impl Rng) -> bool {
    share > 0.0 && rng.random_bool(share)
}

/// How far a stack's pictures are shifted against one another, in pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Places {
    /// Shift from each picture to the next, because magnification follows focus. At one place of the view it is nearly
    /// constant.
    drift: [f32; 2],
    /// Share of pictures that were knocked aside, and the standard deviation of their shift.
    knocked: (f64, f32),
    /// Standard deviation of each picture's remaining shift.
    jitter: f32,
}

impl Places {
    /// Largest shift of the first and the last picture by a drift.
    const MOST_DRIFT: f32 = 60.0;

    /// `spacing` is the distance from one picture to the next, as a share of the way from the middle to an end.
    fn draw(spacing: f32, rng: &mut impl Rng) -> Self {
        let mut places = Self::default();
        if rng.random_bool(0.5) {
            // Small drifts are more frequent than large ones.
            let most = 8.0f32.min(Self::MOST_DRIFT * spacing);
            let size = most * rng.random::<f32>().powi(2);
            let angle = rng.random_range(0.0..std::f32::consts::TAU);
            places.drift = [size * angle.cos(), size * angle.sin()];
        }
        if rng.random_bool(0.4) {
            places.knocked = (rng.random_range(0.05..0.3), rng.random_range(1.0f32..10.0));
        }
        if rng.random_bool(0.5) {
            places.jitter = rng.random_range(0.0f32..1.5);
        }
        places
    }

    /// Shift, in whole pixels, of the picture that is `number` pictures from the middle one.
    fn of(&self, number: f32, rng: &mut impl Rng) -> [i64; 2] {
        let (share, far) = self.knocked;
        let knocked = if rng.random_bool(share) { far } else { 0.0 };
        self.drift.map(|drift| {
            let aside = knocked * standard_normal(rng) as f32 + self.jitter * standard_normal(rng) as f32;
            (drift * number + aside).round() as i64
        })
    }
}

/// White noise smoothed by a Gaussian of `sigma` pixels, with its energy unchanged.
fn smoothed(noise: GrayImage, sigma: f64) -> GrayImage {
    if sigma <= 0.0 {
        return noise;
    }

    let energy = |picture: &GrayImage| picture.data.iter().map(|value| value * value).sum::<f32>();
    let before = energy(&noise);
    let mut smooth = gaussian_blur(&noise, sigma);
    let factor = (before / energy(&smooth).max(f32::MIN_POSITIVE)).sqrt();
    smooth.data.iter_mut().for_each(|value| *value *= factor);
    smooth
}

/// `picture` moved by whole pixels to the right and down, mirrored at its borders.
fn moved(picture: &GrayImage, [right, down]: [i64; 2]) -> GrayImage {
    let from = |place: usize, by: i64, size: usize| {
        let last = size as i64 - 1;
        let place = (place as i64 - by).rem_euclid(2 * last);
        place.min(2 * last - place) as usize
    };

    let columns: Vec<_> = (0..picture.width).map(|x| from(x, right, picture.width)).collect();
    let rows = (0..picture.height).map(|y| from(y, down, picture.height) * picture.width);
    let data = rows.flat_map(|row| columns.iter().map(move |column| picture.data[row + column])).collect();
    GrayImage { data, ..*picture }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn a_moved_picture_is_mirrored_at_its_borders() {
        let picture = GrayImage { width: 3, height: 2, data: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0] };
        assert_eq!(moved(&picture, [1, 0]).data, [2.0, 1.0, 2.0, 5.0, 4.0, 5.0]);
        assert_eq!(moved(&picture, [-1, 1]).data, [5.0, 6.0, 5.0, 2.0, 3.0, 2.0]);
        assert_eq!(moved(&picture, [4, -2]).data, picture.data);
    }

    #[test]
    fn grain_leaves_noise_as_strong_and_makes_neighbours_alike() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let white = GrayImage { width: 64, height: 64, data: (0..64 * 64).map(|_| cheap_normal(&mut rng)).collect() };
        let variance = |picture: &GrayImage| picture.data.iter().map(|v| v * v).sum::<f32>() / 4096.0;
        // Smoothed by a Gaussian of sd s, neighbours correlate by exp(-1 / 4 s^2): .94 for 2 pixels.
        let grainy = smoothed(white.clone(), 2.0);
        let neighbours = grainy.data.windows(2).map(|pair| pair[0] * pair[1]).sum::<f32>() / 4095.0;
        assert!((variance(&grainy) / variance(&white) - 1.0).abs() < 0.01);
        assert!((neighbours / variance(&grainy) - 0.94).abs() < 0.05, "{}", neighbours / variance(&grainy));
    }

    #[test]
    fn a_drift_takes_each_picture_farther_aside() {
        let places = Places { drift: [1.5, -3.0], ..Places::default() };
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        assert_eq!([-2.0, 0.0, 4.0].map(|number| places.of(number, &mut rng)), [[-3, 6], [0, 0], [6, -12]]);
    }
}
