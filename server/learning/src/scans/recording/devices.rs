//! A bench of real devices: a camera, a lens, and a person or a command that moves the camera to the next pose.

use std::io;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use super::{PosePictures, PoseSource, RecordError};
use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment};
use parfocal_devices::camera::recorded::LEAST_SIDE;
use parfocal_devices::camera::{Camera, CameraError, FrameImage};
use parfocal_devices::lens::Lens;
use parfocal_imaging::{GrayImage, PatchArea, Reconstructor, RgbImage, content_area, rgb_to_gray};

/// Longest wait for a frame, once the lens has settled.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Largest allowed difference between the focal power that was set and the one read back: twice the hysteresis of a
/// tunable lens.
const TOLERANCE: f64 = 0.01;

/// What moves the camera to its next pose.
pub enum Stepper {
    /// A person, who is asked for each pose and confirms when the camera is there.
    Asked(Box<dyn FnMut(usize) -> Result<(), String> + Send>),
    /// A shell command in which `{pose}` stands for the pose's number.
    Command(String),
}

impl Stepper {
    /// Moves the camera to `pose` and waits until it is there. An error says why it is not.
    fn go(&mut self, pose: usize) -> Result<(), String> {
        match self {
            Self::Asked(ask) => ask(pose),
            Self::Command(command) => {
                let command = command.replace("{pose}", &pose.to_string());
                let mut shell = Command::new("sh");
                let status = shell.args(["-c", &command]).stdin(Stdio::null()).stdout(io::stderr()).status();
                let status = status.map_err(|error| format!("cannot start the stepper's shell: {error}"))?;
                if status.success() {
                    return Ok(());
                }
                bail!(
                    "the stepper failed at pose {pose} ({status}); once it works, run the same command again to \
                     continue"
                )
            }
        }
    }
}

/// Camera, lens and stepper.
pub struct Devices {
    /// Takes the pictures.
    pub camera: Box<dyn Camera>,
    /// Is set to each focal power.
    pub lens: Box<dyn Lens>,
    /// Makes gray pictures from mosaics.
    pub reconstructor: Reconstructor,
    /// Moves the camera to the next pose.
    pub stepper: Stepper,
    /// Source of time.
    pub clock: Arc<dyn Clock>,
}

impl PoseSource for Devices {
    fn take(&mut self, pose: usize, powers: &[FocalPower]) -> Result<PosePictures, RecordError> {
        self.stepper.go(pose).map_err(RecordError::Stepper)?;
        let pictures = powers.iter().map(|&power| self.picture(power)).collect::<Result<Vec<_>, _>>()?;
        let Some(GrayImage { width, height, .. }) = pictures.first() else { return Err(RecordError::TooSmall(0, 0)) };
        let width = *width;
        let height = *height;

        if let Some(other) = pictures.iter().find(|picture| (picture.width, picture.height) != (width, height)) {
            let reason = format!("its pictures changed from {width}x{height} to {}x{}", other.width, other.height);
            return Err(CameraError::Failed(reason).into());
        }

        let too_small = |_| RecordError::TooSmall(width, height);
        if width < LEAST_SIDE || height < LEAST_SIDE {
            return Err(RecordError::TooSmall(width, height));
        }

        let area = pictures.first().and_then(content_area::detect);
        let patch = PatchArea::central(width, height, area.as_ref()).map_err(too_small)?;
        Ok(PosePictures { pictures, patch, truth: None })
    }
}

impl Devices {
    /// Sets the lens to `power` and takes the first picture whose exposure began after the lens had settled.
    fn picture(&mut self, power: FocalPower) -> Result<GrayImage, RecordError> {
        self.lens.set(power)?;
        let dynamics = self.lens.dynamics();

        // After four times the settling time, 1/160 000 of the step remains.
        let settled = self.clock.now() + dynamics.delay + dynamics.settling * 4;
        let image = self.frame_since(settled)?;
        let reached = self.lens.read_back()?;

        if reached.distance(power) > TOLERANCE {
            return Err(RecordError::Astray { asked: power.get(), reached: reached.get() });
        }

        Ok(self.gray(&image))
    }

    /// The first frame whose exposure began at `moment` or later.
    fn frame_since(&mut self, moment: Moment) -> Result<FrameImage, RecordError> {
        let waits_from = self.clock.now().max(moment);
        loop {
            let waited = self.clock.now().since(waits_from);
            let left = TIMEOUT.checked_sub(waited).ok_or(CameraError::Timeout(TIMEOUT))?;
            let frame = self.camera.next_frame(left).map_err(|error| match error {
                // The camera names the rest of the time that it was given.
                CameraError::Timeout(_) => CameraError::Timeout(TIMEOUT),
                error => error,
            })?;
            if frame.exposed_at >= moment + frame.exposure {
                return Ok(frame.image);
            }
        }
    }

    fn gray(&mut self, image: &FrameImage) -> GrayImage {
        let mut gray = GrayImage::default();
        match image {
            FrameImage::Mosaic(mosaic) => self.reconstructor.reconstruct(mosaic, &mut RgbImage::default(), &mut gray),
            FrameImage::Rgb(rgb) => rgb_to_gray(rgb, &mut gray),
        }
        gray
    }
}
