//! Cameras, the sources of frames. This room knows nothing about policies.

pub mod calibration;
mod controls;
pub mod footage;
#[cfg(feature = "aravis")]
pub mod gige;
mod pace;
mod phantom;
mod playback;
mod pool;
pub mod recorded;
mod replay;
mod spec;

pub use controls::{Adjustable, CameraOffer, ControlError, Controls, Setting};
pub use spec::{open, open_or_await, own_calibration};

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use crate::lens::Optics;
use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment};
use parfocal_imaging::{MosaicFrame, RgbImage};

/// A source of frames at its own pace.
///
/// An implementation guarantees:
/// * [`Camera::next_frame`] returns within `timeout` plus one frame's time.
/// * Frame numbers rise strictly. A gap is a lost frame.
/// * After an error it keeps trying to recover by itself, so the caller just asks again.
pub trait Camera: Send {
    /// Waits for the next frame.
    ///
    /// # Errors
    /// If none came within `timeout`, or the device failed.
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError>;

    /// The camera's name and state.
    fn health(&self) -> CameraHealth;

    /// Width and height in samples of the mosaics that it delivers; `None` from a camera that delivers
    /// colour pictures.
    fn mosaic_size(&self) -> Option<(usize, usize)> {
        None
    }

    /// Whether [`Camera::next_frame`] computes the picture, as simulations do, instead of taking it from
    /// a device. Then its thread is not part of the way from camera to lens, and gets no priority over
    /// other programs.
    fn computes(&self) -> bool {
        false
    }

    /// The camera's settings; `None` if an operator can change none.
    fn controls(&self) -> Option<Controls> {
        None
    }
}

/// Least frame rate of a camera that the control loop follows, frames a second. A slower one's frames would come so
/// late that they count as missing.
pub const LEAST_FPS: u32 = 5;

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

/// One exposure.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Counts up from 1 while the server runs; a gap is a lost frame.
    pub number: u64,
    /// End of the exposure, taken once, here; every later stage passes it on.
    pub exposed_at: Moment,
    /// Length of the exposure; zero if the camera does not report it.
    pub exposure: Duration,
    /// The picture.
    pub image: FrameImage,
    /// What only a simulation knows. It is for reports; no policy sees it.
    pub truth: Option<Truth>,
}

impl Frame {
    /// The middle of the exposure. The lens's focal power at that time best stands for the whole exposure.
    pub fn middle(&self) -> Moment {
        let half = u64::try_from(self.exposure.as_nanos() / 2).unwrap_or(u64::MAX);
        Moment::from_nanos(self.exposed_at.as_nanos().saturating_sub(half))
    }
}

/// A frame's picture; shared, never copied.
#[derive(Debug, Clone)]
pub enum FrameImage {
    /// Raw samples of the hyperspectral sensor.
    Mosaic(Arc<MosaicFrame>),
    /// A colour picture, from footage.
    Rgb(Arc<RgbImage>),
}

/// What a simulated camera knows about its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// The focal power at which the patch would be sharpest.
    pub optimal: FocalPower,
    /// The focal power the frame was exposed at.
    pub exposed: FocalPower,
}

/// A camera's state, in words and figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraHealth {
    /// Name for people, for example `brain phantom (simulated)`.
    pub name: Arc<str>,
    /// Whether the picture is not of the real world at this moment; every page says so.
    pub simulated: bool,
    /// Whether frames are coming.
    pub working: bool,
    /// One sentence: the state and, if it is bad, what to do.
    pub message: Arc<str>,
    /// Measured frame rate over the last second, frames per second.
    pub fps: f64,
    /// Frames lost since the start.
    pub lost: u64,
}

/// Why there is no frame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// No frame came in time.
    #[error("no frame within {0:?}")]
    Timeout(Duration),
    /// The device went away or failed; the camera looks for it again.
    #[error("the camera failed: {0}")]
    Failed(String),
    /// The source cannot be used at all; reported at start.
    #[error("{0}")]
    BadSource(String),
}
