//! One picture of a focal stack.

use parfocal_imaging::GrayImage;

/// Least number of pictures in which a peak and an order can be recognised.
pub const LEAST_PLANES: usize = 5;

/// One picture of a stack.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Its file's name.
    pub name: String,
    /// Position of the focus, in the unit of the names or the list.
    pub position: f64,
    /// The picture, in gray levels.
    pub picture: GrayImage,
}
