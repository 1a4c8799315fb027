//! Defocus: the surface as seen through discs of confusion of rising radius, ready for look-up per
//! pixel.

use multiversion::multiversion;

use super::spectra::ENDMEMBERS;

/// The composition of one texel: abundances of the endmembers, in units of 1/8191.
pub(super) type Texel = [u16; ENDMEMBERS];

/// Radius of each level's disc, and the step of the grid on which the level is kept, both in texels. A wide disc leaves
/// no detail that a coarser grid would lose.
const LEVELS: [(f32, usize); 9] =
    [(0.0, 1), (1.0, 1), (2.0, 1), (3.0, 1), (4.5, 2), (6.5, 2), (9.0, 4), (12.5, 4), (17.0, 4)];

/// A surface at several radii of its disc of confusion.
pub(super) struct Stack {
    levels: Vec<Level>,
    /// Index of the level below a squared radius, in steps of [`SQUARE_STEP`].
    below: Vec<u8>,
}

/// Resolution of the table from squared radius to level; each level's squared radius is a multiple of it.
const SQUARE_STEP: f32 = 0.25;

struct Level {
    side: usize,
    scale: f32,
    square: f32,
    /// 1 / (next level's squared radius - this one's); 0 for the last.
    per_square: f32,
    texels: Vec<Texel>,
}

impl Stack {
    /// Blurs `sharp`, `side` x `side` texels, to every radius.
    pub(super) fn new(sharp: Vec<Texel>, side: usize) -> Self {
        let mut levels: Vec<Level> = LEVELS[1..]
            .iter()
            .map(|&(radius, step)| {
                let coarse = shrink(&sharp, side, step);
                // Averaging boxes of n texels adds a second moment of (n^2 - 1) / 12. Weighting each coarse texel by
                // the part that the disc covers adds n^2 / 12. A disc has r^2 / 4.
                let boxes = (2 * step * step - 1) as f32 / 3.0;
                let rest = (radius * radius - boxes).sqrt() / step as f32;
                Level::new(radius, step, side / step, blur(&coarse, side / step, &Disc::new(rest)))
            })
            .collect();

        levels.insert(0, Level::new(0.0, 1, side, sharp));
        for index in 0..levels.len() - 1 {
            levels[index].per_square = 1.0 / (levels[index + 1].square - levels[index].square);
        }

        let last = (LEVELS[LEVELS.len() - 1].0.powi(2) / SQUARE_STEP) as usize;
        let below = (0..=last).map(|step| level_below(step as f32 * SQUARE_STEP)).collect();
        Self { levels, below }
    }

    /// The surface at a place (in texels), through a disc of the given squared radius: interpolated
    /// between the two nearest levels such that the second moment is exact.
    #[inline(always)]
    pub(super) fn at(&self, u: f32, v: f32, square: f32) -> [f32; ENDMEMBERS] {
        let index = ((square * (1.0 / SQUARE_STEP)) as usize).min(self.below.len() - 1);
        let below = usize::from(self.below[index]);
        let low = &self.levels[below];
        let part = (square - low.square) * low.per_square;

        let sharper = low.at(u, v);
        if part <= 0.0 {
            return sharper;
        }

        let softer = self.levels[below + 1].at(u, v);
        let mut between = sharper;
        for (value, softer) in between.iter_mut().zip(softer) {
            *value += part * (softer - *value);
        }

        between
    }

    /// Memory held, in bytes.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(&level.texels[..])).sum()
    }
}

fn level_below(square: f32) -> u8 {
    let above = LEVELS.iter().take_while(|(radius, _)| radius * radius <= square).count();
    (above - 1) as u8
}

impl Level {
    fn new(radius: f32, step: usize, side: usize, texels: Vec<Texel>) -> Self {
        Self { side, scale: 1.0 / step as f32, square: radius * radius, per_square: 0.0, texels }
    }

