//! Why a folder of pictures cannot be imported as a scan.

use std::io;
use std::path::PathBuf;

use super::RecordError;
use crate::camera::recorded::{LEAST_SIDE, MOST_POSES, ScanError, poses};
use crate::imaging::DecodeError;

/// Why a folder cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The folder cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Unreadable {
        /// The folder or file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// It holds no pictures of a scan.
    #[error("there is no picture named like pose0001_f0.350.png in {}", .0.display())]
    Empty(PathBuf),
    /// A name that cannot be meant.
    #[error("{}: {reason}", path.display())]
    Name {
        /// The file.
        path: PathBuf,
        /// What is wrong with its name.
        reason: String,
    },
    /// Poses without any picture.
    #[error("there is no picture of {} in {}; poses follow one another without a gap",
            poses(missing), folder.display())]
    MissingPoses {
        /// The folder.
        folder: PathBuf,
        /// Numbers of the poses.
        missing: Vec<usize>,
    },
    /// More poses than a scan may have.
    #[error("{} holds {poses} poses; a scan has at most {MOST_POSES}: import it in parts", folder.display())]
    TooMany {
        /// The folder.
        folder: PathBuf,
        /// Their number.
        poses: usize,
    },
    /// A pose without some of the others' focal powers.
    #[error("pose {pose} has no picture at focal power {power:.3}, which other poses have")]
    MissingPower {
        /// The pose's number.
        pose: usize,
        /// The focal power.
        power: f64,
    },
    /// A stack of one picture.
    #[error("a scan needs at least two focal powers; every picture is at {0:.3}")]
    OnePower(f64),
    /// Pictures of different sizes.
    #[error("{} is {}x{} pixels, but {} is {}x{}; all pictures of a scan must have one size",
        other.display(), other_size.0, other_size.1, first.display(), size.0, size.1)]
    Sizes {
        /// The first picture.
        first: PathBuf,
        /// Its width and height.
        size: (usize, usize),
        /// One that differs.
        other: PathBuf,
        /// Its width and height.
        other_size: (usize, usize),
    },
    /// Pictures too small to be of use.
    #[error("{} is {}x{} pixels; a scan's pictures must be at least {LEAST_SIDE}x{LEAST_SIDE}",
            path.display(), size.0, size.1)]
    TooSmall {
        /// The file.
        path: PathBuf,
        /// Its width and height.
        size: (usize, usize),
    },
    /// A file that is not a picture.
    #[error("{}: {error}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// Why.
        error: DecodeError,
    },
    /// It cannot be stored.
    #[error(transparent)]
    Record(#[from] RecordError),
}

impl From<ScanError> for ImportError {
    fn from(error: ScanError) -> Self {
        Self::Record(error.into())
    }
}
