//! One picture of a focal stack, and why pictures are none.

use std::fmt::Display;
use std::io;
use std::path::Path;

use parfocal_devices::camera::footage::FootageError;
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

/// Why pictures are not a focal stack. The message says what is wrong, and where.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct StackError(pub(super) String);

impl StackError {
    /// The file at `path` is not a picture or list that can be used.
    pub(super) fn of(path: &Path, reason: impl Display) -> Self {
        Self(format!("{}: {reason}", path.display()))
    }

    /// The file at `path` cannot be read.
    pub(super) fn unreadable(path: &Path, error: &io::Error) -> Self {
        Self(format!("cannot read {}: {error}", path.display()))
    }
}

impl From<FootageError> for StackError {
    fn from(error: FootageError) -> Self {
        Self(error.to_string())
    }
}
