//! A scene that does not keep still under the crop: it stretches, turns and shears, and its contrast
//! rises and falls from place to place. Two frames of tissue show much the same, but never quite the
//! same.

use multiversion::multiversion;
use rand::Rng;

use super::normal::standard_normal;
use super::patch_defocus::MAX_SIDE;
use super::walk::{Motion, Walk};
use parfocal_imaging::GrayImage;

/// Knots of the contrast's field along each axis; beyond them it repeats.
const KNOTS: usize = 32;
/// Largest strain: the difference of lengths and angles from the picture's own.
const MOST_STRAIN: f64 = 0.15;

/// How restless a scene is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Restlessness {
    /// Speed of the deformation: standard deviation of the strain a frame.
    pub strain: f64,
    /// Standard deviation of the logarithm of the contrast from place to place.
    pub contrast: f64,
    /// Size of the cells of the contrast's field, in pixels.
    pub cell: f64,
    /// Speed of the contrast's field over the scene, in cells a frame.
    pub drift: f64,
}

/// The deformation and the contrast of a scene at a frame.
#[derive(Debug, Clone)]
pub struct Unrest {
    /// Difference from the unit matrix of the matrix that maps a place in the patch to one in the picture, row by row.
    strain: [Walk; 4],
    drift: [Walk; 2],
    cell: f32,
    /// The contrast at each knot.
    gains: Vec<f32>,
}

impl Unrest {
    /// An unrest of `restlessness`, with its course drawn from `rng`.
    pub fn new(restlessness: Restlessness, rng: &mut impl Rng) -> Self {
        let motion = |speed| Motion { speed, memory: 6.0 };
        let strain = [(); 4].map(|()| Walk::new((-MOST_STRAIN, MOST_STRAIN), motion(restlessness.strain), rng));
        let knots = KNOTS as f64;

        let drift = [(); 2].map(|()| Walk::new((0.0, 8.0 * knots), motion(restlessness.drift), rng));

        let gain = |_| (restlessness.contrast * standard_normal(rng)).exp() as f32;
        let gains = (0..KNOTS * KNOTS).map(gain).collect();

        Self { strain, drift, cell: restlessness.cell as f32, gains }
    }

    /// Moves on to the next frame.
    pub fn advance(&mut self, rng: &mut impl Rng) {
        self.strain.iter_mut().chain(&mut self.drift).for_each(|walk| walk.advance(rng));
    }

    /// Fills `out`, `side` pixels a row, with the part of `image` around a square of `width` pixels whose top left pixel
    /// lies at `corner`. Outside the image its border pixels are repeated. The image has at least 2x2 pixels, `side` is
    /// at most [`MAX_SIDE`].
    pub fn gather(&self, image: &GrayImage, corner: (f64, f64), width: usize, side: usize, out: &mut [f32]) {
        let centre = [corner.0, corner.1].map(|at| at as f32 + 0.5 * width as f32);
        self.fill(image, centre, self.cell, None, side, out);
    }

    /// As [`Unrest::gather`], where `image` holds means of 2x2 pixels.
    pub fn gather_coarsely(&self, image: &GrayImage, corner: (f64, f64), width: usize, side: usize, out: &mut [f32]) {
        let centre = [corner.0, corner.1].map(|at| 0.5 * (at as f32 + 0.5 * width as f32));
        let cell = 0.5 * self.cell;

        // A value wider than the cells of the contrast's field is a mean over several of them, and means
        // differ less from place to place.
        let depth = (0.7 * cell).min(1.0);
        self.fill(image, centre, cell, Some(depth), side, out);
    }

    /// Fills `out` around `centre`, with the contrast's field at knots `cell` pixels apart. `depth`, if
    /// given, scales the field's differences from 1.
    fn fill(&self, image: &GrayImage, centre: [f32; 2], cell: f32, depth: Option<f32>, side: usize, out: &mut [f32]) {
        let middle = 0.5 * side as f32;
        let strain = self.strain.each_ref().map(|walk| walk.position() as f32);
        let drift = self.drift.each_ref().map(|walk| walk.position() as f32);
        let along = (1.0 + strain[0], strain[2]);

        for (row, line) in out.chunks_exact_mut(side).take(side).enumerate() {
            let y = row as f32 - middle;
            let start =
                (centre[0] - middle * along.0 + strain[1] * y, centre[1] - middle * along.1 + (1.0 + strain[3]) * y);
            sample(image, start, along, line);
        }

        // The contrast scales differences from the mean of what is seen.
        let out = &mut out[..side * side];
        let mean = out.iter().sum::<f32>() / out.len() as f32;

        let knots = |axis: usize| {
            let place = move |index| (centre[axis] + index as f32 - middle) / cell + drift[axis];
            (0..side).map(move |index| Knots::around(place(index)))
        };

        let columns: Vec<Knots> = knots(0).collect();
        for (row, line) in knots(1).zip(out.chunks_exact_mut(side)) {
            let gains = self.gains_along(&row);
            for (column, value) in columns.iter().zip(line) {
                let gain = mix(gains[column.before], gains[column.after], column.part);
                let gain = depth.map_or(gain, |depth| mix(1.0, gain, depth));
                *value = (mean + gain * (*value - mean)).clamp(0.0, 255.0);
            }
        }
    }

    /// The contrast at the knots along a row.
    fn gains_along(&self, row: &Knots) -> [f32; KNOTS] {
        let upper = &self.gains[row.before * KNOTS..][..KNOTS];
        let lower = &self.gains[row.after * KNOTS..][..KNOTS];
        std::array::from_fn(|knot| mix(upper[knot], lower[knot], row.part))
    }
}

