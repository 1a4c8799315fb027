//! How a check came out.

use serde::Serialize;

/// How a check came out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", content = "detail", rename_all = "kebab-case")]
pub enum Verdict {
    /// As it should be; says what was found.
    Passed(String),
    /// Not as it should be; says where.
    Failed(String),
    /// It cannot be checked; says why.
    NotChecked(String),
}

/// A check that could be made to its end, or what was wrong.
pub type Outcome = Result<Verdict, String>;
