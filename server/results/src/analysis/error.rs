//! Errors of the analysis.

use std::path::PathBuf;

use crate::package::PackageError;
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
    /// A package does not contain the policies.
    #[error(
        "{} does not contain the policies: export the study with --unblinded once all of it is unblinded, and join it \
         again", .0.display()
    )]
    BlindedPackage(PathBuf),
    /// An export in a package was made before its site unblinded the study.
    #[error(
        "{} cannot be analysed: {} was exported while the study was {stage} at site '{site}'; unblind the study there, \
         export it again and join it again", .package.display(), .export.display()
    )]
    ExportedBefore {
        /// The package.
        package: PathBuf,
        /// The export in it.
        export: PathBuf,
        /// The site of the export.
        site: String,
        /// Stage of the study at the time of the export.
        stage: String,
    },
    /// A package could not be read.
    #[error(transparent)]
    Package(#[from] PackageError),
    /// The tables could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}
