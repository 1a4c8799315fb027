//! Errors of making a package.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use parfocal_records::store::export::ExportError;

/// Why no package was made: a sentence that names the file or folder, and says what is wrong.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PackageError(String);

impl PackageError {
    /// Makes an error about `folder`, of which `reason` says the rest of a sentence.
    pub(crate) fn of(folder: &Path, reason: impl Display) -> Self {
        Self(format!("{} {reason}", folder.display()))
    }

    /// Makes an error about a folder that is neither an export of a session nor a package of a study.
    pub(super) fn not_an_export(folder: &Path) -> Self {
        Self::of(
            folder,
            "is neither the export of a session nor the package of a study; give a folder that `parfocal export` or \
             `parfocal study merge` wrote (unpack a ZIP file first)",
        )
    }

    /// Makes an error about a package without sessions.
    pub(crate) fn empty(folder: &Path) -> Self {
        Self::of(folder, "has no session to join")
    }

    /// Makes an error about two exports that do not belong together.
    pub(super) fn apart(one: &Path, other: &Path, reason: &str) -> Self {
        Self(format!("{} and {} do not belong together: {reason}", one.display(), other.display()))
    }

    /// Makes an error about reading `path`.
    pub(crate) fn unreadable<E: Display>(path: impl Into<PathBuf>) -> impl FnOnce(E) -> Self {
        let path = path.into();
        move |error| Self(format!("cannot read {}: {error}", path.display()))
    }

    /// Makes an error about writing `path`.
    pub(super) fn unwritable<E: Display>(path: impl Into<PathBuf>) -> impl FnOnce(E) -> Self {
        let path = path.into();
        move |error| Self(format!("cannot write {}: {error}", path.display()))
    }
}

impl From<ExportError> for PackageError {
    fn from(error: ExportError) -> Self {
        Self(error.to_string())
    }
}
