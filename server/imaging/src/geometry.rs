//! Places in a picture: the content area, and the patch that policies see.

use parfocal_base::PatchPlace;
use serde::Serialize;

/// Side of the patch in pixels of one band.
pub const PATCH_SIDE: usize = 32;

/// The bright circle of an endoscope's or exoscope's picture, in pixels of the picture it was found in (of one band,
/// for a mosaic), x and y from the top left.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContentArea {
    /// Centre, pixels from the left.
    pub x: f64,
    /// Centre, pixels from the top.
    pub y: f64,
    /// Radius, pixels.
    pub radius: f64,
    /// Sum of the inlying edge points' scores, divided by 32, the most candidates there can be. 0..=1.
    pub confidence: f64,
}

/// The patch's place and size, in pixels of the same picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct PatchArea {
    /// Left column.
    pub x: usize,
    /// Top row.
    pub y: usize,
    /// Always 32.
    pub width: usize,
    /// Always 32.
    pub height: usize,
}

/// The view of the paper's policies: 32x32 gray values on the 0..255 scale, row by row, from the centre
/// of the content area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch(pub [f32; PATCH_SIDE * PATCH_SIDE]);

/// A picture that is too small to hold a patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a {width}x{height} picture is smaller than the {PATCH_SIDE}x{PATCH_SIDE} patch")]
pub struct TooSmall {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

impl PatchArea {
    /// The patch at the centre of `content`, moved as little as needed to lie inside a `width` x
    /// `height` picture; at the picture's centre where there is no content area.
    ///
    /// # Errors
    /// If the picture is smaller than the patch.
    pub fn central(width: usize, height: usize, content: Option<&ContentArea>) -> Result<Self, TooSmall> {
        Self::at(PatchPlace::CENTRE, width, height, content)
    }

    /// The patch at `place` in `content`, moved as little as needed to lie inside a `width` x `height` picture. Where
    /// there is no content area, the largest circle around the picture's centre stands for it.
    ///
    /// # Errors
    /// If the picture is smaller than the patch.
    pub fn at(place: PatchPlace, width: usize, height: usize, content: Option<&ContentArea>) -> Result<Self, TooSmall> {
        if width < PATCH_SIDE || height < PATCH_SIDE {
            return Err(TooSmall { width, height });
        }

        let (x, y) = if content.is_none() && place == PatchPlace::CENTRE {
            ((width - PATCH_SIDE) / 2, (height - PATCH_SIDE) / 2)
        } else {
            let (middle_x, middle_y, radius) = circle(width, height, content);
            (start(middle_x + place.across() * radius, width), start(middle_y + place.down() * radius, height))
        };

        Ok(Self { x, y, width: PATCH_SIDE, height: PATCH_SIDE })
    }

    /// Whether `other` is at most half a patch away along each axis: what both show can still be compared.
    pub const fn is_near(self, other: Self) -> bool {
        2 * self.x.abs_diff(other.x) <= PATCH_SIDE && 2 * self.y.abs_diff(other.y) <= PATCH_SIDE
    }
}

/// The place in the bright circle `content` of the point `(x, y)`, in pixels of a `width` x `height` picture; `None` if
/// the point is outside the picture. A point outside the circle counts as the nearest one on it.
pub fn place_of(
    (x, y): (f64, f64),
    (width, height): (usize, usize),
    content: Option<&ContentArea>,
) -> Option<PatchPlace> {
    let inside = (0.0..=width as f64).contains(&x) && (0.0..=height as f64).contains(&y);
    let (middle_x, middle_y, radius) = circle(width, height, content);
    inside.then(|| PatchPlace::nearest((x - middle_x) / radius, (y - middle_y) / radius))
}

/// Centre and radius of the circle in which the patch has its place.
fn circle(width: usize, height: usize, content: Option<&ContentArea>) -> (f64, f64, f64) {
    match content {
        Some(area) => (area.x, area.y, area.radius.max(1.0)),
        None => (width as f64 / 2.0, height as f64 / 2.0, width.min(height).max(2) as f64 / 2.0),
    }
}

/// First pixel of a patch around `centre` that stays inside `0..length`.
fn start(centre: f64, length: usize) -> usize {
    // A float-to-integer cast saturates: a negative place becomes 0.
    let first = (centre - PATCH_SIDE as f64 / 2.0).round() as usize;
    first.min(length - PATCH_SIDE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(width: usize, height: usize, centre: Option<(f64, f64)>) -> (usize, usize) {
        let content = centre.map(|(x, y)| ContentArea { x, y, radius: 100.0, confidence: 1.0 });
        let area = PatchArea::central(width, height, content.as_ref()).unwrap();
        assert_eq!((area.width, area.height), (32, 32));
        (area.x, area.y)
    }

    #[test]
    fn the_patch_stands_at_the_centre() {
        assert_eq!(corner(512, 272, None), (240, 120));
        assert_eq!(corner(512, 272, Some((250.4, 130.6))), (234, 115));
    }

    #[test]
    fn the_patch_keeps_inside_the_picture() {
        assert_eq!(corner(512, 272, Some((3.0, 270.0))), (0, 240));
        assert_eq!(corner(512, 272, Some((-40.0, 1e9))), (0, 240));
        assert_eq!(corner(32, 32, Some((f64::NAN, 5.0))), (0, 0));
    }

    #[test]
    fn a_place_stays_where_it_was_seen_when_the_circle_moves_and_grows() {
        let circle = |x, y, radius| ContentArea { x, y, radius, confidence: 1.0 };
        let before = circle(256.0, 136.0, 100.0);
        let place = place_of((306.0, 111.0), (512, 272), Some(&before)).unwrap();
        assert_eq!((place.across(), place.down()), (0.5, -0.25));

        let corner = |content: Option<&ContentArea>| {
            let area = PatchArea::at(place, 512, 272, content).unwrap();
            (area.x, area.y)
        };
        assert_eq!(corner(Some(&before)), (306 - 16, 111 - 16));
        assert_eq!(corner(Some(&circle(246.0, 140.0, 120.0))), (246 + 60 - 16, 140 - 30 - 16));
        // Without a circle, the largest one around the centre counts: radius 136.
        assert_eq!(corner(None), (256 + 68 - 16, 136 - 34 - 16));
    }

    #[test]
    fn a_patch_leaves_the_circle_by_half_of_it_at_most() {
        let content = ContentArea { x: 256.0, y: 136.0, radius: 100.0, confidence: 1.0 };
        let place = place_of((500.0, 136.0), (512, 272), Some(&content)).unwrap();
        let area = PatchArea::at(place, 512, 272, Some(&content)).unwrap();
        assert_eq!((area.x + PATCH_SIDE / 2, area.y + PATCH_SIDE / 2), (356, 136));
    }

    #[test]
    fn a_point_outside_the_picture_has_no_place() {
        for point in [(-0.1, 5.0), (512.1, 5.0), (5.0, 272.5), (f64::NAN, 5.0), (5.0, f64::INFINITY)] {
            assert_eq!(place_of(point, (512, 272), None), None, "{point:?}");
        }
    }

    #[test]
    fn a_picture_smaller_than_the_patch_is_an_error() {
        let error = PatchArea::central(31, 64, None).unwrap_err();
        assert_eq!(error.to_string(), "a 31x64 picture is smaller than the 32x32 patch");
    }
}
