//! From `--camera SPEC` to a camera.

use std::sync::Arc;

use super::phantom::PhantomCamera;
use super::{Camera, CameraError};
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

/// Opens the camera that `spec` names: `phantom`.
///
/// # Errors
/// [`CameraError::BadSource`] when there is no such camera, or its source cannot be used.
pub fn open(spec: &str, settings: CameraSettings) -> Result<Box<dyn Camera>, CameraError> {
    let (kind, source) = spec.split_once(':').unwrap_or((spec, ""));
    match (kind, source) {
        ("phantom", "") => Ok(Box::new(PhantomCamera::new(settings))),
        _ => Err(CameraError::BadSource(format!("there is no camera `{spec}`; choose `phantom` (simulated brain)"))),
    }
}
