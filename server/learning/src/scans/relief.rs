//! Scenes with relief, as focal stacks: folds, slopes, steps and things that stand above the
//! surface. Each place is blurred by its own distance to the focal plane, nearer things lie over
//! farther ones, and the lens's best picture is soft.
//!
//! Heights and positions of the focal plane are in pixels of blur: a place at height `h` is blurred
//! by a spot of standard deviation `|p - h|` with the focal plane at `p`.

use std::sync::Arc;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::photography::{Photography, PhotographyLimits};
use super::pictures::{Split, sharp_phantom_of};
use super::planes::PlaneStack;
use crate::LearningError;
use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_devices::simulation::spots::{LensSpot, blurred};
use parfocal_devices::simulation::texture::{Canvas, texture, vary_contrast};
use parfocal_imaging::GrayImage;

/// Side in pixels of a scene.
const SIDE: usize = 360;
/// Standard deviations in pixels at which each layer is blurred; between them pictures are mixed.
const SIGMAS: [f32; 12] = [0.0, 0.4, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 7.5, 9.5, 12.0];
/// The greatest of them.
const MOST_BLUR: f32 = SIGMAS[SIGMAS.len() - 1];
/// Greatest height of a place above or below the middle, in pixels of blur.
const MOST_RELIEF: f64 = 4.5;
/// Greatest softness of the best picture: standard deviation of its blur in pixels.
const MOST_SOFTNESS: f64 = 3.0;
/// Blur in pixels a unit of focal power: least and most of any scene.
const SLOPES: (f64, f64) = (1.5, 24.0);

/// Parameters that scenes are drawn with.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    /// Share of scenes without relief.
    flat: f64,
    /// Least relief of the others, in pixels of blur.
    least_relief: f64,
    /// Greatest share of the range that the relief takes from the middle: its height over the slope.
    most_share: f64,
    /// Greatest ratio of a scene's slope to its least slope.
    slopes: f64,
    /// Share of scenes with steps.
    steps: f64,
    /// Share of scenes that are photographed at few positions.
    photographed: f64,
    /// How those are photographed.
    manner: PhotographyLimits,
}

impl Style {
    /// What a policy may meet: from flat scenes without noise to deep relief, slow lenses and fast ones.
    const VARIED: Self = Self {
        flat: 0.15,
        least_relief: 0.3,
        most_share: 0.35,
        slopes: f64::INFINITY,
        steps: 0.6,
        photographed: 0.45,
        manner: PhotographyLimits { least_noise: 0.0, misplaced: 0.6, grainy: 0.4, followed: 0.4 },
    };

    /// As hard for the hill-climbers as photographed stacks: relief that takes most of the range.
    /// `docs/notebook.md` says how it was calibrated.
    const DEEP: Self = Self {
        flat: 0.0,
        least_relief: 2.0,
        most_share: 0.7,
        slopes: 1.3,
        steps: 1.0,
        photographed: 0.9,
        manner: PhotographyLimits { least_noise: 1.0, misplaced: 0.0, grainy: 0.0, followed: 0.0 },
    };

    /// The same, photographed less carefully: to train on.
    const DEEP_TO_TRAIN: Self =
        Self { manner: PhotographyLimits { least_noise: 1.0, ..Self::VARIED.manner }, ..Self::DEEP };
}

/// A focal stack to scan in training, and how steeply it may blur.
#[derive(Debug, Clone)]
pub struct StackScene {
    /// The pictures.
    pub planes: PlaneStack,
    /// Positions a unit of focal power, least and most.
    pub slopes: (f64, f64),
    /// What is in focus at the walking focal power.
    pub distance: Distance,
}

/// How far the hand that holds the lens is from the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distance {
    /// It keeps its distance from the ground, at position 0: the optimum moves with the hand and with the height of
    /// what comes into view. Beyond the stack's ends the blur no longer grows.
    Kept,
    /// It follows what is in view. So the sharpest position, smoothed over frames, is in focus at the walking focal
    /// power, as nearly as the stack's ends allow. Photographed stacks are scanned like this (`stack/drift.rs`).
    Following {
        /// Distance from one position to the next. In half of the scans the range moves by whole positions, as in
        /// `stack/drift.rs`.
        spacing: f64,
    },
}

/// The scenes `0..count` of `split`, every second one deep, the others varied. Each depends only on its number.
///
/// # Errors
/// None in practice: the scenes are large enough.
pub fn scenes(split: Split, count: u64) -> Result<Vec<Arc<StackScene>>, LearningError> {
    let style = |index: u64| if index.is_multiple_of(2) { Style::VARIED } else { Style::DEEP_TO_TRAIN };
    (0..count).into_par_iter().map(|index| scene(split, index, style(index)).map(Arc::new)).collect()
}

