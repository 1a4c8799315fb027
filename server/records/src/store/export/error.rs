//! Why nothing was exported.

use std::path::PathBuf;

use jiff::Timestamp;

use crate::store::StoreError;
use parfocal_base::ids::SessionId;

/// Why nothing was exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// There is no such session.
    #[error("there is no session {session}; there are: {known}")]
    NoSession {
        /// The session asked for.
        session: SessionId,
        /// The sessions that exist, as text.
        known: String,
    },
    /// Policies were asked for before unblinding.
    #[error("session {0} has not been unblinded: unblind it on the researcher's page first, or export it blinded")]
    StillBlinded(SessionId),
    /// The participant withdrew.
    #[error(
        "session {session} was withdrawn by the {by} on {at:.0}: its data stay out of exports; exports of other \
         sessions of its protocol tell that it was withdrawn, and its place"
    )]
    Withdrawn {
        /// The withdrawn session.
        session: SessionId,
        /// When the withdrawal was recorded.
        at: Timestamp,
        /// The role that recorded it.
        by: &'static str,
    },
    /// The folder to write is not empty, or a file has its name.
    #[error("{} exists and is not empty; choose a new folder", .0.display())]
    Exists(PathBuf),
    /// Each time that the export was about to be read, something else had been recorded.
    #[error("the session is being written to without a pause; try again")]
    Busy,
    /// A file could not be written.
    #[error("cannot write {}: {error}", .path.display())]
    Unwritable {
        /// Path of the file.
        path: PathBuf,
        /// The error of the file system.
        error: std::io::Error,
    },
    /// The database failed.
    #[error("{0}")]
    Store(#[from] StoreError),
}
