//! The settings with which every camera is opened.

use std::sync::Arc;

use crate::lens::Optics;
use parfocal_base::clock::Clock;

/// The settings common to all cameras.
#[derive(Clone)]
pub struct CameraSettings {
    /// The frame rate to aim at, frames per second.
    pub fps: f64,
    /// Seed of everything that a simulation draws at random.
    pub seed: u64,
    /// The lens's glass, for cameras that simulate looking through it.
    pub optics: Arc<dyn Optics>,
    /// The clock that stamps frames.
    pub clock: Arc<dyn Clock>,
}
