//! Where to look: who chooses the patch's place, and what a choice says.

use serde::Deserialize;
use utoipa::ToSchema;

use parfocal_base::PatchPlace;
use parfocal_base::ids::SessionId;

/// Who chooses the patch's place during a session.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PatchRule {
    /// Nobody: it stays at the centre of the bright circle, as in the paper.
    #[default]
    Centre,
    /// The surgeon, and the operator for the surgeon.
    Surgeon {
        /// Whether a chosen place stays in the settings that follow. Otherwise each setting begins at the centre.
        stays: bool,
    },
}

impl PatchRule {
    /// Whether people may choose.
    pub const fn is_free(self) -> bool {
        matches!(self, Self::Surgeon { .. })
    }

    /// Whether a chosen place stays in the settings that follow.
    pub const fn stays(self) -> bool {
        matches!(self, Self::Surgeon { stays: true })
    }
}

/// A chosen place for the patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Number of the frame that was on screen.
    pub frame: u64,
    /// Where the picture was touched; none for the centre.
    pub at: Option<Touch>,
    /// The place in the bright circle.
    pub place: PatchPlace,
}

/// A request to look elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, ToSchema)]
pub struct NewChoice {
    /// The session that the page was showing; none outside sessions.
    pub session: Option<SessionId>,
    /// Number of the frame that was on screen.
    pub frame: u64,
    /// Where to look; none for the centre of the bright circle.
    pub at: Option<Touch>,
    /// Whether a place follows the tissue from now on, instead of staying on the screen; none leaves it as it is. Only
    /// the operator decides it, and only outside sessions.
    pub follows: Option<bool>,
}

/// Where a picture was touched.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, ToSchema)]
pub struct Touch {
    /// Mosaic cells from the picture's left edge.
    pub x: f64,
    /// Mosaic cells from the picture's top edge.
    pub y: f64,
}
