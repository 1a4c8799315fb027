//! Places in a picture: the content area, and the patch that policies see.

use serde::Serialize;

/// Side of the patch in pixels of one band.
pub const PATCH_SIDE: usize = 32;

/// The bright circle of an endoscope's or exoscope's picture, in pixels of the picture it was found in (of one band,
/// for a mosaic), x and y from the top left.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContentArea {
    /// Centre, rightwards.
    pub x: f64,
    /// Centre, downwards.
    pub y: f64,
    /// Radius.
    pub radius: f64,
    /// Sum of the inlying edge points' scores over 32.
    pub confidence: f64,
}

/// Where the patch was taken, in pixels of the same picture.
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

/// What every policy sees: 32x32 gray values on the 0..255 scale, row by row, from the centre of the content area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch(pub [f32; PATCH_SIDE * PATCH_SIDE]);