    /// Bilinear look-up; outside the surface, the border's value.
    #[inline(always)]
    fn at(&self, u: f32, v: f32) -> [f32; ENDMEMBERS] {
        let last = (self.side - 1) as f32 - 0.001;
        let x = ((u + 0.5) * self.scale - 0.5).clamp(0.0, last);
        let y = ((v + 0.5) * self.scale - 0.5).clamp(0.0, last);
        let left = x as u32;
        let top = y as u32;
        let x = x - left as f32;
        let y = y - top as f32;

        let start = top as usize * self.side + left as usize;
        let upper = &self.texels[start..][..2];
        let lower = &self.texels[start + self.side..][..2];
        let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];

        let mut sum = [0.0; ENDMEMBERS];
        for (texel, weight) in [upper[0], upper[1], lower[0], lower[1]].into_iter().zip(weights) {
            for (sum, value) in sum.iter_mut().zip(texel) {
                *sum += weight * f32::from(value);
            }
        }

        sum
    }
}

/// Averages of `step` x `step` texels.
fn shrink(sharp: &[Texel], side: usize, step: usize) -> Vec<[f32; ENDMEMBERS]> {
    let small = side / step;
    let mut out = vec![[0.0; ENDMEMBERS]; small * small];

    for (y, row) in sharp.chunks_exact(side).enumerate().take(small * step) {
        let out = &mut out[y / step * small..][..small];
        for (out, texels) in out.iter_mut().zip(row.chunks_exact(step)) {
            for texel in texels {
                out.iter_mut().zip(texel).for_each(|(sum, &value)| *sum += f32::from(value));
            }
        }
    }

    for sum in out.iter_mut().flatten() {
        *sum /= (step * step) as f32;
    }

    out
}

/// A disc's weight in each texel around its centre.
struct Disc {
    reach: usize,
    /// `(2 reach + 1)^2` weights that add up to 1.
    weights: Vec<f32>,
}

impl Disc {
    /// The disc of `radius` texels. A texel's weight is the part of it that the disc covers, estimated
    /// from 16 x 16 points.
    fn new(radius: f32) -> Self {
        const POINTS: usize = 16;
        let reach = (radius - 0.5).ceil().max(0.0) as usize;
        let width = 2 * reach + 1;

        let inside = |index: usize| {
            let corner =
                |i: usize, point: usize| (i as f32 - reach as f32) - 0.5 + (point as f32 + 0.5) / POINTS as f32;
            let points = (0..POINTS * POINTS).filter(|point| {
                let x = corner(index % width, point % POINTS);
                let y = corner(index / width, point / POINTS);
                x * x + y * y <= radius * radius
            });
            points.count() as f32
        };

        let mut weights: Vec<f32> = (0..width * width).map(inside).collect();
        let sum: f32 = weights.iter().sum();
        for weight in &mut weights {
            *weight /= sum;
        }

        Self { reach, weights }
    }
}

/// Convolves with a disc; outside, the border's texels are repeated.
fn blur(sharp: &[[f32; ENDMEMBERS]], side: usize, disc: &Disc) -> Vec<Texel> {
    let reach = disc.reach;
    let width = 2 * disc.reach + 1;

    let padded_side = side + 2 * reach;
    let mut padded = vec![0.0; padded_side * padded_side * ENDMEMBERS];
    for (y, row) in padded.chunks_exact_mut(padded_side * ENDMEMBERS).enumerate() {
        let source = &sharp[y.saturating_sub(reach).min(side - 1) * side..][..side];
        for (x, texel) in row.chunks_exact_mut(ENDMEMBERS).enumerate() {
            texel.copy_from_slice(&source[x.saturating_sub(reach).min(side - 1)]);
        }
    }

    let mut sum = vec![0.0; side * ENDMEMBERS];
    let mut out = Vec::with_capacity(side * side);

    for y in 0..side {
        // Half a unit to begin with, so that the conversion to whole numbers below rounds.
        sum.fill(0.5);
        for (row, weights) in disc.weights.chunks_exact(width).enumerate() {
            let row = &padded[(y + row) * padded_side * ENDMEMBERS..][..padded_side * ENDMEMBERS];
            weighted_sum(&mut sum, row, weights);
        }
        out.extend(sum.as_chunks::<ENDMEMBERS>().0.iter().map(|sum| sum.map(|value| value as u16)));
    }

    out
}

