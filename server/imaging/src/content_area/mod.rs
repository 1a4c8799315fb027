//! Finding the content area: the bright circle that the optics draw on the sensor.
//!
//! The classical method of Budd et al., "Rapid and robust endoscopic content area estimation" (2023), public as
//! torch-content-area, with its published constants.

mod circle;
mod edges;

use super::frame::GrayImage;
use super::geometry::ContentArea;
use circle::Circle;

/// Confidence below which a circle counts as chance.
const LEAST_CONFIDENCE: f64 = 0.06;

/// Largest distance of the centre from the picture's centre, in widths of the picture.
const CENTRE_WITHIN: f64 = 0.2;

/// Range of the radius, in widths of the picture.
const RADIUS: (f64, f64) = (0.2, 0.8);

/// Finds the content area of `gray`; `None` if there is no circle, or too little of it to be sure.
///
/// The same picture always gives the same answer.
pub fn detect(gray: &GrayImage) -> Option<ContentArea> {
    let width = gray.width as f64;
    let height = gray.height as f64;

    let valid = |circle: &Circle| {
        let off_centre = (circle.x - width / 2.0).hypot(circle.y - height / 2.0);
        off_centre < CENTRE_WITHIN * width && RADIUS.0 * width < circle.radius && circle.radius < RADIUS.1 * width
    };

    let (circle, score) = circle::find(&edges::find(gray), valid)?;
    let confidence = score / edges::CANDIDATES;
    let Circle { x, y, radius } = circle;
    (confidence >= LEAST_CONFIDENCE).then_some(ContentArea { x, y, radius, confidence })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, value: impl Fn(f64, f64) -> f64) -> GrayImage {
        let data = (0..width * height).map(|i| value((i % width) as f64, (i / width) as f64) as f32).collect();
        GrayImage::new(width, height, data).unwrap()
    }

    /// Texture that never repeats, 0..=1.
    fn texture(x: f64, y: f64) -> f64 {
        0.5 + 0.25 * (x * 0.9 + (y * 0.31).sin() * 3.0).sin() + 0.25 * (y * 0.7 + (x * 0.23).cos() * 4.0).cos()
    }

    /// A textured disc on near-black.
    fn disc(width: usize, height: usize, (x, y, radius): (f64, f64, f64)) -> GrayImage {
        picture(width, height, |column, row| {
            let inside = ((radius - (column - x).hypot(row - y)) / 1.5).clamp(0.0, 1.0);
            3.0 + 2.0 * texture(column, row) + inside * (70.0 + 120.0 * texture(column, row))
        })
    }

    #[test]
    fn finds_the_circle_it_is_shown() {
        for (width, height, circle) in [
            (512, 272, (256.0, 136.0, 150.0)),
            (512, 272, (230.0, 150.0, 190.0)),
            (1280, 720, (660.0, 350.0, 330.0)),
            (1920, 1080, (900.0, 600.0, 800.0)),
        ] {
            let found = detect(&disc(width, height, circle)).expect("a circle");
            let off = (found.x - circle.0).abs().max((found.y - circle.1).abs()).max((found.radius - circle.2).abs());
            assert!(off < 4.0, "{circle:?} {found:?}");
        }
    }

    #[test]
    fn finds_none_where_there_is_none() {
        assert_eq!(detect(&picture(512, 272, |_, _| 0.0)), None);
        assert_eq!(detect(&picture(512, 272, |_, _| 255.0)), None);
        assert_eq!(detect(&picture(512, 272, |x, y| 255.0 * texture(x, y))), None);
        assert_eq!(detect(&picture(512, 272, |x, y| 60.0 + 100.0 * texture(x, y))), None);
        assert_eq!(detect(&picture(512, 272, |x, _| x / 2.0)), None, "a ramp");
    }

    #[test]
    fn a_circle_that_is_too_small_or_off_centre_is_none() {
        assert_eq!(detect(&disc(512, 272, (256.0, 136.0, 60.0))), None);
        assert_eq!(detect(&disc(512, 272, (80.0, 136.0, 150.0))), None);
    }

    #[test]
    fn pictures_of_no_size_are_none() {
        for (width, height) in [(0, 0), (1, 1), (7, 2), (7, 3), (6, 400)] {
            assert_eq!(detect(&picture(width, height, |x, y| 200.0 * texture(x, y))), None);
        }
    }
}
