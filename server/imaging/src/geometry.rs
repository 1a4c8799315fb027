//! Places in a picture: the content area, and the patch that policies see.

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
        if width < PATCH_SIDE || height < PATCH_SIDE {
            return Err(TooSmall { width, height });
        }

        let (x, y) = match content {
            Some(area) => (start(area.x, width), start(area.y, height)),
            None => ((width - PATCH_SIDE) / 2, (height - PATCH_SIDE) / 2),
        };

        Ok(Self { x, y, width: PATCH_SIDE, height: PATCH_SIDE })
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
    fn a_picture_smaller_than_the_patch_is_an_error() {
        let error = PatchArea::central(31, 64, None).unwrap_err();
        assert_eq!(error.to_string(), "a 31x64 picture is smaller than the 32x32 patch");
    }
}
