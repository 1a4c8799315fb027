//! What the surgeon's tablets report about themselves, and what follows from it for a session.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What happens to a setting's clock while no tablet shows the surgeon's page.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WhenAway {
    /// The session is paused.
    Pause,
    /// The clock runs on.
    #[default]
    Continue,
}

/// Whether a tablet shows the surgeon's page.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Presence {
    /// No tablet has shown it since the server started.
    #[default]
    NeverSeen,
    /// A tablet shows it, or did so a moment ago.
    Present,
    /// A tablet has it open, but behind something else or with its screen off.
    Hidden,
    /// No tablet has been heard for some seconds.
    Silent,
}

/// The size of a picture, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct PictureSize {
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
}

/// What the tablets report together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TabletReport {
    /// Whether one shows the surgeon's page.
    pub presence: Presence,
    /// The smallest of the pictures that they drew since the last report; none if they drew none.
    pub size: Option<PictureSize>,
    /// Number of pictures that they drew since the last report.
    pub pictures: u64,
}
