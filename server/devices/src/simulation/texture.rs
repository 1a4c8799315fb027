//! Sharp synthetic pictures of many kinds, for policies to train on: overlapping discs ("dead leaves",
//! whose statistics are those of natural pictures: Lee, Mumford and Huang 2001), fractal noise,
//! vessels, highlights.

use std::ops::Range;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::blur::gaussian_blur;
use parfocal_imaging::GrayImage;

/// A sharp picture of `side` x `side` pixels; the same seed gives the same picture.
pub fn texture(seed: u64, side: usize) -> GrayImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut canvas = Canvas::blank(side);

    match rng.random_range(0..4) {
        0 => canvas.add_noise(&mut rng, 1.0),
        1 => canvas.add_leaves(&mut rng),
        2 => {
            canvas.add_leaves(&mut rng);
            canvas.add_noise(&mut rng, 0.4);
        }
        _ => canvas.add_noise(&mut rng, 0.5),
    }

    if rng.random_bool(0.5) {
        canvas.add_vessels(&mut rng);
    }

    canvas.expose(&mut rng);
    if rng.random_bool(0.3) {
        canvas.add_highlights(&mut rng);
    }

    canvas.soften(rng.random_range(0.0..0.6));

    GrayImage { width: side, height: side, data: canvas.data }
}

/// Makes the contrast of `picture` vary from place to place, as tissue, smoke and wetness do: scales
/// each difference from the surrounding mean by the exponential of smooth noise of standard deviation
/// about `strength`.
pub fn vary_contrast(picture: &mut GrayImage, strength: f32, seed: u64) {
    const AROUND: f64 = 12.0;

    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let side = picture.width.max(picture.height);
    let mut field = Canvas::blank(side);
    field.add_octave(&mut rng, 70.0, 1.6);
    field.add_octave(&mut rng, 30.0, 1.6);

    let around = gaussian_blur(picture, AROUND);
    for (index, (value, mean)) in picture.data.iter_mut().zip(&around.data).enumerate() {
        let x = index % picture.width;
        let y = index / picture.width;
        let scale = (strength * field.data[y * side + x]).exp();
        *value = (mean + scale * (*value - mean)).clamp(0.0, 255.0);
    }
}

/// A square picture being drawn.
pub struct Canvas {
    side: usize,
    /// Its values, a row after another.
    pub data: Vec<f32>,
}

impl Canvas {
    /// A canvas of `side` x `side` zeros.
    pub fn blank(side: usize) -> Self {
        Self { side, data: vec![0.0; side * side] }
    }

    /// Octaves of smoothly interpolated noise; each finer one is weaker by a random factor.
    fn add_noise(&mut self, rng: &mut impl Rng, amplitude: f32) {
        let falloff = rng.random_range(0.45f32..0.95);
        let mut cell = rng.random_range(24.0f32..80.0);
        let finest = rng.random_range(1.2f32..4.0);
        let mut weight = amplitude;

        while cell > finest {
            self.add_octave(rng, cell, weight);
            cell *= 0.5;
            weight *= falloff;
        }
    }

    /// Smooth noise with a knot every `cell` pixels, from `-weight` to `weight`.
    pub fn add_octave(&mut self, rng: &mut impl Rng, cell: f32, weight: f32) {
        let knots = (self.side as f32 / cell) as usize + 3;
        let values: Vec<f32> = (0..knots * knots).map(|_| rng.random_range(-1.0..1.0)).collect();
        let weights: Vec<(usize, f32)> = (0..self.side)
            .map(|at| {
                let place = at as f32 / cell;
                let fraction = place.fract();
                (place as usize, fraction * fraction * (3.0 - 2.0 * fraction))
            })
            .collect();

        for (row, line) in self.data.chunks_exact_mut(self.side).enumerate() {
            let (top, down) = weights[row];
            for (pixel, &(left, right)) in line.iter_mut().zip(&weights) {
                let at = |y: usize, x: usize| values[y * knots + x];
                let upper = at(top, left) * (1.0 - right) + at(top, left + 1) * right;
                let lower = at(top + 1, left) * (1.0 - right) + at(top + 1, left + 1) * right;
                *pixel += weight * (upper * (1.0 - down) + lower * down);
            }
        }
    }

    /// Discs that hide one another, with radii drawn from a power law, until most of the picture is
    /// covered.
    fn add_leaves(&mut self, rng: &mut impl Rng) {
        let least = rng.random_range(1.5f32..5.0);
        let most = rng.random_range(15.0f32..50.0);
        let mut covered = 0.0;
        while covered < 2.5 * (self.side * self.side) as f32 {
            // A density that falls with the third power of the radius gives all scales equal weight.
            let u: f32 = rng.random();
            let radius = 1.0 / (1.0 / (least * least) * (1.0 - u) + u / (most * most)).sqrt();
            covered += std::f32::consts::PI * radius * radius;

            let centre = (self.place(rng), self.place(rng));
            let shade = rng.random_range(-1.0f32..1.0);
            let stretch = rng.random_range(0.5f32..2.0);
            self.add_leaf(centre, radius, stretch, shade);
        }
    }

