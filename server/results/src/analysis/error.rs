//! Errors of the analysis.

use crate::package::PackageError;
use parfocal_records::store::StoreError;
use parfocal_records::store::export::ExportError;

/// The reason why there is no analysis.
#[derive(Debug, thiserror::Error)]
pub enum AnalysisError {
    /// There is no such study.
    #[error("there is no study '{study}'; there are: {known}")]
    NoStudy {
        /// The requested study.
        study: String,
        /// Names of the existing studies.
        known: String,
    },
    /// The study or package cannot be analysed, because its policies are not known or a file is damaged.
    #[error("{0}")]
    Refused(String),
    /// The tables could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl From<PackageError> for AnalysisError {
    fn from(error: PackageError) -> Self {
        Self::Refused(error.to_string())
    }
}
