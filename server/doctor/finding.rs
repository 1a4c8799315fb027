//! What was found when a machine was looked at.

use serde::Serialize;
use utoipa::ToSchema;

/// What a check came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing to do.
    Well,
    /// A trial can run, but something could be better.
    Advice,
    /// To be put right before a trial.
    Wrong,
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Finding {
    /// What was looked at, for example `disk`.
    pub subject: &'static str,
    /// What it came to.
    pub verdict: Verdict,
    /// What was found, in one sentence.
    pub found: String,
    /// What to do about it; none where all is well.
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
