//! Footage as a camera: turns sharp pictures into a live focal-time scan, in the way of simulated scans in the
//! literature (Budd et al., MICCAI 2023). A window walks over the picture, the optimal focal power walks, and the
//! window is blurred by a Gaussian whose standard deviation grows with the distance between focal power and optimum.

mod clip;
mod coverage;
mod defocus;
mod files;
mod pnm;
mod reel;
mod video;
mod wide;

pub use coverage::{CutOff, cut_off};
pub use files::{is_picture, is_raw, picture_head, pictures_in, read_picture, tell_unread};
pub use pnm::next_pnm;
pub use video::{FootageError, SQUARE_PIXELS, Video, ffmpeg};
pub use wide::{WideSamples, sample_bits};

use std::sync::Arc;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::playback::{Playback, PlayedScene, base_name};
use super::{Camera, CameraSettings, FrameImage};
use crate::simulation::path::{Habit, Path};
use defocus::Defocus;
use parfocal_base::FocalPower;
use reel::Reel;

/// Share of the footage's width and height that the window shows.
const WINDOW: f64 = 0.75;
/// Steps per second of the walks: the rate at which their speeds were measured.
const RATE: f64 = 25.0;
/// Walk of the optimal focal power: 0.012 a frame at 25 frames a second, remembered for 60 frames.
const FOCUS: Habit = Habit { range: (0.0, 1.0), speed: 0.012 * RATE, memory: 60.0 / RATE };
/// Blur when focal power is off by the whole range: standard deviation in pixels, drawn once per camera.
const BLURS: (f64, f64) = (2.0, 8.0);

/// Footage seen through a lens.
struct Footage {
    reel: Reel,
    walk: Path<3>,
    /// Standard deviation of the blur when focal power is off by the whole range, pixels.
    blur: f64,
    defocus: Defocus,
}

/// Plays a video, an image or a folder of images as a camera.
///
/// # Errors
/// If it cannot be read, holds no pictures or too small ones, or the video decoder is missing.
pub fn open(path: &std::path::Path, settings: CameraSettings) -> Result<impl Camera + use<>, FootageError> {
    let mut reel = Reel::open(path)?;
    let first = reel.at(Duration::ZERO)?;
    let (_, room) = window(first.width, first.height);

    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let blur = BLURS.0 + (BLURS.1 - BLURS.0) * rng.random::<f64>();
    let walk = Path::new(settings.seed, RATE, [FOCUS, crop(room[0]), crop(room[1])]);

    let name = format!("footage {} (simulated focus)", base_name(path));
    Ok(Playback::new(name, Footage { reel, walk, blur, defocus: Defocus::default() }, settings))
}

impl PlayedScene for Footage {
    type Error = FootageError;

    fn look(
        &mut self,
        _number: u64,
        time: Duration,
        focal_power: FocalPower,
    ) -> Result<(FrameImage, Option<FocalPower>), FootageError> {
        let [optimal, x, y] = self.walk.at(time);
        let picture = self.reel.at(time)?;
        let (window, room) = window(picture.width, picture.height);
        let corner = [place(x, room[0]), place(y, room[1])];

        let optimal = FocalPower::nearest(optimal);
        let seen = self.defocus.see(picture, corner, window, self.blur * optimal.distance(focal_power));
        Ok((FrameImage::Rgb(Arc::new(seen)), Some(optimal)))
    }
}

/// Walk of the window over `room` pixels: 1 pixel a frame at 25 frames a second, remembered for 30 frames.
fn crop(room: usize) -> Habit {
    Habit { range: (0.0, room as f64), speed: RATE, memory: 30.0 / RATE }
}

/// Width and height of the window on a picture of this size, and how far it can move right and down.
fn window(width: usize, height: usize) -> ([usize; 2], [usize; 2]) {
    let window = [width, height].map(|length| (WINDOW * length as f64) as usize);
    (window, [width - window[0], height - window[1]])
}

/// A walk's place as a whole number of pixels within `room`.
fn place(walked: f64, room: usize) -> usize {
    (walked.max(0.0) as usize).min(room)
}
