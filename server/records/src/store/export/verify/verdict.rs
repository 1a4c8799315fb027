//! The verdict of a check.

use serde::Serialize;

/// The verdict of a check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", content = "detail", rename_all = "kebab-case")]
pub enum Verdict {
    /// Everything is as it should be. Says what was found.
    Passed(String),
    /// Something is wrong. Says what and where.
    Failed(String),
    /// It cannot be checked. Says why.
    NotChecked(String),
}

/// The verdict of a check, or what is wrong, in words.
pub type Outcome = Result<Verdict, String>;
