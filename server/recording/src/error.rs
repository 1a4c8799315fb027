//! Why a recording cannot be written or read.

use std::fmt::Display;
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
    /// Anything else. The message names the file or folder, and says what to do.
    #[error("{0}")]
    Failed(String),
}

impl RecordingError {
    /// The error for `path` that could not be written, after `kept` frames were stored.
    pub fn unwritable(path: &Path, kept: usize, error: &io::Error) -> Self {
        let path = path.display();
        Self::Failed(match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                format!("no space is left on the disk of {path}: {kept} frames are saved")
            }
            _ => format!("cannot write {path}: {error} ({kept} frames are saved)"),
        })
    }

    /// The error for `folder`, which was deleted or moved while it was recorded into.
    pub(crate) fn moved(folder: &Path) -> Self {
        Self::Failed(format!("{} was deleted or moved away while it was recorded", folder.display()))
    }

    /// Turns a system's error into the one for `path` that could not be read.
    pub(crate) fn unreadable(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |error| Self::Failed(format!("cannot read {}: {error}", path.display()))
    }

    /// The error for an invalid description in `path`.
    pub(crate) fn nonsense(path: &Path, reason: impl Display) -> Self {
        Self::Failed(format!("{} does not describe a recording: {reason}", path.display()))
    }

    /// The error for a recording in `path` of version `found` of the format.
    pub(crate) fn other_version(path: &Path, found: u64) -> Self {
        Self::Failed(format!(
            "{} is a recording of format version {found}, but this parfocal reads version {VERSION}; \
             use the parfocal that made it",
            path.display()
        ))
    }

    /// The error for a damaged file: what is wrong with it, and which frames are affected. Frames count from 0.
    pub(crate) fn damaged(path: &Path, damage: impl Display) -> Self {
        let path = path.display();
        Self::Failed(format!("{path}: {damage}; restore it from a copy, or leave these frames out"))
    }

    /// The error of a thread that panicked with `message`.
    pub fn panicked(message: &str) -> Self {
        Self::Failed(format!("the program failed: {message}"))
    }

    /// The error for a codec that failed, which is an error of the program.
    pub(crate) fn codec(problem: impl Display) -> Self {
        Self::Failed(format!("the recording's codec failed: {problem}"))
    }
}
