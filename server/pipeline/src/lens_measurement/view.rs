//! The patch's sharpness over time, as a camera sees it.

use std::sync::Arc;
use std::time::Duration;

use super::MeasurementError;
use crate::control::Eye;
use parfocal_autofocus::mgm;
use parfocal_base::PatchPlace;
use parfocal_base::clock::{Clock, Moment};
use parfocal_devices::camera::{Camera, CameraError};

/// Longest wait for a frame.
const PATIENCE: Duration = Duration::from_secs(2);

/// A camera's view, reduced to one number a frame.
pub struct CameraView {
    camera: Box<dyn Camera>,
    eye: Eye,
    clock: Arc<dyn Clock>,
}

impl CameraView {
    /// The view of `camera` through `eye`, whose patch is at the picture's centre.
    pub fn new(camera: Box<dyn Camera>, eye: Eye, clock: Arc<dyn Clock>) -> Self {
        Self { camera, eye, clock }
    }

    /// The current time.
    pub fn now(&self) -> Moment {
        self.clock.now()
    }

    /// The next frame: the middle of its exposure, and the mean gradient magnitude of its patch.
    pub(super) fn next(&mut self) -> Result<(Moment, f64), MeasurementError> {
        let begun = self.clock.now();
        loop {
            match self.camera.next_frame(PATIENCE) {
                Ok(frame) => {
                    let area = self.eye.find(&frame.image, PatchPlace::CENTRE, None)?;
                    return Ok((frame.middle(), mgm(&self.eye.patch(&frame.image, area))));
                }
                Err(error @ CameraError::BadSource(_)) => return Err(error.into()),
                Err(error) if self.clock.now().since(begun) >= PATIENCE => return Err(error.into()),
                Err(_) => {}
            }
        }
    }

    /// Mean sharpness of `frames` frames exposed at `from` or later.
    pub(super) fn mean(&mut self, from: Moment, frames: usize) -> Result<f64, MeasurementError> {
        let mut sum = 0.0;
        let mut seen = 0;

        while seen < frames {
            let (at, sharpness) = self.next()?;
            if at >= from {
                sum += sharpness;
                seen += 1;
            }
        }

        Ok(sum / frames as f64)
    }
}
