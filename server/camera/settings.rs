//! What every camera is opened with.

use std::sync::Arc;

use crate::clock::Clock;
use crate::lens::Optics;

/// What every camera is told.
#[derive(Clone)]
pub struct CameraSettings {
    /// Frames a second to aim at.
    pub fps: f64,
    /// Seed of whatever a simulation draws.
    pub seed: u64,
    /// The lens's glass, for cameras that simulate looking through it.
    pub optics: Arc<dyn Optics>,
    /// Where time comes from.
    pub clock: Arc<dyn Clock>,
}
