//! Why no package was made.

use std::path::PathBuf;

/// Why no package was made.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// A folder is neither an export of a session nor a package of a study.
    #[error("{} is neither the export of a session nor the package of a study", .0.display())]
    NotAnExport(PathBuf),
    /// An export does not verify.
    #[error("{} is not as it was exported: {check}: {problem}; export it again", .folder.display())]
    Unverified {
        /// The export.
        folder: PathBuf,
        /// The check that failed.
        check: String,
        /// What it found.
        problem: String,
    },
    /// An export was written by another version.
    #[error(
        "{} has format {found}, and this version of parfocal writes format {expected}: export it again with this \
         version, so that all sites have the same columns",
        .folder.display()
    )]
    OtherFormat {
        /// The export.
        folder: PathBuf,
        /// Its format.
        found: u64,
        /// The format of this version.
        expected: u64,
    },
    /// A session belongs to no study.
    #[error("{} is of a session outside any study", .0.display())]
    OutsideAnyStudy(PathBuf),
    /// Two exports do not belong together.
    #[error("{} and {} do not belong together: {reason}", .one.display(), .other.display())]
    Apart {
        /// The first export.
        one: PathBuf,
        /// An export that does not fit it.
        other: PathBuf,
        /// Why not.
        reason: String,
    },
    /// There is nothing to join.
    #[error("{} has no session to join", .0.display())]
    Empty(PathBuf),
    /// The folder to write holds something.
    #[error("{} exists and is not empty; choose a new folder", .0.display())]
    Exists(PathBuf),
    /// A file could not be read.
    #[error("cannot read {}: {reason}", .path.display())]
    Unreadable {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file could not be written.
    #[error("cannot write {}: {reason}", .path.display())]
    Unwritable {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

impl PackageError {
    /// For reading `path`.
    pub(super) fn unreadable<E: std::fmt::Display>(path: impl Into<PathBuf>) -> impl FnOnce(E) -> Self {
        let path = path.into();
        move |error| Self::Unreadable { path, reason: error.to_string() }
    }

    /// For writing `path`.
    pub(super) fn unwritable<E: std::fmt::Display>(path: impl Into<PathBuf>) -> impl FnOnce(E) -> Self {
        let path = path.into();
        move |error| Self::Unwritable { path, reason: error.to_string() }
    }
}
