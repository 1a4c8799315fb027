//! Why a recording cannot be played.

use crate::conductor::ConductError;
use parfocal_imaging::BadCircle;

/// Why a recording cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum PlaybackError {
    /// The session's recordings may not be played, or the session could not be loaded.
    #[error(transparent)]
    Session(#[from] ConductError),
    /// There is no such recording or frame.
    #[error("{0}")]
    NotFound(String),
    /// There is no such place in a picture.
    #[error(transparent)]
    Place(#[from] BadCircle),
    /// The recording exists, but cannot be read.
    #[error("{0}")]
    Unreadable(String),
    /// The server is shutting down.
    #[error("the server is ending")]
    Ending,
}
