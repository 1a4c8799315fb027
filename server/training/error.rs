//! Why a training ends without its weights.

use std::path::PathBuf;

use super::checkpoint::CheckpointError;

/// Why a training could not start or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The recipe does not fit the policy.
    #[error("{0}")]
    Recipe(String),
    /// A checkpoint cannot be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The run folder cannot be written.
    #[error("cannot write to {}: {source}", path.display())]
    Folder {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The weights to begin with cannot be used.
    #[error("cannot begin with the weights {}: {reason}", path.display())]
    Weights {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The weights came out damaged: the training diverged.
    #[error("the training diverged: {0}; lower the learning rate")]
    Diverged(String),
}
