//! The roles in a trial.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Who acts; kept with every event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// In the trial.
    Surgeon,
    /// At the device.
    Operator,
    /// Runs the study.
    Researcher,
    /// The server itself: a time limit, a restart.
    System,
}

impl Role {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Surgeon => "surgeon",
            Self::Operator => "operator",
            Self::Researcher => "researcher",
            Self::System => "system",
        }
    }

    /// The role called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Surgeon, Self::Operator, Self::Researcher, Self::System].into_iter().find(|role| role.name() == name)
    }
}
