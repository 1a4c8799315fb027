//! The result of checking one thing on a machine.

use serde::Serialize;
use utoipa::ToSchema;

/// The result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing to do.
    Well,
    /// A trial can run, but something could be better.
    Advice,
    /// Must be fixed before a trial.
    Wrong,
}

/// One thing that was checked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Finding {
    /// What was checked, for example `disk`.
    pub subject: &'static str,
    /// The result.
    pub verdict: Verdict,
    /// What was found, in words.
    pub found: String,
    /// What to do about it; none if all is well.
    pub advice: Option<String>,
}

impl Finding {
    pub(super) fn well(subject: &'static str, found: impl Into<String>) -> Self {
        Self { subject, verdict: Verdict::Well, found: found.into(), advice: None }
    }

    pub(super) fn advice(subject: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { subject, verdict: Verdict::Advice, found: found.into(), advice: Some(advice.into()) }
    }

    pub(super) fn wrong(subject: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { subject, verdict: Verdict::Wrong, found: found.into(), advice: Some(advice.into()) }
    }
}