/// The scenes `0..count` of `split`, all of them deep: those of the reference benchmark with relief.
///
/// # Errors
/// None in practice: the scenes are large enough.
pub fn deep_scenes(split: Split, count: u64) -> Result<Vec<Arc<StackScene>>, LearningError> {
    (0..count).into_par_iter().map(|index| scene(split, index, Style::DEEP).map(Arc::new)).collect()
}

/// Scene `index` of `split`, drawn by `style`.
fn scene(split: Split, index: u64, style: Style) -> Result<StackScene, LearningError> {
    let seed = split.first_seed() + index;
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7265_6c69_6566);
    let softness = if rng.random_bool(0.3) { rng.random_range(0.0..0.6) } else { rng.random_range(0.0..MOST_SOFTNESS) };
    let relief =
        if rng.random_bool(style.flat) { 0.0 } else { rng.random_range(style.least_relief..MOST_RELIEF) as f32 };

    let ground = gaussian_blur(&surface(split, index, &mut rng), softness);
    let heights = heights(relief, style.steps, &mut rng);
    let above = rng.random_bool(0.6).then(|| things_above(seed, relief, softness, &mut rng));
    let spots = spots(&mut rng);
    let finish = Finish::draw(&mut rng);
    // A scene that is not photographed is shown at many positions and without defects: its pictures have only the
    // scan's own noise.
    let photography = rng.random_bool(style.photographed).then(|| Photography::draw(style.manner, MOST_BLUR, &mut rng));

    let ground = Layer::new(&ground, spots);
    let above = above.map(|RaisedStructures { colour, cover, height }| {
        // Gray levels are already multiplied by the cover, so what the things do not cover does not shine through their
        // blur.
        (Layer::new(&colour, spots), Layer::new(&cover, spots), height)
    });

    let picture = |position: f32| {
        let mut picture = ground.at_heights(position, &heights);
        if let Some((colour, cover, height)) = &above {
            let colour = colour.at(position - height);
            let cover = cover.at(position - height);
            for (value, (colour, cover)) in picture.iter_mut().zip(colour.iter().zip(&cover)) {
                *value = colour + (1.0 - cover / 255.0) * *value;
            }
        }

        (position, finish.apply(GrayImage { width: SIDE, height: SIDE, data: picture }))
    };

    let positions = photography.as_ref().map_or_else(close_positions, |taken| taken.positions(MOST_BLUR));
    let mut pictures: Vec<_> = positions.into_iter().map(picture).collect();
    let mut slope = softness.max(f64::from(relief) / style.most_share).max(SLOPES.0);
    let mut distance = Distance::Kept;
    if let Some(photography) = photography {
        photography.spoil(&mut pictures, &mut rng);
        slope = slope.max(photography.least_slope());
        if let Some(spacing) = photography.followed(style.manner, &mut rng) {
            distance = Distance::Following { spacing };
        }
    }

    let slopes = (slope, (style.slopes * slope).min(SLOPES.1));
    Ok(StackScene { planes: PlaneStack::new(&pictures)?, slopes, distance })
}

/// Positions of the focal plane. They lie closest together where blur changes the picture most.
fn close_positions() -> Vec<f32> {
    let steps = std::iter::repeat_n(0.25, 12).chain(std::iter::repeat_n(0.5, 6)).chain(std::iter::repeat_n(1.0, 6));

    let side: Vec<f32> = steps
        .scan(0.0, |at, step| {
            *at += step;
            Some(*at)
        })
        .collect();

    let below = side.iter().rev().map(|at| -at);
    below.chain([0.0]).chain(side.iter().copied()).collect()
}

/// The sharp picture of the ground.
fn surface(split: Split, index: u64, rng: &mut impl Rng) -> GrayImage {
    let seed = split.first_seed() + index;
    let mut picture =
        if index.is_multiple_of(4) { sharp_phantom_of(split, index, SIDE) } else { texture(seed ^ 0x67_726f, SIDE) };

    if rng.random_bool(0.5) {
        vary_contrast(&mut picture, rng.random_range(0.2..1.2), seed);
    }
    picture
}

