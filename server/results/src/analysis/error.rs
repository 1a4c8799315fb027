//! Errors of the analysis.

use parfocal_records::store::StoreError;
use parfocal_records::store::export::ExportError;
use parfocal_trial::study::stage::Stage;

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
    /// The study is not unblinded.
    #[error(
        "study '{study}' is {stage}: it can be analysed once all of it is unblinded, which the people named in its \
         definition can do after it was locked", stage = stage.name()
    )]
    StillBlinded {
        /// Name of the study.
        study: String,
        /// Its stage.
        stage: Stage,
    },
    /// The tables could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}
