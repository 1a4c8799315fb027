//! The roles in a trial.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The role in which somebody acts; kept with every event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The participant, who inspects and answers questions.
    Surgeon,
    /// Runs sessions at the device.
    Operator,
    /// Plans studies and examines their data.
    Researcher,
    /// The server itself, for example at a time limit or a restart.
    System,
}

impl Role {
    /// The role's name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Surgeon => "surgeon",
            Self::Operator => "operator",
            Self::Researcher => "researcher",
            Self::System => "system",
        }
    }

    /// The role with this name, if there is one.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Surgeon, Self::Operator, Self::Researcher, Self::System].into_iter().find(|role| role.name() == name)
    }
}
