//! Why a study could not be exported.

use std::io;
use std::path::Path;

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
    /// The study is not in a state to be exported so.
    #[error("{0}")]
    Refused(String),
    /// A session could not be exported.
    #[error(transparent)]
    Session(#[from] ExportError),
    /// The disk, the database or the program failed. The message says what to do.
    #[error("{0}")]
    Failed(String),
}

impl StudyExportError {
    /// Makes an error about writing the folder `path`.
    pub(super) fn unwritable(path: &Path, error: &io::Error) -> Self {
        let path = path.display();
        Self::Failed(format!("cannot write {path}: {error}; see that it can be written and has room, and export again"))
    }

    /// Makes an error about a thread of the export that panicked.
    pub(super) fn broken() -> Self {
        Self::Failed(
            "the export ended before it was whole; export again, and report it if that happens again".to_owned(),
        )
    }
}

impl From<PackageError> for StudyExportError {
    fn from(error: PackageError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<StoreError> for StudyExportError {
    fn from(error: StoreError) -> Self {
        Self::Failed(error.to_string())
    }
}
