//! Why a recording is not played.

use crate::conductor::ConductError;

/// Why a recording is not played.
#[derive(Debug, thiserror::Error)]
pub enum PlaybackError {
    /// The session cannot be played by the one who asked.
    #[error(transparent)]
    Session(#[from] ConductError),
    /// There is no such recording or frame.
    #[error("{0}")]
    NotFound(String),
    /// It is there, but cannot be read.
    #[error("{0}")]
    Unreadable(String),
    /// The server ends.
    #[error("the server is ending")]
    Ending,
}
