//! Errors of making a package.

use std::path::PathBuf;

/// The reason why no package was made.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// A folder is neither an export of a session nor a package of a study.
    #[error("{} is neither the export of a session nor the package of a study; give a folder that `parfocal export` or \
             `parfocal study merge` wrote (unpack a ZIP file first)", .0.display())]
    NotAnExport(PathBuf),
    /// An export does not verify.
    #[error("{} is not as it was exported: {check}: {problem}; export it again", .folder.display())]
    Unverified {
        /// The export.
        folder: PathBuf,
        /// The check that failed.
        check: String,
        /// The problem that it found.
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
        /// Format of the export.
        found: u64,
        /// The format of this version.
        expected: u64,
    },
    /// A session is outside any study.
    #[error("{} is of a session outside any study", .0.display())]
    OutsideAnyStudy(PathBuf),
    /// Two exports do not belong together.
    #[error("{} and {} do not belong together: {reason}", .one.display(), .other.display())]
    Apart {
        /// The first export.
        one: PathBuf,
        /// An export that does not fit it.
        other: PathBuf,
        /// The reason.
        reason: String,
    },
    /// There is nothing to join.
    #[error("{} has no session to join", .0.display())]
    Empty(PathBuf),
    /// The output folder is not empty.
    #[error("{} exists and is not empty; choose a new folder", .0.display())]
    Exists(PathBuf),
    /// A file could not be read.
    #[error("cannot read {}: {reason}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
    /// A file could not be written.
    #[error("cannot write {}: {reason}", .path.display())]
    Unwritable {
        /// Path of the file.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
}

impl PackageError {
    /// Makes an error about reading `path`.
    pub(crate) fn unreadable<E: std::fmt::Display>(path: impl Into<PathBuf>) -> impl FnOnce(E) -> Self {
        let path = path.into();
        move |error| Self::Unreadable { path, reason: error.to_string() }
    }

    /// Makes an error about writing `path`.
    pub(super) fn unwritable<E: std::fmt::Display>(path: impl Into<PathBuf>) -> impl FnOnce(E) -> Self {
        let path = path.into();
        move |error| Self::Unwritable { path, reason: error.to_string() }
    }
}
