//! Footage as a camera: sharp pictures made into a live focal-time scan, as simulated scans are in the literature (Budd
//! et al., MICCAI 2023): a window walks over the picture, the optimal focal power walks, and what is seen is blurred by
//! a Gaussian whose standard deviation grows with the distance between the two.

mod clip;
mod defocus;
mod reel;
mod video;

pub use video::{FootageError, Video};

use std::sync::Arc;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::path::{Habit, Path};
use super::{Camera, CameraError, CameraHealth, CameraSettings, Frame, FrameImage, Pace, Truth};
use crate::clock::Moment;
use crate::imaging::RgbImage;
use crate::lens::FocalPower;
use defocus::Defocus;
use reel::Reel;

/// Share of the footage's width and height that the window shows.
const WINDOW: f64 = 0.75;
/// Steps a second of the walks: the rate at which their speeds were measured.
const RATE: f64 = 25.0;
/// Walk of the optimal focal power: 0.012 a frame at 25 frames a second, remembered for 60 frames.
const FOCUS: Habit = Habit { range: (0.0, 1.0), speed: 0.012 * RATE, memory: 60.0 / RATE };
/// Blur when focal power is off by the whole range: standard deviation in pixels, drawn once a camera.
const BLURS: (f64, f64) = (2.0, 8.0);

/// Footage seen through a lens.
pub struct FootageCamera {
    name: Arc<str>,
    reel: Reel,
    walk: Path<3>,
    /// Standard deviation of the blur when focal power is off by the whole range, pixels.
    blur: f64,
    defocus: Defocus,
    settings: CameraSettings,
    pace: Pace,
    start: Moment,
    fault: Option<Arc<str>>,
}

impl FootageCamera {
    /// Opens a video, an image or a folder of images.
    ///
    /// # Errors
    /// When it cannot be read, holds no pictures or too small ones, or the video decoder is missing.
    pub fn open(path: &std::path::Path, settings: CameraSettings) -> Result<Self, FootageError> {
        let mut reel = Reel::open(path)?;
        let first = reel.at(Duration::ZERO)?;
        let (_, room) = window(first.width, first.height);
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let blur = BLURS.0 + (BLURS.1 - BLURS.0) * rng.random::<f64>();
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let start = settings.clock.now();
        Ok(Self {
            name: Arc::from(format!("footage {name} (simulated focus)")),
            reel,
            walk: Path::new(settings.seed, RATE, [FOCUS, crop(room[0]), crop(room[1])]),
            blur,
            defocus: Defocus::default(),
            pace: Pace::new(settings.fps, start),
            start,
            settings,
            fault: None,
        })
    }

    /// The window's part of the picture at `time`, seen at `exposed` focal power; and the optimal one.
    fn look(&mut self, time: Duration, exposed: FocalPower) -> Result<(RgbImage, FocalPower), FootageError> {
        let [optimal, x, y] = self.walk.at(time);
        let picture = self.reel.at(time)?;
        let (window, room) = window(picture.width, picture.height);
        let corner = [place(x, room[0]), place(y, room[1])];
        let optimal = FocalPower::nearest(optimal);
        let seen = self.defocus.see(picture, corner, window, self.blur * optimal.distance(exposed));
        Ok((seen, optimal))
    }
}

impl Camera for FootageCamera {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        let number = self.pace.wait(&*self.settings.clock, timeout)?;
        let looked = self.settings.clock.now();
        let exposed = self.settings.optics.focal_power_at(looked);
        let seen = self.look(looked.since(self.start), exposed);
        self.fault = seen.as_ref().err().map(|error| Arc::from(error.to_string()));
        let (image, optimal) = seen.map_err(|error| CameraError::Failed(error.to_string()))?;
        let exposed_at = self.settings.clock.now();
        self.pace.delivered(exposed_at);
        Ok(Frame {
            number,
            exposed_at,
            exposure: exposed_at.since(looked) * 2,
            image: FrameImage::Rgb(Arc::new(image)),
            truth: Some(Truth { optimal, exposed }),
        })
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

/// Walk of the window over `room` pixels: 1 pixel a frame at 25 frames a second, remembered for 30 frames.
#[allow(clippy::cast_precision_loss, reason = "pixels of a picture")]
fn crop(room: usize) -> Habit {
    Habit { range: (0.0, room as f64), speed: RATE, memory: 30.0 / RATE }
}

/// Width and height of the window on a picture of this size, and how far it can move right and down.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "pixels of a picture"
)]
fn window(width: usize, height: usize) -> ([usize; 2], [usize; 2]) {
    let window = [width, height].map(|length| (WINDOW * length as f64) as usize);
    (window, [width - window[0], height - window[1]])
}

/// A walk's place as a whole number of pixels within `room`.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels of a picture; never negative")]
fn place(walked: f64, room: usize) -> usize {
    (walked.max(0.0) as usize).min(room)
}
