//! How far a study has come.

use serde::Serialize;
use utoipa::ToSchema;

/// How far a study has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Defined; nothing was drawn.
    Planned,
    /// Sessions can be made.
    Open,
    /// No sessions can be made. It can be opened again, or locked.
    Closed,
    /// Nothing changes any more.
    Locked,
    /// It is told which policies ran.
    Unblinded,
}

impl Stage {
    /// Its name.
    #[must_use]
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
