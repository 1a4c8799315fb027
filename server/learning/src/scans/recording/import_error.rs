//! Why a folder of pictures cannot be imported as a scan.

use std::io;
use std::path::PathBuf;

use super::RecordError;
use parfocal_devices::camera::recorded::{LEAST_SIDE, MOST_POSES, ScanError, poses};

/// Why a folder cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The folder cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Unreadable {
        /// Path that cannot be read.
        path: PathBuf,
        /// Error of the operating system.
        error: io::Error,
    },
    /// It holds no pictures of a scan.
    #[error("there is no picture named like pose0001_f0.350.png in {}", .0.display())]
    Empty(PathBuf),
    /// A file whose name makes no sense, or that is not a picture.
    #[error("{}: {reason}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Poses without any picture.
    #[error("there is no picture of {} in {}; pose numbers must have no gaps",
            poses(missing), folder.display())]
    MissingPoses {
        /// The folder to import.
        folder: PathBuf,
        /// Numbers of the poses.
        missing: Vec<usize>,
    },
    /// More poses than a scan may have.
    #[error("{} holds {poses} poses; a scan has at most {MOST_POSES}: import it in parts", folder.display())]
    TooMany {
        /// The folder to import.
        folder: PathBuf,
        /// Number of poses found.
        poses: usize,
    },
    /// A pose lacks a focal power that other poses have.
    #[error("pose {pose} has no picture at focal power {power:.3}, which other poses have")]
    MissingPower {
        /// Number of the incomplete pose.
        pose: usize,
        /// The missing focal power.
        power: f64,
    },
    /// All pictures are at one focal power.
    #[error("a scan needs at least two focal powers; every picture is at {0:.3}")]
    OnePower(f64),
    /// Pictures of different sizes.
    #[error("{} is {}x{} pixels, but {} is {}x{}; all pictures of a scan must have one size",
        other.display(), other_size.0, other_size.1, first.display(), size.0, size.1)]
    Sizes {
        /// The first picture.
        first: PathBuf,
        /// Its width and height in pixels.
        size: (usize, usize),
        /// A picture of another size.
        other: PathBuf,
        /// Its width and height in pixels.
        other_size: (usize, usize),
    },
    /// A picture is smaller than the least size.
    #[error("{} is {}x{} pixels; a scan's pictures must be at least {LEAST_SIDE}x{LEAST_SIDE}",
            path.display(), size.0, size.1)]
    TooSmall {
        /// Path of the file.
        path: PathBuf,
        /// Its width and height in pixels.
        size: (usize, usize),
    },
    /// A sample larger than its bits allow.
    #[error("{} holds a sample of {largest}, which is more than {bits} bit; give --bits {needed} or more",
            path.display())]
    Bits {
        /// Path of the file.
        path: PathBuf,
        /// The sample.
        largest: u16,
        /// Bits of a sample, as given by the user.
        bits: u8,
        /// Bits that it needs.
        needed: u8,
    },
    /// The scan cannot be stored.
    #[error(transparent)]
    Record(#[from] RecordError),
}

impl From<ScanError> for ImportError {
    fn from(error: ScanError) -> Self {
        Self::Record(error.into())
    }
}
