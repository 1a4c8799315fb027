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

names!(Role { Surgeon: "surgeon", Operator: "operator", Researcher: "researcher", System: "system" });