/// A place along an axis of the contrast's field.
struct Knots {
    before: usize,
    after: usize,
    /// Share of the way from `before` to `after`.
    part: f32,
}

impl Knots {
    /// The knots around `place`, which is counted in knots from the field's beginning.
    fn around(place: f32) -> Self {
        let before = place.floor();
        let wrap = |knot: i32| knot.rem_euclid(KNOTS as i32) as usize;
        Self { before: wrap(before as i32), after: wrap(before as i32 + 1), part: place - before }
    }
}

/// Fills `line` with values of `image`, interpolated between its pixels, from `start` on with a step of `along`.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn sample(image: &GrayImage, start: (f32, f32), along: (f32, f32), line: &mut [f32]) {
    let most = [image.width, image.height].map(|pixels| (pixels - 2) as i32);
    let width = image.width as i32;

    // First all places, then all look-ups: the first loop vectorises, the second cannot.
    let mut corners = [0u32; MAX_SIDE];
    let mut parts = [(0.0f32, 0.0f32); MAX_SIDE];
    for (column, (corner, part)) in corners.iter_mut().zip(&mut parts).enumerate().take(line.len()) {
        let x = (start.0 + column as f32 * along.0).clamp(0.0, (most[0] + 1) as f32);
        let y = (start.1 + column as f32 * along.1).clamp(0.0, (most[1] + 1) as f32);
        let left = (x as i32).min(most[0]);
        let top = (y as i32).min(most[1]);
        *corner = (top * width + left) as u32;
        *part = (x - left as f32, y - top as f32);
    }

    for ((value, &corner), &(right, down)) in line.iter_mut().zip(&corners).zip(&parts) {
        let from = corner as usize;
        let upper = &image.data[from..from + 2];
        let lower = &image.data[from + image.width..from + image.width + 2];
        *value = mix(mix(upper[0], upper[1], right), mix(lower[0], lower[1], right), down);
    }
}

fn mix(here: f32, there: f32, part: f32) -> f32 {
    here + part * (there - here)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Gray levels that rise by 0.5 a pixel to the right and by 1 a pixel down.
    fn slope() -> GrayImage {
        let data = (0..96 * 96).map(|i| (i % 96 + 2 * (i / 96)) as f32 * 0.5).collect();
        GrayImage { width: 96, height: 96, data }
    }

    #[test]
    fn without_unrest_the_picture_is_seen_as_it_is() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let still = Restlessness { strain: 0.0, contrast: 0.0, cell: 8.0, drift: 0.0 };
        let mut unrest = Unrest::new(still, &mut rng);
        for walk in &mut unrest.strain {
            *walk = Walk::new((0.0, 0.0), Motion { speed: 0.0, memory: 1.0 }, &mut rng);
        }
        let mut seen = vec![0.0; 32 * 32];
        unrest.gather(&slope(), (20.0, 30.5), 32, 32, &mut seen);
        for (index, value) in seen.iter().enumerate() {
            let x = 20.0 + (index % 32) as f32;
            let y = 30.5 + (index / 32) as f32;
            assert!((value - 0.5 * (x + 2.0 * y)).abs() < 1e-3, "{index}: {value}");
        }
    }

    #[test]
    fn beyond_the_border_its_pixels_go_on() {
        let mut line = [0.0; 6];
        sample(&slope(), (93.5, -2.0), (1.0, 0.0), &mut line);
        assert_eq!(line.map(|value| (4.0 * value) as i32), [187, 189, 190, 190, 190, 190]);
        sample(&slope(), (-1.0, 94.5), (0.0, 1.0), &mut line);
        assert_eq!(line.map(|value| (4.0 * value) as i32), [378, 380, 380, 380, 380, 380]);
    }

    #[test]
    fn a_stretched_slope_is_flatter() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let still = Restlessness { strain: 0.0, contrast: 0.0, cell: 8.0, drift: 0.0 };
        let mut unrest = Unrest::new(still, &mut rng);
        let at = |place, rng: &mut _| Walk::new((place, place), Motion { speed: 0.0, memory: 1.0 }, rng);
        unrest.strain = [-0.1, 0.0, 0.0, 0.1].map(|strain| at(strain, &mut rng));
        let mut seen = vec![0.0; 32 * 32];
        unrest.gather(&slope(), (20.0, 30.0), 32, 32, &mut seen);
        assert!((seen[33] - seen[32] - 0.45).abs() < 1e-3);
        assert!((seen[64] - seen[32] - 1.1).abs() < 1e-3);
    }

    #[test]
    fn contrast_varies_by_its_strength() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let unrest = Unrest::new(Restlessness { strain: 0.0, contrast: 0.3, cell: 4.0, drift: 0.1 }, &mut rng);
        let logs: Vec<f64> = unrest.gains.iter().map(|gain| f64::from(gain.ln())).collect();
        let sd = (logs.iter().map(|log| log * log).sum::<f64>() / logs.len() as f64).sqrt();
        assert!((sd - 0.3).abs() < 0.03, "{sd}");
        assert!((unrest.gains_along(&Knots::around(5.0))[3] - unrest.gains[5 * KNOTS + 3]).abs() < 1e-6);
        let halfway = 0.5 * (unrest.gains[5 * KNOTS + 3] + unrest.gains[6 * KNOTS + 3]);
        assert!((unrest.gains_along(&Knots::around(5.5))[3] - halfway).abs() < 1e-6);
    }
}
