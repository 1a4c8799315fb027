//! What a focal stack shows of the optic that took it: focus curves of several places, how fast blur grows with the
//! distance to the focus, how soft the sharpest picture is, and how magnification changes.

use serde::Serialize;

use super::check::{best, least_and_most, median, shift};
use super::{FocalStack, cropped};
use crate::scans::recorded::patch_at;
use parfocal_autofocus::mgm;
use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_imaging::{GrayImage, PATCH_SIDE, PatchArea};

/// Places along each axis whose focus curves are shown.
const PLACES: usize = 3;
/// Blurs, in pixels, that are applied to the sharpest picture to find how much another picture is blurred.
const BLURS: [f64; 12] = [0.0, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0];
/// Pixels around a patch that its blur needs.
const MARGIN: usize = 32;
/// A place is used if its least sharpness is below this share of its greatest.
const LEAST_FALL: f64 = 0.8;
/// One in this many of a place's pixels counts as an edge: those with the steepest gradients.
const EDGES: usize = 50;
/// Blur in pixels by which edges are blurred again to find how soft they are.
const AGAIN: f64 = 1.0;
/// Variance of the Sobel operator along an edge's normal (a box two pixels wide), pixels.
const SOBEL: f64 = 1.0 / 3.0;

/// The focus curve of one place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FocusCurve {
    /// Left end of its 32x32 pixels.
    pub x: usize,
    /// Upper end of its 32x32 pixels.
    pub y: usize,
    /// Position of its sharpest picture.
    pub best: f64,
    /// Mean gradient magnitude in each picture.
    pub sharpness: Vec<f64>,
}

/// What is known about an optic. A figure is `None` if the pictures do not show it.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct StackOptics {
    /// Focus curves.
    pub places: Vec<FocusCurve>,
    /// Pixels of blur (standard deviation) a unit of position away from the sharpest picture.
    pub blur_per_unit: Option<f64>,
    /// Blur of the sharpest picture, pixels (standard deviation).
    pub softness: Option<f64>,
    /// Share by which magnification grows from the first picture to the last.
    pub magnification: Option<f64>,
}

impl StackOptics {
    /// Measures all figures that `stack` shows.
    pub fn of(stack: &FocalStack) -> Self {
        Self { magnification: magnification(stack), ..Self::of_focus(stack) }
    }

    /// As [`StackOptics::of`], but without magnification, which takes longer than all the rest.
    pub fn of_focus(stack: &FocalStack) -> Self {
        let (width, height) = stack.size();
        let corner = |side: usize, index: usize| (side - PATCH_SIDE) * (2 * index + 1) / (2 * PLACES);
        let corners = (0..PLACES).flat_map(|row| (0..PLACES).map(move |column| (column, row)));
        let corners = corners.map(|(column, row)| (corner(width, column), corner(height, row)));

        let mut optics = Self::default();
        let mut rates = Vec::new();
        let mut softnesses = Vec::new();
        for (x, y) in corners {
            let (place, best) = curve(stack, x, y);
            let (least, most) = least_and_most(&place.sharpness);
            if least < LEAST_FALL * most {
                rates.extend(rate(stack, &place, best));
                softnesses.extend(softness(&stack.planes()[best].picture, x, y));
            }

            optics.places.push(place);
        }

        optics.blur_per_unit = median(rates);
        optics.softness = median(softnesses);
        optics
    }

    /// Combines several stacks of one optic: all places, and the medians of the figures.
    pub fn together(all: Vec<Self>) -> Self {
        let figure = |value: fn(&Self) -> Option<f64>| median(all.iter().filter_map(value).collect());
        let [blur_per_unit, softness, magnification] =
            [figure(|o| o.blur_per_unit), figure(|o| o.softness), figure(|o| o.magnification)];
        Self { places: all.into_iter().flat_map(|o| o.places).collect(), blur_per_unit, softness, magnification }
    }
}

fn metric(picture: &GrayImage, x: usize, y: usize) -> f64 {
    mgm(&patch_at(picture, PatchArea { x, y, width: PATCH_SIDE, height: PATCH_SIDE }))
}

