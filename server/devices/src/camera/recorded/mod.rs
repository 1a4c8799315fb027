//! Recorded focal-time scans on disk: at each pose of the camera, one picture for each of several focal powers.
//! `docs/scans.md` describes the format for others.

mod folder;
mod player;
mod writing;

pub use folder::{Damage, ScanFolder};
pub use player::open as play;
pub use writing::{ScanRecording, TakenPose};

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use parfocal_base::{FocalPower, SOFTWARE};
use parfocal_imaging::{PATCH_SIDE, PatchArea};

/// Name of the file that says what was to be recorded.
pub const HEADER: &str = "scan.json";
/// Name of the file that gets a line for each pose once the pose's pictures are stored.
pub const POSES: &str = "poses.jsonl";
/// Value of [`Header::format`].
pub const FORMAT: &str = "parfocal-scan";
/// Value of [`Header::version`].
pub const VERSION: u32 = 1;
/// Most poses of a scan: over an hour at 25 a second.
pub const MOST_POSES: usize = 100_000;
/// Least width and height of a picture, pixels.
pub const LEAST_SIDE: usize = 64;

/// The plan of a scan: what to record, and with which devices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Always [`FORMAT`].
    pub format: String,
    /// Always [`VERSION`].
    pub version: u32,
    /// The program that began it, and its version.
    pub software: String,
    /// Name of the camera, for people.
    pub camera: String,
    /// Name of the lens, for people, if one is known.
    pub lens: Option<String>,
    /// Whether the pictures are not of the real world.
    pub simulated: bool,
    /// Name and version of the sensor's calibration, if the pictures were made with one.
    pub calibration: Option<String>,
    /// Seed of everything drawn at random: the order of focal powers, and all of a simulation.
    pub seed: u64,
    /// In which order each pose's focal powers were taken.
    pub order: PictureOrder,
    /// Number of poses in the complete scan.
    pub poses: usize,
    /// The focal powers of each pose, in rising order.
    pub focal_powers: Vec<FocalPower>,
}

impl Header {
    /// The plan of a scan of pictures that were taken before, in an order that nobody knows, by `camera`.
    pub fn new(camera: &str, seed: u64, poses: usize, focal_powers: Vec<FocalPower>) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            software: SOFTWARE.to_owned(),
            camera: camera.to_owned(),
            lens: None,
            simulated: false,
            calibration: None,
            seed,
            order: PictureOrder::Unknown,
            poses,
            focal_powers,
        }
    }
}

/// In which order each pose's focal powers were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PictureOrder {
    /// The order of [`Pose::images`], drawn anew for each pose.
    Random,
    /// The order was not noted.
    Unknown,
}

/// One pose as it is stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Its number, from 1.
    pub pose: usize,
    /// Width of its pictures, pixels.
    pub width: usize,
    /// Height of its pictures, pixels.
    pub height: usize,
    /// Upper left corner of the 32x32 patch at the centre of the content area, pixels from the left and from the top.
    pub patch: (usize, usize),
    /// The focal power of the stack at which the patch has the greatest mean gradient magnitude.
    pub optimum: FocalPower,
    /// The best focal power; `None` unless a simulation knows it.
    pub truth: Option<FocalPower>,
    /// Its pictures in the order in which they were taken.
    pub images: Vec<Image>,
}

impl Pose {
    /// The patch's place and size.
    pub const fn patch_area(&self) -> PatchArea {
        PatchArea { x: self.patch.0, y: self.patch.1, width: PATCH_SIDE, height: PATCH_SIDE }
    }
}

/// One stored picture: 8-bit gray PNG.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// Focal power it was taken at.
    pub focal_power: FocalPower,
    /// Its file, relative to the scan's folder.
    pub file: String,
    /// SHA-256 of the file, in hexadecimal.
    pub sha256: String,
}

/// Why a scan cannot be read or written. The message names the file or folder, and says what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ScanError(String);

impl ScanError {
    fn unreadable(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |error| Self(format!("cannot read {}: {error}", path.display()))
    }

