//! The phantom as a live camera.

use std::sync::Arc;
use std::time::Duration;

use super::{Hand, Phantom, SENSOR_HEIGHT, SENSOR_WIDTH};
use crate::camera::pace::Pace;
use crate::camera::pool::MosaicPool;
use crate::camera::{Camera, CameraError, CameraHealth, CameraSettings, Frame, FrameImage, Truth};
use crate::clock::Moment;

/// The phantom, seen live through a lens. The exposure takes place while the picture is being computed: it is centred
/// on the computation's start, when the lens is looked through, and ends when the frame is handed over.
pub struct PhantomCamera {
    phantom: Phantom,
    hand: Hand,
    settings: CameraSettings,
    pace: Pace,
    pool: MosaicPool,
    start: Moment,
}

impl PhantomCamera {
    /// The phantom of the settings' seed.
    #[must_use]
    pub fn new(settings: CameraSettings) -> Self {
        let phantom = Phantom::new(settings.seed);
        let start = settings.clock.now();
        Self {
            phantom,
            hand: Hand::new(settings.seed),
            pace: Pace::new(settings.fps, start),
            pool: MosaicPool::new(SENSOR_WIDTH, SENSOR_HEIGHT),
            start,
            settings,
        }
    }
}

impl Camera for PhantomCamera {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        let number = self.pace.wait(&*self.settings.clock, timeout)?;
        let looked = self.settings.clock.now();
        let exposed = self.settings.optics.focal_power_at(looked);
        let pose = self.hand.pose_at(looked.since(self.start));
        let mut samples = self.pool.blank();
        self.phantom.expose(&pose, exposed, &mut samples);
        self.phantom.adjust_exposure(&samples);
        let image = self.pool.frame(samples)?;
        let optimal = self.phantom.optimal(&pose);
        let exposed_at = self.settings.clock.now();
        self.pace.delivered(exposed_at);
        Ok(Frame {
            number,
            exposed_at,
            exposure: exposed_at.since(looked) * 2,
            image: FrameImage::Mosaic(image),
            truth: Some(Truth { optimal, exposed }),
        })
    }

    fn mosaic_size(&self) -> Option<(usize, usize)> {
        Some((SENSOR_WIDTH, SENSOR_HEIGHT))
    }

    fn health(&self) -> CameraHealth {
        CameraHealth {
            name: Arc::from("brain phantom (simulated)"),
            simulated: true,
            working: true,
            message: self.pace.message(),
            fps: self.pace.rate(self.settings.clock.now()),
            lost: self.pace.lost(),
        }
    }
}