/// The focus curve at a place, and the index of its sharpest picture.
fn curve(stack: &FocalStack, x: usize, y: usize) -> (FocusCurve, usize) {
    let sharpness: Vec<f64> = stack.planes().iter().map(|plane| metric(&plane.picture, x, y)).collect();
    let best = best(&sharpness);
    (FocusCurve { x, y, best: stack.planes()[best].position, sharpness }, best)
}

/// Pixels of blur per unit of position, from each picture: the sharpest picture is blurred until it is as sharp as that
/// one.
fn rate(stack: &FocalStack, curve: &FocusCurve, best: usize) -> Vec<f64> {
    let (around, x, y) = surroundings(&stack.planes()[best].picture, curve.x, curve.y);
    let blurred: Vec<f64> = BLURS.iter().map(|&blur| metric(&gaussian_blur(&around, blur), x, y)).collect();

    let blur = |sharpness: f64| {
        let after = blurred.iter().position(|&value| value <= sharpness)?;
        let before = after.checked_sub(1)?;
        let part = (blurred[before] - sharpness) / (blurred[before] - blurred[after]).max(1e-9);
        Some(BLURS[before] + part * (BLURS[after] - BLURS[before]))
    };

    // The pictures beside the sharpest one are hardly blurred, so rounding and noise would decide there.
    let far = |index: &usize| index.abs_diff(best) >= 2;
    let numbers = (0..curve.sharpness.len()).filter(far);
    let pairs = numbers.filter_map(|index| Some((blur(curve.sharpness[index])?, stack.planes()[index].position)));
    pairs.map(|(blur, position)| blur / (position - curve.best).abs()).collect()
}

/// The part of `picture` around the patch at (`x`, `y`), and where the patch is in it.
fn surroundings(picture: &GrayImage, x: usize, y: usize) -> (GrayImage, usize, usize) {
    let left = x.saturating_sub(MARGIN);
    let top = y.saturating_sub(MARGIN);
    let right = (x + PATCH_SIDE + MARGIN).min(picture.width);
    let bottom = (y + PATCH_SIDE + MARGIN).min(picture.height);

    (cropped(picture, (left, top), (right - left, bottom - top)), x - left, y - top)
}

/// How soft the edges at a place are, from the ratio of their gradients before and after blurring them again (Zhuo and
/// Sim 2011).
fn softness(picture: &GrayImage, x: usize, y: usize) -> Option<f64> {
    let (around, x, y) = surroundings(picture, x, y);
    let again = gaussian_blur(&around, AGAIN);

    let inner = |side: usize, corner: usize| corner.max(1)..(corner + PATCH_SIDE).min(side - 1);
    let places = inner(around.height, y).flat_map(|y| inner(around.width, x).map(move |x| (x, y)));
    let mut edges: Vec<(f64, f64)> = places.map(|(x, y)| (gradient(&around, x, y), gradient(&again, x, y))).collect();
    edges.sort_by(|a, b| b.0.total_cmp(&a.0));
    edges.truncate(edges.len() / EDGES);

    let soft = |(before, after): (f64, f64)| {
        let ratio = before / after;
        (ratio > 1.0).then(|| (AGAIN * AGAIN / (ratio * ratio - 1.0) - SOBEL).max(0.0).sqrt())
    };

    median(edges.into_iter().filter_map(soft).collect())
}

/// Gradient magnitude by the Sobel operator at a place inside `picture`.
fn gradient(picture: &GrayImage, x: usize, y: usize) -> f64 {
    let at = |dx: usize, dy: usize| picture.data[(y + dy - 1) * picture.width + x + dx - 1];
    let across = at(2, 0) - at(0, 0) + 2.0 * (at(2, 1) - at(0, 1)) + at(2, 2) - at(0, 2);
    let down = at(0, 2) - at(0, 0) + 2.0 * (at(1, 2) - at(1, 0)) + at(2, 2) - at(2, 0);
    f64::from(across.hypot(down))
}

