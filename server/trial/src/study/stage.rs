//! The stages of a study.

use serde::Serialize;
use utoipa::ToSchema;

/// The stage of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// The study is defined. No orders are drawn yet.
    Planned,
    /// Sessions can be made.
    Open,
    /// No sessions can be made. The study can be opened again, or locked.
    Closed,
    /// Nothing can be changed any more. The study can be unblinded.
    Locked,
    /// The policies that ran are revealed.
    Unblinded,
}

impl Stage {
    /// The stage's name, as it is shown.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Planned => "planned",
            Self::Open => "open",
            Self::Closed => "closed",
            Self::Locked => "locked",
            Self::Unblinded => "unblinded",
        }
    }
}
