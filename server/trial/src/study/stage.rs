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

names!(Stage { Planned: "planned", Open: "open", Closed: "closed", Locked: "locked", Unblinded: "unblinded" });
