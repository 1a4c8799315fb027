//! One picture of a focal stack, and why pictures are none.

use std::path::PathBuf;

use parfocal_devices::camera::footage;
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

/// Why pictures are not a focal stack.
#[derive(Debug, thiserror::Error)]
pub enum StackError {
    /// The folder cannot be read, or has no pictures.
    #[error(transparent)]
    Folder(#[from] footage::FootageError),
    /// A picture cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file is not a picture, its pages are not a stack, or the list of positions makes no sense.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// One raw mosaic.
    #[error("{} is one raw mosaic; a focal stack is a folder of at least {LEAST_PLANES}", .0.display())]
    OneMosaic(PathBuf),
    /// Too few pictures.
    #[error(
        "a focal stack needs at least {LEAST_PLANES} pictures at different positions, but has {0}; \
         take more between them"
    )]
    TooFew(usize),
    /// Pictures of different sizes.
    #[error("{other} is {}x{} pixels, but {first} is {}x{}; all pictures of a stack must have one size",
            sizes[1].0, sizes[1].1, sizes[0].0, sizes[0].1)]
    Sizes {
        /// The first picture.
        first: String,
        /// A picture of another size.
        other: String,
        /// Width and height of each, in pixels.
        sizes: [(usize, usize); 2],
    },
    /// Two pictures at one position.
    #[error("{first} and {second} are both at position {position}; leave one out")]
    Twice {
        /// One picture.
        first: String,
        /// The other.
        second: String,
        /// Position of both.
        position: f64,
    },
    /// Positions that do not fit a regular grid.
    #[error(
        "the positions are too uneven: with steps of {step}, the least between two pictures, {found} \
         of {of} places would have a picture; take pictures at even distances"
    )]
    Uneven {
        /// Least distance between two pictures.
        step: f64,
        /// Places with a picture.
        found: usize,
        /// Number of places on the grid.
        of: usize,
    },
    /// The pictures do not show a focal stack.
    #[error("{0}")]
    Unfit(String),
}