/// How magnification grows from the first picture to the last. Measured by how the left and right thirds, and the upper
/// and lower ones, move apart from picture to picture.
fn magnification(stack: &FocalStack) -> Option<f64> {
    /// Farthest shift from one picture to the next, pixels.
    const FARTHEST: isize = 3;
    let (width, height) = stack.size();
    if width < 60 || height < 60 {
        return None;
    }

    let mut growth = 1.0;
    for pair in stack.planes().windows(2) {
        let moved = |left: usize, top: usize, size: (usize, usize)| {
            let [before, after] = [&pair[0], &pair[1]].map(|plane| cropped(&plane.picture, (left, top), size));
            shift(&before, &after, FARTHEST)
        };
        let third = width / 3;
        let two_thirds = width - width / 3;
        let across = moved(two_thirds, 0, (third, height)).0 - moved(0, 0, (third, height)).0;

        let low = height / 3;
        let high = height - height / 3;
        let down = moved(0, high, (width, low)).1 - moved(0, 0, (width, low)).1;

        growth *= 1.0 + 0.5 * (across / two_thirds as f64 + down / high as f64);
    }
    Some(growth - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scans::stack::Plane;
    use parfocal_devices::simulation::texture::texture;

    const SIDE: usize = 192;

    fn stack(picture: impl Fn(usize) -> GrayImage) -> FocalStack {
        let plane =
            |index: usize| Plane { name: index.to_string(), position: 0.1 * index as f64, picture: picture(index) };
        FocalStack::new((0..11).map(plane).collect()).unwrap()
    }

    #[test]
    fn blur_a_unit_is_what_the_pictures_were_blurred_with() {
        // 6 pixels a unit, sharpest at 0.5.
        let sharp = texture(8, SIDE);
        let optics = StackOptics::of(&stack(|index| gaussian_blur(&sharp, 0.6 * (index as f64 - 5.0).abs())));
        let blur = optics.blur_per_unit.unwrap();
        assert!((blur / 6.0 - 1.0).abs() < 0.1, "{blur}");
        assert!(optics.places.iter().all(|place| (place.best - 0.5).abs() < 1e-9));
        assert!(optics.magnification.unwrap().abs() < 0.002, "{:?}", optics.magnification);
    }

    #[test]
    fn softness_is_that_of_blurred_edges() {
        let squares = |i: usize| if (i % SIDE / 16 + i / SIDE / 16).is_multiple_of(2) { 60.0 } else { 180.0 };
        let sharp = GrayImage { width: SIDE, height: SIDE, data: (0..SIDE * SIDE).map(squares).collect() };
        for soft in [1.0, 2.0, 3.0] {
            let blur = |index: usize| (1.6 * (index as f64 - 5.0)).hypot(soft);
            let found = StackOptics::of(&stack(|index| gaussian_blur(&sharp, blur(index)))).softness.unwrap();
            assert!((found / soft - 1.0).abs() < 0.15, "{found} instead of {soft}");
        }
    }

    #[test]
    fn growing_pictures_have_growing_magnification() {
        // By 0.4 % from picture to picture, about the middle.
        let sharp = gaussian_blur(&texture(8, SIDE), 1.5);
        let sample = |x: f64, y: f64| {
            let clamped = |v: f64| v.clamp(0.0, SIDE as f64 - 1.001);
            let x = clamped(x);
            let y = clamped(y);
            let left = x as usize;
            let top = y as usize;
            let at = |dx, dy| f64::from(sharp.data[(top + dy) * SIDE + left + dx]);
            let fx = x - left as f64;
            let fy = y - top as f64;
            (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy) + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
        };

        let zoomed = |index: usize| {
            let zoom = 1.004f64.powf(index as f64);
            let centre = SIDE as f64 / 2.0;
            let place = |v: usize| centre + (v as f64 - centre) / zoom;
            let data = (0..SIDE * SIDE).map(|i| sample(place(i % SIDE), place(i / SIDE)) as f32).collect();
            GrayImage { width: SIDE, height: SIDE, data }
        };

        let found = StackOptics::of(&stack(zoomed)).magnification.unwrap();
        assert!((found / 0.0407 - 1.0).abs() < 0.2, "{found}");
    }
}