    fn place(&self, rng: &mut impl Rng) -> f32 {
        rng.random_range(0.0..self.side as f32)
    }

    /// Draws an ellipse over what is there. It has the area of a disc of `radius` and is `stretch` times as wide as
    /// high.
    pub fn add_leaf(&mut self, (cx, cy): (f32, f32), radius: f32, stretch: f32, shade: f32) {
        let rx = radius * stretch.sqrt();
        let ry = radius / stretch.sqrt();

        for y in self.span(cy, ry) {
            let dy = (y as f32 - cy) / ry;
            for x in self.span(cx, rx) {
                let dx = (x as f32 - cx) / rx;
                let cover = ((1.0 - (dx * dx + dy * dy).sqrt()) * radius + 0.5).clamp(0.0, 1.0);
                let pixel = &mut self.data[y * self.side + x];
                *pixel += (shade - *pixel) * cover;
            }
        }
    }

    fn span(&self, centre: f32, reach: f32) -> std::ops::Range<usize> {
        let low = (centre - reach - 1.0).max(0.0) as usize;
        low..((centre + reach + 2.0).max(0.0) as usize).min(self.side)
    }

    /// Dark, winding, thinning lines.
    fn add_vessels(&mut self, rng: &mut impl Rng) {
        for _ in 0..rng.random_range(4..20) {
            self.add_winding_line(rng, 0.8..4.0, |rng| rng.random_range(-1.5f32..-0.2));
        }
    }

    /// Winding, thinning lines of `value`: their number is drawn from `count`, their first radius from
    /// `radii`.
    pub fn add_winding_lines(&mut self, rng: &mut impl Rng, count: Range<usize>, radii: Range<f32>, value: f32) {
        for _ in 0..rng.random_range(count) {
            self.add_winding_line(rng, radii.clone(), |_| value);
        }
    }

    fn add_winding_line<R: Rng>(&mut self, rng: &mut R, radii: Range<f32>, shade: impl Fn(&mut R) -> f32) {
        let mut x = self.place(rng);
        let mut y = self.place(rng);
        let mut heading = rng.random_range(0.0..std::f32::consts::TAU);
        let mut radius = rng.random_range(radii);
        let shade = shade(rng);

        for _ in 0..rng.random_range(60..300) {
            self.add_leaf((x, y), radius, 1.0, shade);
            heading += rng.random_range(-0.25f32..0.25);
            x += heading.cos();
            y += heading.sin();
            radius = (radius * 0.998).max(0.6);
        }
    }

    /// Brings the values to a random brightness and contrast on 0..=255, under uneven light.
    fn expose(&mut self, rng: &mut impl Rng) {
        let count = self.data.len() as f32;
        let mean = self.data.iter().sum::<f32>() / count;
        let spread = (self.data.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / count).sqrt().max(1e-6);

        let brightness = rng.random_range(50.0f32..190.0);
        let contrast = rng.random_range(2.3f32..4.0).exp();
        let across = rng.random_range(-0.3f32..0.3);
        let down = rng.random_range(-0.3f32..0.3);

        let middle = self.side as f32 / 2.0;
        for (index, value) in self.data.iter_mut().enumerate() {
            let x = (index % self.side) as f32 / middle - 1.0;
            let y = (index / self.side) as f32 / middle - 1.0;
            let light = 1.0 + across * x + down * y;
            *value = (light * (brightness + contrast * (*value - mean) / spread)).clamp(0.0, 255.0);
        }
    }

    /// Small, saturated glints.
    fn add_highlights(&mut self, rng: &mut impl Rng) {
        for _ in 0..rng.random_range(5..60) {
            let centre = (self.place(rng), self.place(rng));
            let radius = rng.random_range(0.7f32..4.0);
            let stretch = rng.random_range(0.4f32..2.5);
            self.add_leaf(centre, radius, stretch, 255.0);
        }
    }

    /// Softens the picture as a camera's optics and demosaicing do: mixes neighbours by `share` along
    /// both axes.
    fn soften(&mut self, share: f32) {
        let side = self.side;
        for stride in [1, side] {
            let before = self.data.clone();
            for index in stride..before.len() - stride {
                let beside = 0.5 * (before[index - stride] + before[index + stride]);
                self.data[index] += 0.5 * share * (beside - before[index]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_reproducible_varied_and_within_range() {
        assert_eq!(texture(3, 128), texture(3, 128));
        for seed in 0..8 {
            let picture = texture(seed, 128);
            assert!(picture.data.iter().all(|v| (0.0..=255.0).contains(v)));
            let mean = picture.data.iter().sum::<f32>() / picture.data.len() as f32;
            let spread = picture.data.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / picture.data.len() as f32;
            assert!(spread.sqrt() > 3.0, "picture {seed} is flat");
        }
    }
}
