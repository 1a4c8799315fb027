//! A recorded scan as a camera: plays the poses forwards and backwards, and the lens's focal power
//! picks the picture.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::{Pose, ScanError, ScanFolder};
use crate::camera::playback::{Playback, PlayedScene, base_name};
use crate::camera::{Camera, CameraSettings, FrameImage};
use parfocal_base::FocalPower;
use parfocal_imaging::{GrayImage, RgbImage};

/// Poses per second: the paper's frame rate of scans.
const RATE: u128 = 25;

/// Plays the recorded scan in `path`, which must be whole, as a camera.
///
/// # Errors
/// If there is no scan, or poses are missing.
pub fn open(path: &Path, settings: CameraSettings) -> Result<impl Camera + use<>, ScanError> {
    let scan = ScanFolder::open(path)?.whole()?;
    let name = format!("recorded scan {} (a recording of: {})", base_name(path), scan.header().camera);
    Ok(Playback::new(name, scan, settings))
}

impl PlayedScene for ScanFolder {
    type Error = ScanError;

    fn look(
        &mut self,
        _number: u64,
        time: Duration,
        focal_power: FocalPower,
    ) -> Result<(FrameImage, Option<FocalPower>), ScanError> {
        let number = there_and_back(time.as_nanos() * RATE / 1_000_000_000, self.poses().len());
        let missing = || ScanError::missing(self.path(), &[number], number);
        let pose: &Pose = self.poses().get(&number).ok_or_else(missing)?;

        let distance = |power: FocalPower| power.distance(focal_power);
        let nearest = pose.images.iter().min_by(|a, b| distance(a.focal_power).total_cmp(&distance(b.focal_power)));
        let picture = self.picture(pose, nearest.ok_or_else(missing)?)?;

        Ok((FrameImage::Rgb(Arc::new(in_colour(&picture))), Some(pose.optimum)))
    }
}

/// The pose after `steps`: 1, 2, .. `count`, `count - 1`, .. 2, 1, 2, ..
fn there_and_back(steps: u128, count: usize) -> usize {
    let last = count.max(1) as u128 - 1;
    let phase = steps % (2 * last).max(1);
    1 + phase.min(2 * last - phase) as usize
}

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
