//! Why there is no analysis.

use crate::store::StoreError;
use crate::store::export::ExportError;
use crate::trial::study::stage::Stage;

/// Why there is no analysis.
#[derive(Debug, thiserror::Error)]
pub enum AnalysisError {
    /// There is no such study.
    #[error("there is no study '{study}'; there are: {known}")]
    NoStudy {
        /// The study asked for.
        study: String,
        /// The studies there are.
        known: String,
    },
    /// It is not unblinded.
    #[error(
        "study '{study}' is {stage}: it can be analysed once all of it is unblinded, which the people named in its \
         definition can do after it was locked", stage = stage.name()
    )]
    StillBlinded {
        /// The study.
        study: String,
        /// How far it has come.
        stage: Stage,
    },
    /// The tables could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}