/// The height of each place, `relief` at most above or below 0: a slope, folds, and steps in the share `steps` of
/// scenes.
fn heights(relief: f32, steps: f64, rng: &mut impl Rng) -> Vec<f32> {
    let mut field = Canvas::blank(SIDE);
    let middle = SIDE as f32 / 2.0;

    if rng.random_bool(0.7) {
        let cell = rng.random_range(40.0..160.0);
        field.add_octave(rng, cell, 1.0);
        let finer = rng.random_range(0.0..0.5);
        field.add_octave(rng, 0.5 * cell, finer);
    }

    if rng.random_bool(0.5) {
        let across = rng.random_range(-1.0f32..1.0);
        let down = rng.random_range(-1.0f32..1.0);
        for (index, height) in field.data.iter_mut().enumerate() {
            let x = (index % SIDE) as f32 / middle - 1.0;
            let y = (index / SIDE) as f32 / middle - 1.0;
            *height += across * x + down * y;
        }
    }

    if rng.random_bool(steps) {
        add_steps(&mut field, rng);
    }

    let most = field.data.iter().fold(1e-6f32, |most, height| most.max(height.abs()));
    field.data.iter_mut().for_each(|height| *height *= relief / most);
    field.data
}

/// Flat places above or below their surroundings, with vertical sides: blocks and discs.
fn add_steps(field: &mut Canvas, rng: &mut impl Rng) {
    for _ in 0..rng.random_range(3..30) {
        let x = rng.random_range(0..SIDE);
        let y = rng.random_range(0..SIDE);
        let wide = rng.random_range(15..110);
        let high = rng.random_range(15..110);
        let step = rng.random_range(-1.0f32..1.0);
        let round = rng.random_bool(0.4);

        for row in y..(y + high).min(SIDE) {
            for column in x..(x + wide).min(SIDE) {
                let across = (column - x) as f32 / wide as f32 - 0.5;
                let down = (row - y) as f32 / high as f32 - 0.5;
                if !round || across * across + down * down < 0.25 {
                    field.data[row * SIDE + column] = step;
                }
            }
        }
    }
}

/// Things that stand above the ground at one height: vessels, blocks.
struct RaisedStructures {
    /// Their gray levels times their cover.
    colour: GrayImage,
    /// How much of each pixel they cover, 0..=255.
    cover: GrayImage,
    height: f32,
}

fn things_above(seed: u64, relief: f32, softness: f64, rng: &mut impl Rng) -> RaisedStructures {
    let mut mask = Canvas::blank(SIDE);

    if rng.random_bool(0.6) {
        mask.add_winding_lines(rng, 3..14, 2.0..9.0, 1.0);
    } else {
        for _ in 0..rng.random_range(3..20) {
            let centre = (rng.random_range(0.0..SIDE as f32), rng.random_range(0.0..SIDE as f32));
            let radius = rng.random_range(5.0f32..45.0);
            let stretch = rng.random_range(0.4f32..2.5);
            mask.add_leaf(centre, radius, stretch, 1.0);
        }
    }

    let look = texture(seed ^ 0x0061_626f_7665, SIDE);
    let colour = look.data.iter().zip(&mask.data).map(|(value, cover)| value * cover).collect();
    let cover = mask.data.iter().map(|cover| 255.0 * cover).collect();

    let soft = |data| gaussian_blur(&GrayImage { width: SIDE, height: SIDE, data }, softness);
    RaisedStructures { colour: soft(colour), cover: soft(cover), height: relief * rng.random_range(0.2f32..1.0) }
}

/// The spots on the near and on the far side of focus.
fn spots(rng: &mut impl Rng) -> [LensSpot; 2] {
    let near = spot(rng);
    let far = if rng.random_bool(0.6) { near } else { spot(rng) };
    [near, far]
}

fn spot(rng: &mut impl Rng) -> LensSpot {
    if rng.random_bool(0.5) { LensSpot::Gaussian } else { LensSpot::Disc { rim: rng.random_range(-0.6f32..1.5) } }
}

/// A picture at each of [`SIGMAS`], on both sides of focus.
struct Layer {
    /// Those of the near side, then of the far side. The second is empty if both are the same.
    levels: [Vec<Vec<f32>>; 2],
}

impl Layer {
    fn new(picture: &GrayImage, spots: [LensSpot; 2]) -> Self {
        let blurred = |spot| SIGMAS.iter().map(|&sigma| blurred(picture, f64::from(sigma), spot).data).collect();
        let far = if spots[0] == spots[1] { Vec::new() } else { blurred(spots[1]) };
        Self { levels: [blurred(spots[0]), far] }
    }

    fn side(&self, distance: f32) -> &[Vec<f32>] {
        if distance < 0.0 && !self.levels[1].is_empty() { &self.levels[1] } else { &self.levels[0] }
    }

    /// The whole layer, `distance` away from the focal plane.
    fn at(&self, distance: f32) -> Vec<f32> {
        let levels = self.side(distance);
        let (level, share) = level(distance.abs());
        levels[level].iter().zip(&levels[level + 1]).map(|(low, high)| low + share * (high - low)).collect()
    }

