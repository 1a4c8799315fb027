//! Why a study could not be exported.

use std::path::PathBuf;

use crate::package::PackageError;
use parfocal_records::store::StoreError;
use parfocal_records::store::export::ExportError;

/// Why a study could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum StudyExportError {
    /// There is no such study.
    #[error("there is no study '{study}'; known are: {known}")]
    NoStudy {
        /// Name of the requested study.
        study: String,
        /// Names of the existing studies.
        known: String,
    },
    /// All sessions of the study are withdrawn, or there are none yet.
    #[error("study '{0}' has no session to export")]
    NoSession(String),
    /// The policies were requested before the study was unblinded.
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
        /// Path of the folder.
        path: PathBuf,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The disk has too little space in addition to the reserve for trials.
    #[error(
        "the disk of {} has no room for the export: {:.1} GB have to stay free for trials; \
         remove what is no longer needed there, and export again", .path.display(), *.reserve as f64 / 1e9
    )]
    NoRoom {
        /// Folder in which the export was to be written.
        path: PathBuf,
        /// Reserve in bytes, which exports never use.
        reserve: u64,
    },
    /// A thread of the export panicked.
    #[error("the export ended before it was whole; export again, and report it if that happens again")]
    Broken,
}
