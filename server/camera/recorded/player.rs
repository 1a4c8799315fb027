//! A recorded scan as a camera: plays the poses there and back again, and the lens's focal power picks the picture.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::{Pose, ScanError, ScanFolder};
use crate::camera::{Camera, CameraError, CameraHealth, CameraSettings, Frame, FrameImage, Pace, Truth};
use crate::clock::Moment;
use crate::imaging::{GrayImage, RgbImage};
use crate::lens::FocalPower;

/// Poses a second: the paper's frame rate of scans.
const RATE: u128 = 25;

/// A recorded scan, played in real time.
pub struct RecordedCamera {
    name: Arc<str>,
    scan: ScanFolder,
    settings: CameraSettings,
    pace: Pace,
    start: Moment,
    fault: Option<Arc<str>>,
}

impl RecordedCamera {
    /// Opens the scan in `path`, which must be whole.
    ///
    /// # Errors
    /// When there is no scan, or poses are missing.
    pub fn open(path: &Path, settings: CameraSettings) -> Result<Self, ScanError> {
        let scan = ScanFolder::open(path)?.whole()?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let name = Arc::from(format!("recorded scan {name} (a recording of: {})", scan.header().camera));
        let start = settings.clock.now();
        Ok(Self { name, scan, pace: Pace::new(settings.fps, start), start, settings, fault: None })
    }

    /// What is seen at `time` through a lens at `focal_power`, and the best focal power.
    fn look(&self, time: Duration, focal_power: FocalPower) -> Result<(RgbImage, FocalPower), ScanError> {
        let number = there_and_back(time.as_nanos() * RATE / 1_000_000_000, self.scan.poses().len());
        let missing = || ScanError::Missing { path: self.scan.path().to_owned(), missing: vec![number], of: number };
        let pose: &Pose = self.scan.poses().get(&number).ok_or_else(missing)?;
        let distance = |power: FocalPower| power.distance(focal_power);
        let nearest = pose.images.iter().min_by(|a, b| distance(a.focal_power).total_cmp(&distance(b.focal_power)));
        let picture = self.scan.picture(pose, nearest.ok_or_else(missing)?)?;
        Ok((in_colour(&picture), pose.optimum))
    }
}

impl Camera for RecordedCamera {
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
            // A recording of the real world is not the real world at this moment.
            simulated: true,
            working: self.fault.is_none(),
            message: self.fault.clone().unwrap_or_else(|| self.pace.message()),
            fps: self.pace.rate(self.settings.clock.now()),
            lost: self.pace.lost(),
        }
    }
}

/// The pose after `steps`: 1, 2, .. `count`, `count - 1`, .. 2, 1, 2, ..
#[allow(clippy::cast_possible_truncation, reason = "below the number of poses")]
fn there_and_back(steps: u128, count: usize) -> usize {
    let last = count.max(1) as u128 - 1;
    let phase = steps % (2 * last).max(1);
    1 + phase.min(2 * last - phase) as usize
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole gray levels")]
fn in_colour(gray: &GrayImage) -> RgbImage {
    let data = gray.data.iter().flat_map(|&value| [value as u8; 3]).collect();
    RgbImage { width: gray.width, height: gray.height, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_played_there_and_back_again() {
        let played: Vec<_> = (0..8).map(|step| there_and_back(step, 4)).collect();
        assert_eq!(played, [1, 2, 3, 4, 3, 2, 1, 2]);
        assert_eq!(there_and_back(5, 1), 1);
    }
}
