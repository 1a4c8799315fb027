//! Errors that end a training.

use std::io;
use std::path::{Path, PathBuf};

use super::run::checkpoint::{CHECKPOINT, CheckpointError};
use crate::scans::bench::BenchError;
use crate::scans::detail::NothingToFocusOn;
use crate::scans::footage::FootageError;

/// Why a training could not start or continue.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The recipe does not fit the policy.
    #[error("{0}")]
    Recipe(String),
    /// A checkpoint cannot be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The footage cannot be used.
    #[error(transparent)]
    Footage(#[from] FootageError),
    /// The recordings of the bench cannot be used.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// The footage shows nothing to focus on.
    #[error(transparent)]
    Blank(#[from] NothingToFocusOn),
    /// The request to resume differs from how the training was begun.
    #[error("{0}")]
    Differs(String),
    /// The run folder cannot be written.
    #[error("cannot write to {}: {source}; choose a folder that you can write to, or make this one writable",
            path.display())]
    Folder {
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The disk or quota of the run folder is full.
    #[error(
        "the disk is too full to write {}; make room, then {}",
        path.display(),
        if *checkpoint { "continue from the last checkpoint with --resume" } else { "start again in a new folder" }
    )]
    Full {
        /// The file that could not be written.
        path: PathBuf,
        /// Whether the run folder has a checkpoint.
        checkpoint: bool,
    },
    /// A file of the run folder cannot be read.
    #[error("cannot read {}: {source}; it belongs to the training and must stay where it is", path.display())]
    Unreadable {
        /// The file that could not be read.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The folder for a new training already holds one.
    #[error("{} already holds a training; continue it with --resume, or choose another folder", .0.display())]
    Begun(PathBuf),
    /// The folder for a new training holds something else.
    #[error("{} holds other files, or a training that ended before its first checkpoint; \
             choose a new or empty folder", .0.display())]
    Occupied(PathBuf),
    /// Another process is training in the folder.
    #[error("another training is running in {}; choose another folder, or wait until it ends", .0.display())]
    Busy(PathBuf),
    /// There is no checkpoint in the folder.
    #[error("{} has no checkpoint to continue from; check the folder, or start again without --resume", .0.display())]
    NothingToResume(PathBuf),
    /// The weights to begin with, or to evaluate, cannot be used.
    #[error("cannot use the weights {}: {reason}", path.display())]
    Weights {
        /// The file of the weights.
        path: PathBuf,
        /// What is wrong with them.
        reason: String,
    },
    /// The training diverged, for example to weights that are not finite.
    #[error("the training diverged: {0}; lower the learning rate")]
    Diverged(String),
}

impl TrainError {
    /// Turns an I/O error from writing `path` into [`Self::Full`] or [`Self::Folder`].
    pub(super) fn writing(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                let checkpoint = path.join(CHECKPOINT).exists() || path.with_file_name(CHECKPOINT).exists();
                Self::Full { path, checkpoint }
            }
            _ => Self::Folder { path, source },
        }
    }
}
