//! Why a recording cannot be written or read.

use std::io;
use std::path::{Path, PathBuf};

use super::header::{FORMAT, VERSION};

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The folder already exists.
    #[error("{} exists; choose a new folder for the recording", .0.display())]
    Exists(PathBuf),
    /// There is no recording there.
    #[error("{} is not a recording: it has no zarr.json of the format {FORMAT}", .0.display())]
    NoRecording(PathBuf),
    /// It is a recording of the view, but mosaics are needed.
    #[error(
        "{} holds pictures of the view and no mosaics; `parfocal recording info` reads it, \
         and `ffmpeg -f mjpeg -i {}/view.mjpeg` makes a video of it",
        .0.display(),
        .0.display()
    )]
    View(PathBuf),
    /// It has another version of the format.
    #[error(
        "{} is a recording of format version {found}, but this parfocal reads version {VERSION}; \
         use the parfocal that made it",
        path.display()
    )]
    OtherVersion {
        /// The recording's folder.
        path: PathBuf,
        /// Its version of the format.
        found: u64,
    },
    /// The description is invalid.
    #[error("{} does not describe a recording: {reason}", path.display())]
    Nonsense {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
    /// A file is damaged.
    #[error("{}: {damage}; restore it from a copy, or leave these frames out", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        damage: Damage,
    },
    /// There is no such frame.
    #[error("{} has {frames} frames, counted from 0; there is no frame {asked}", path.display())]
    NoFrame {
        /// The recording's folder.
        path: PathBuf,
        /// Number of its frames.
        frames: usize,
        /// The frame that was asked for, from 0.
        asked: usize,
    },
    /// The disk is full.
    #[error("no space is left on the disk of {}: {kept} frames are saved", path.display())]
    Full {
        /// The recording's folder.
        path: PathBuf,
        /// Number of frames that are stored.
        kept: usize,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {error} ({kept} frames are saved)", path.display())]
    Unwritable {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
        /// Number of frames that are stored.
        kept: usize,
    },
    /// A frame has another size than the recording.
    #[error("the camera's frames changed from {}x{} to {}x{}; start another recording", of.0, of.1, found.0, found.1)]
    OtherSize {
        /// Width and height of the recording's mosaics, samples.
        of: (usize, usize),
        /// Width and height of the new frame, samples.
        found: (usize, usize),
    },
    /// A codec failed, which is an error of the program.
    #[error("the recording's codec failed: {0}")]
    Codec(String),
}

impl RecordingError {
    /// The error for `path` that could not be written, after `kept` frames were stored.
    #[must_use]
    pub fn unwritable(path: &Path, kept: usize, error: io::Error) -> Self {
        let path = path.to_owned();
        match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::Full { path, kept },
            _ => Self::Unwritable { path, error, kept },
        }
    }

    /// Turns a system's error into the one for `path` that could not be read.
    pub fn unreadable(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |error| Self::Unreadable { path, error }
    }

    /// The error for an invalid description in `path`.
    pub fn nonsense(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self::Nonsense { path: path.to_owned(), reason: reason.to_string() }
    }
}

/// What is wrong with a file of a recording, and which frames are affected. Frames count from 0.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Damage {
    /// The file of a shard is missing.
    #[error("the file is missing, so frames {first} to {last} are lost")]
    NoShard {
        /// First frame of the shard.
        first: usize,
        /// Last frame of the shard.
        last: usize,
    },
    /// A shard's index is cut off or does not match its checksum.
    #[error("its index is cut off or does not match its checksum, so frames {first} to {last} cannot be found in it")]
    Index {
        /// First frame of the shard.
        first: usize,
        /// Last frame of the shard.
        last: usize,
    },
    /// The shard holds no such frame.
    #[error("frame {0} is not in it")]
    Absent(usize),
    /// A frame does not match its checksum.
    #[error("frame {0} does not match its checksum")]
    Frame(usize),
    /// A picture of the view is cut off, or is not a JPEG picture.
    #[error("picture {0} is cut off, or is not a JPEG picture")]
    Picture(usize),
    /// Values beside the frames are missing or do not match their checksum; holds the column's name.
    #[error("the values of `{0}` are missing or do not match their checksum")]
    Column(&'static str),
}
