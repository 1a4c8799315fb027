//! The registry: every policy by its name, the same everywhere.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::Policy;

/// A policy's name, as in the contract; valid once a [`Registry`] has taken it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PolicyName(String);

impl PolicyName {
    /// A name, known or not.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self(name.to_owned())
    }

    /// The name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for PolicyName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// One line of the registry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PolicyEntry {
    /// Name.
    pub name: PolicyName,
    /// What it does, in one sentence.
    pub summary: &'static str,
    /// Whether it can run now; a learned policy cannot without its weights.
    pub available: bool,
}

/// Why a policy could not be had.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// No such name.
    #[error("there is no policy '{name}'; there are: {known}")]
    Unknown {
        /// The name asked for.
        name: PolicyName,
        /// The names there are, separated by commas.
        known: String,
    },
    /// The weights are missing or damaged.
    #[error("policy '{name}' cannot run: {reason}")]
    Unavailable {
        /// The policy.
        name: PolicyName,
        /// Why, and what to do.
        reason: String,
    },
}

/// All policies. Clone freely; learned weights are shared.
#[derive(Clone, Default)]
pub struct Registry {}

impl Registry {
    /// Every policy, in the contract's order.
    #[must_use]
    pub fn entries(&self) -> Vec<PolicyEntry> {
        todo!()
    }

    /// A fresh instance of policy `name`, with nothing remembered.
    ///
    /// # Errors
    /// When there is no such policy or it cannot run.
    pub fn build(&self, _name: &PolicyName) -> Result<Box<dyn Policy>, PolicyError> {
        todo!()
    }
}
