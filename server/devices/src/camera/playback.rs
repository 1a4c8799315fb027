//! What is simulated or recorded, played as a live camera: the common part of the phantom, footage and recorded scans.

use std::fmt::Display;
use std::sync::Arc;
use std::time::Duration;

use super::pace::Pace;
use super::{Camera, CameraError, CameraHealth, CameraSettings, Frame, FrameImage, Truth};
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;

/// Something that can be looked at through a lens.
pub trait PlayedScene: Send {
    /// Why there may be no picture.
    type Error: Display;

    /// Picture `number`, from 1, `time` after the start at `focal_power`, and the optimal focal power, if there is one.
    ///
    /// # Errors
    /// If a picture cannot be read.
    fn look(
        &mut self,
        number: u64,
        time: Duration,
        focal_power: FocalPower,
    ) -> Result<(FrameImage, Option<FocalPower>), Self::Error>;

    /// As [`Camera::mosaic_size`].
    fn mosaic_size(&self) -> Option<(usize, usize)> {
        None
    }
}

/// A view, played in real time. It counts as simulated: even a recording of the real world is not the
/// real world now. The exposure takes place while the picture is being computed: it is centred on the computation's
/// start, when the lens is looked through, and ends when the frame is handed over.
pub struct Playback<V> {
    name: Arc<str>,
    view: V,
    settings: CameraSettings,
    pace: Pace,
    start: Moment,
    fault: Option<Arc<str>>,
}

impl<V: PlayedScene> Playback<V> {
    /// Plays `view` from now on.
    pub fn new(name: String, view: V, settings: CameraSettings) -> Self {
        let start = settings.clock.now();
        Self { name: Arc::from(name), view, pace: Pace::new(settings.fps, start), start, settings, fault: None }
    }
}

impl<V: PlayedScene> Camera for Playback<V> {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        let number = self.pace.wait(&*self.settings.clock, timeout)?;
        let looked = self.settings.clock.now();
        let exposed = self.settings.optics.focal_power_at(looked);

        let seen = self.view.look(number, looked.since(self.start), exposed);
        self.fault = seen.as_ref().err().map(|error| Arc::from(error.to_string()));
        let (image, optimal) = seen.map_err(|error| CameraError::Failed(error.to_string()))?;

        let exposed_at = self.settings.clock.now();
        self.pace.delivered(exposed_at);

        Ok(Frame {
            number,
            exposed_at,
            exposure: exposed_at.since(looked) * 2,
            image,
            truth: optimal.map(|optimal| Truth { optimal, exposed }),
        })
    }

    fn mosaic_size(&self) -> Option<(usize, usize)> {
        self.view.mosaic_size()
    }

    fn computes(&self) -> bool {
        true
    }

    fn health(&self) -> CameraHealth {
        CameraHealth {
            name: Arc::clone(&self.name),
            simulated: true,
            working: self.fault.is_none(),
            message: self.fault.clone().unwrap_or_else(|| self.pace.message()),
            fps: self.pace.rate(self.settings.clock.now()),
            lost: self.pace.lost(),
        }
    }
}

/// The last part of `path`, for a camera's name.
pub fn base_name(path: &std::path::Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