    /// The description in `path` is invalid.
    fn nonsense(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self(format!("{} does not describe a scan: {reason}", path.display()))
    }

    /// The poses with the numbers in `missing` have not been recorded yet; there should be `of` poses.
    fn missing(path: &Path, missing: &[usize], of: usize) -> Self {
        let are = if missing.len() == 1 { "is" } else { "are" };
        Self(format!(
            "the scan {} is not complete: {} of {of} {are} missing; run the command that began it again to continue",
            path.display(),
            poses(missing)
        ))
    }

    /// A file cannot be written, after `kept` poses were stored.
    fn unwritable(path: &Path, kept: usize, error: &io::Error) -> Self {
        let path = path.display();
        let poses_are = if kept == 1 { "pose is" } else { "poses are" };
        Self(match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => format!(
                "no space is left on the disk of {path}: {kept} {poses_are} saved; free some space and run the same \
                 command again to continue"
            ),
            _ => format!("cannot write {path}: {error}"),
        })
    }

    /// The folder `path` holds a scan that was begun with other arguments: `difference` says how they differ.
    pub fn other(path: &Path, difference: &str) -> Self {
        Self(format!(
            "{} holds another scan ({difference}); give the same arguments to continue it, or choose a new folder",
            path.display()
        ))
    }
}

/// Poses for people: `pose 3`, `poses 3, 7 to 9`.
pub fn poses(of: &[usize]) -> String {
    format!("{} {}", if of.len() == 1 { "pose" } else { "poses" }, numbers(of))
}

/// Numbers for people: `3, 7 to 9, 12`, at most a handful of them.
fn numbers(of: &[usize]) -> String {
    const MOST: usize = 6;

    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &number in of {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => runs.push((number, number)),
        }
    }

    let name = |&(first, last): &(usize, usize)| match last - first {
        0 => first.to_string(),
        1 => format!("{first}, {last}"),
        _ => format!("{first} to {last}"),
    };

    let more = runs.len().saturating_sub(MOST);
    let named: Vec<_> = runs.iter().take(MOST).map(name).collect();
    let rest = if more == 0 { String::new() } else { format!(" and {more} more") };

    named.join(", ") + &rest
}

#[cfg(test)]
mod tests {
    use parfocal_imaging::{GrayImage, SENSOR_SIZE};

    use super::*;

    #[test]
    fn a_picture_of_the_sensors_size_is_read_back_as_it_was_stored() {
        let folder = tempfile::tempdir().unwrap();
        let focal_powers = vec![FocalPower::MIN, FocalPower::MAX];
        let header = Header::new("a colour camera", 1, 1, focal_powers.clone());

        let (width, height) = SENSOR_SIZE;
        let picture = |level: f32| GrayImage { width, height, data: vec![level; width * height] };
        let images = focal_powers.into_iter().zip([picture(40.0), picture(200.0)]).collect();
        let patch = PatchArea::central(width, height, None).unwrap();
        let pose = TakenPose { pose: 1, images, patch, optimum: FocalPower::MIN, truth: None };
        ScanRecording::open(folder.path(), &header).unwrap().store(&pose).unwrap();

        let scan = ScanFolder::open(folder.path()).unwrap();
        let stored = &scan.poses()[&1];
        let levels = stored.images.iter().map(|image| scan.picture(stored, image).unwrap().data[0]);
        assert_eq!(levels.collect::<Vec<f32>>(), [40.0, 200.0]);
    }

    #[test]
    fn numbers_are_listed_as_ranges() {
        assert_eq!(poses(&[3]), "pose 3");
        assert_eq!(poses(&[3, 4]), "poses 3, 4");
        assert_eq!(numbers(&[1, 2, 3, 7, 9, 10]), "1 to 3, 7, 9, 10");
        assert_eq!(numbers(&[1, 3, 5, 7, 9, 11, 13]), "1, 3, 5, 7, 9, 11 and 1 more");
    }
}
