//! The error of scans, evaluations and trainings.

use std::fmt::Display;
use std::path::Path;

use parfocal_autofocus::PolicyError;
use parfocal_devices::camera::footage::FootageError;
use parfocal_devices::camera::recorded::ScanError;

/// Why there is no scan, no figure or no policy: a sentence that says what is wrong, where, and what to do. People read
/// it; no code tells one from another.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LearningError(String);

impl LearningError {
    /// The error that `text` says.
    pub(crate) fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    /// The file or folder at `path` cannot be used, for `reason`.
    pub(crate) fn of(path: &Path, reason: impl Display) -> Self {
        Self(format!("{}: {reason}", path.display()))
    }

    /// The file or folder at `path` cannot be read.
    pub(crate) fn unreadable(path: &Path, error: &std::io::Error) -> Self {
        Self(format!("cannot read {}: {error}", path.display()))
    }
}

impl From<String> for LearningError {
    fn from(text: String) -> Self {
        Self(text)
    }
}

impl From<FootageError> for LearningError {
    fn from(error: FootageError) -> Self {
        Self(error.to_string())
    }
}

impl From<PolicyError> for LearningError {
    fn from(error: PolicyError) -> Self {
        Self(error.to_string())
    }
}

impl From<ScanError> for LearningError {
    fn from(error: ScanError) -> Self {
        Self(error.to_string())
    }
}
