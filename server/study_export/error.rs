//! Why no study was exported.

use std::path::PathBuf;

use crate::package::PackageError;
use crate::store::StoreError;
use crate::store::export::ExportError;

/// Why no study was exported.
#[derive(Debug, thiserror::Error)]
pub enum StudyExportError {
    /// There is no such study.
    #[error("there is no study '{study}'; known are: {known}")]
    NoStudy {
        /// What was asked for.
        study: String,
        /// The studies that there are.
        known: String,
    },
    /// All sessions are withdrawn, or there is none yet.
    #[error("study '{0}' has no session to export")]
    NoSession(String),
    /// The policies are asked for too early.
    #[error("study '{0}' is not unblinded: export it without its policies, or unblind it first")]
    StillBlinded(String),
    /// A session could not be exported.
    #[error(transparent)]
    Session(#[from] ExportError),
    /// The exports could not be joined.
    #[error(transparent)]
    Package(#[from] PackageError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A folder could not be made.
    #[error("cannot write {}: {error}; see that it can be written and has room, and export again", .path.display())]
    Unwritable {
        /// Which.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The disk has too little room beside what the trial needs.
    #[error(
        "the disk of {} has no room for the export: {:.1} GB have to stay free for trials; \
         remove what is no longer needed there, and export again", .path.display(), *.reserve as f64 / 1e9
    )]
    NoRoom {
        /// Where it was to be written.
        path: PathBuf,
        /// Bytes that no export takes.
        reserve: u64,
    },
    /// A thread failed.
    #[error("the export ended before it was whole; export again, and report it if that happens again")]
    Broken,
}
