//! Recording a focal-time scan: pose by pose, each at every focal power in random order, until all poses are stored.

mod devices;
mod from_stack;
mod import;
mod phantom;

pub use devices::{Devices, Stepper};
pub use from_stack::{Cut, Window, from_stack, windows};
pub use import::{Imported, import};
pub use phantom::PhantomPoses;

use super::recorded::{capture_order, patch_at, sharpest};
use parfocal_base::FocalPower;
use parfocal_devices::camera::CameraError;
use parfocal_devices::camera::recorded::{LEAST_SIDE, ScanError, ScanRecording, TakenPose};
use parfocal_devices::lens::LensError;
use parfocal_imaging::{GrayImage, PatchArea};

/// Where the pictures of a scan's poses come from: devices at a bench, or a simulation.
pub trait PoseSource {
    /// Goes to pose `pose` (from 1) and takes a picture at each of `powers`, in this order.
    ///
    /// # Errors
    /// If the pose cannot be reached, or lens or camera fail. Then nothing of the pose is stored.
    fn take(&mut self, pose: usize, powers: &[FocalPower]) -> Result<PosePictures, RecordError>;
}

/// The pictures of one pose.
#[derive(Debug, Clone)]
pub struct PosePictures {
    /// The pictures, in the requested order and all of one size.
    pub pictures: Vec<GrayImage>,
    /// Where the patch is.
    pub patch: PatchArea,
    /// The best focal power, if a simulation knows it.
    pub truth: Option<FocalPower>,
}

/// Why recording ended early. The poses stored so far are complete.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// Recording was stopped.
    #[error("stopped")]
    Stopped,
    /// The camera could not be moved to the next pose: why, as a sentence.
    #[error("{0}")]
    Stepper(String),
    /// The camera failed.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The lens failed.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The lens did not reach the focal power that was set.
    #[error("the lens was sent to focal power {asked:.3} but is at {reached:.3}; see `parfocal lens info`")]
    Astray {
        /// Focal power that was set.
        asked: f64,
        /// Focal power that the lens reads back.
        reached: f64,
    },
    /// The camera's pictures are too small: their width and height in pixels.
    #[error("a scan's pictures must be at least {LEAST_SIDE}x{LEAST_SIDE} pixels; the camera's are {0}x{1}")]
    TooSmall(usize, usize),
    /// The folder cannot be written.
    #[error(transparent)]
    Folder(#[from] ScanError),
}

/// Records every pose that `recording` lacks. Calls `stop` before each pose and `progress` after it.
///
/// # Errors
/// [`RecordError::Stopped`] if `stop` returned true, another one if something failed.
pub fn record(
    recording: &mut ScanRecording,
    source: &mut dyn PoseSource,
    stop: &dyn Fn() -> bool,
    progress: &dyn Fn(),
) -> Result<(), RecordError> {
    let header = recording.folder().header();
    let seed = header.seed;
    let powers = header.focal_powers.clone();

    for pose in recording.folder().missing() {
        if stop() {
            return Err(RecordError::Stopped);
        }
        let order = capture_order(seed, pose - 1, powers.len());
        let in_order: Vec<FocalPower> = order.iter().map(|&position| powers[position]).collect();

        let taken = source.take(pose, &in_order)?;
        recording.store(&shot(pose, &in_order, taken))?;
        progress();
    }
    Ok(())
}

/// A pose as it is stored. Its optimum is searched in the stack, as the evaluation does.
fn shot(pose: usize, in_order: &[FocalPower], taken: PosePictures) -> TakenPose {
    let PosePictures { pictures, patch, truth } = taken;
    let optimum = sharpest(in_order, pictures.iter().map(|picture| patch_at(picture, patch)));
    TakenPose { pose, images: in_order.iter().copied().zip(pictures).collect(), patch, optimum, truth }
}
