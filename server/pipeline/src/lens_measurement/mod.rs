//! Measures how a lens responds to a step, as a camera sees it; done once, before the first session.

mod curve;
mod fit;
mod plot;
mod steps;
mod view;

pub use fit::{Fit, Sample};
pub use plot::plot;
pub use steps::{Measurement, Plan, measure};
pub use view::CameraView;

use crate::control::HoldReason;
use parfocal_devices::camera::CameraError;
use parfocal_devices::lens::LensError;

/// Why a lens could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum MeasurementError {
    /// The lens failed.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The camera failed.
    #[error("no frames to measure with: {0}")]
    Camera(#[from] CameraError),
    /// The camera's picture cannot be used.
    #[error("{0}")]
    Picture(String),
    /// The lens moves, but the picture does not show it.
    #[error(
        "the picture hardly changes with the focal power ({:.0} %): put something with fine texture under the optics, \
         in focus somewhere within the lens's range, and light it well", 100.0 * .0
    )]
    Flat(f64),
    /// The steps differ from one another.
    #[error(
        "the steps do not look alike (they scatter by {:.0} %): camera and object must stand still, and the light must \
         not flicker", 100.0 * .0
    )]
    Unsteady(f64),
    /// The lens was not watched for long enough.
    #[error("the lens had not settled after {0:.0} ms: watch for longer, with --watch")]
    TooSlow(f64),
}

impl From<HoldReason> for MeasurementError {
    fn from(reason: HoldReason) -> Self {
        Self::Picture(reason.message.to_string())
    }
}