    /// The layer with the focal plane at `position`, each place blurred by its own distance.
    fn at_heights(&self, position: f32, heights: &[f32]) -> Vec<f32> {
        let value = |(index, height): (usize, &f32)| {
            let distance = position - height;
            let levels = self.side(distance);
            let (level, share) = level(distance.abs());
            let low = levels[level][index];
            let high = levels[level + 1][index];
            low + share * (high - low)
        };
        heights.iter().enumerate().map(value).collect()
    }
}

/// The level of [`SIGMAS`] below `sigma`, and the share of the way to the next.
fn level(sigma: f32) -> (usize, f32) {
    let above = SIGMAS.partition_point(|&at| at <= sigma).clamp(1, SIGMAS.len() - 1);
    let low = SIGMAS[above - 1];
    let high = SIGMAS[above];

    (above - 1, ((sigma - low) / (high - low)).min(1.0))
}

/// What a camera does to its picture: gamma and sharpening.
struct Finish {
    gamma: Option<f32>,
    /// Share that is added of the difference between the picture and itself blurred by one pixel.
    sharpening: Option<f32>,
}

impl Finish {
    fn draw(rng: &mut impl Rng) -> Self {
        Self {
            gamma: rng.random_bool(0.3).then(|| rng.random_range(0.6f32..1.5)),
            sharpening: rng.random_bool(0.3).then(|| rng.random_range(0.2f32..1.5)),
        }
    }

    fn apply(&self, mut picture: GrayImage) -> GrayImage {
        if let Some(gamma) = self.gamma {
            picture.data.iter_mut().for_each(|value| *value = 255.0 * (value.max(0.0) / 255.0).powf(gamma));
        }
        if let Some(share) = self.sharpening {
            let soft = gaussian_blur(&picture, 1.0);
            let sharpen = |(value, soft): (&mut f32, &f32)| *value += share * (*value - soft);
            picture.data.iter_mut().zip(&soft.data).for_each(sharpen);
        }
        picture.data.iter_mut().for_each(|value| *value = value.clamp(0.0, 255.0));
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_mix_to_the_sigma_between_them() {
        for sigma in [0.0, 0.3, 1.2, 5.0, 11.9] {
            let (level, share) = level(sigma);
            let mixed = SIGMAS[level] + share * (SIGMAS[level + 1] - SIGMAS[level]);
            assert!((mixed - sigma).abs() < 1e-5, "{sigma} {mixed}");
        }
        assert_eq!(level(20.0), (SIGMAS.len() - 2, 1.0));
    }

    #[test]
    fn positions_rise_and_are_symmetric() {
        let positions = close_positions();
        assert!(positions.is_sorted_by(|a, b| a < b));
        assert!(positions.iter().zip(positions.iter().rev()).all(|(a, b)| (a + b).abs() < 1e-6));
        assert!((positions[0] + 12.0).abs() < 1e-6);
    }

    #[test]
    fn a_scene_is_sharpest_where_its_surface_lies() {
        // Two halves at different heights, without softness or anything above.
        let ground = texture(5, SIDE);
        let heights: Vec<f32> = (0..SIDE * SIDE).map(|i| if i % SIDE < SIDE / 2 { -2.0 } else { 1.5 }).collect();
        let layer = Layer::new(&ground, [LensSpot::Gaussian; 2]);
        let picture = |position: f32| {
            (position, GrayImage { width: SIDE, height: SIDE, data: layer.at_heights(position, &heights) })
        };

        let stack = PlaneStack::new(&close_positions().into_iter().map(picture).collect::<Vec<_>>()).unwrap();

        for y in [20, 100, 200, 300] {
            assert!((stack.sharpest((60, y)) + 2.0).abs() < 0.3, "{}", stack.sharpest((60, y)));
            assert!((stack.sharpest((260, y)) - 1.5).abs() < 0.3, "{}", stack.sharpest((260, y)));
        }
    }

    #[test]
    fn a_scene_is_reproducible_and_blurs_away_from_its_optimum() {
        let scene = || scene(Split::Training, 6, Style::VARIED).unwrap();
        let one = scene();
        let other = scene();
        assert_eq!(one.planes.patch((100, 100), 0.7), other.planes.patch((100, 100), 0.7));

        let best = one.planes.sharpest((100, 100));
        let sharpness = |position| parfocal_autofocus::mgm(&one.planes.patch((100, 100), position));
        assert!(sharpness(best) > sharpness(best + 6.0) && sharpness(best) > sharpness(best - 6.0));
    }
}