/// Adds to each texel of `sum` the texels of `row` from its place to the right, weighted.
#[multiversion(targets("x86_64+avx2+fma"))]
fn weighted_sum(sum: &mut [f32], row: &[f32], weights: &[f32]) {
    for (shift, &weight) in weights.iter().enumerate() {
        if weight > 0.0 {
            for (sum, value) in sum.iter_mut().zip(&row[shift * ENDMEMBERS..]) {
                *sum += weight * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 128;

    /// A surface that is dark left of the middle and bright from it on.
    fn edge() -> Vec<Texel> {
        (0..SIDE * SIDE).map(|index| [if index % SIDE < SIDE / 2 { 0 } else { 8000 }; ENDMEMBERS]).collect()
    }

    /// Response at `x` to an edge at 0 through a uniform disc of radius `r`: the part of the disc beyond the edge,
    /// 1/2 + (x sqrt(r^2 - x^2) + r^2 asin(x / r)) / (pi r^2).
    fn edge_spread(x: f32, r: f32) -> f32 {
        let x = x.clamp(-r, r);
        0.5 + (x * (r * r - x * x).sqrt() + r * r * (x / r).asin()) / (std::f32::consts::PI * r * r)
    }

    #[test]
    fn an_edge_spreads_as_through_a_disc() {
        let stack = Stack::new(edge(), SIDE);
        for (radius, step) in LEVELS.into_iter().skip(2) {
            // The edge stands half a texel left of the first bright one. Coarse levels interpolate over their step.
            let worst = (40..88)
                .map(|x| {
                    let expected = edge_spread(x as f32 - (SIDE / 2) as f32 + 0.5, radius);
                    (stack.at(x as f32, 64.0, radius * radius)[0] / 8000.0 - expected).abs()
                })
                .fold(0.0, f32::max);

            assert!(worst < 0.02 + 0.005 * (step - 1) as f32, "radius {radius}: {worst}");
        }
    }

    #[test]
    fn between_levels_the_second_moment_is_that_of_the_disc_asked_for() {
        let mut point = vec![Texel::default(); SIDE * SIDE];
        point[64 * SIDE + 64] = [60_000; ENDMEMBERS];
        let stack = Stack::new(point, SIDE);
        for radius in [1.4_f32, 2.6, 3.3] {
            let mut sum = 0.0;
            let mut moment = 0.0;

            for index in 0..SIDE * SIDE {
                let x = (index % SIDE) as f32;
                let y = (index / SIDE) as f32;
                let value = stack.at(x, y, radius * radius)[0];
                sum += value;
                moment += value * (x - 64.0).powi(2);
            }

            // A uniform disc has a variance of r^2 / 4 along each axis.
            let expected = radius * radius / 4.0;
            assert!((moment / sum / expected - 1.0).abs() < 0.08, "radius {radius}: {} {expected}", moment / sum);
        }
    }

    #[test]
    fn blur_keeps_the_light() {
        let stack = Stack::new(vec![[4000; ENDMEMBERS]; SIDE * SIDE], SIDE);
        for square in [0.0, 0.6, 3.0, 20.0, 150.0, 289.0, 400.0] {
            assert!((stack.at(50.3, 70.7, square)[1] - 4000.0).abs() < 1.0, "{square}");
        }
    }

    #[test]
    fn a_stack_of_the_whole_scene_takes_under_48_megabytes() {
        let side = crate::simulation::phantom::SIDE;
        assert!(Stack::new(vec![Texel::default(); side * side], side).bytes() < 48 << 20);
    }
}
