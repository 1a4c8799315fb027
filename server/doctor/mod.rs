//! Whether a machine is ready for a trial: what is well, what could be better, and what must be put
//! right first, each with what to do.

mod folder;
mod lens;
mod network;
mod system;

use std::path::Path;

use serde::Serialize;

pub use lens::lens;

use crate::clock::Clock;

/// What a check came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
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
    fn well(subject: &'static str, found: impl Into<String>) -> Self {
        Self { subject, verdict: Verdict::Well, found: found.into(), advice: None }
    }

    fn advice(subject: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { subject, verdict: Verdict::Advice, found: found.into(), advice: Some(advice.into()) }
    }

    fn wrong(subject: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { subject, verdict: Verdict::Wrong, found: found.into(), advice: Some(advice.into()) }
    }
}

/// Looks at everything but the devices: the folder `data` and its disk, clock, network and rights.
#[must_use]
pub fn machine(data: &Path, clock: &dyn Clock) -> Vec<Finding> {
    let mut findings = vec![folder::disk(data), folder::access(data)];
    findings.push(system::clock(clock));
    findings.push(network::addresses());
    findings.extend(network::camera_links());
    findings.push(system::real_time());
    findings.push(system::memory());
    findings.push(system::videos());
    findings
}
