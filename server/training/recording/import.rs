//! Importing a scan: a folder of pictures named by pose and focal power, from whatever recorded them.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::{RecordError, Taken, shot};
use crate::camera::recorded::{FORMAT, Header, LEAST_SIDE, Order, Recording, ScanError, VERSION, numbers};
use crate::imaging::{
    Calibration, DecodeError, GrayImage, PatchArea, Picture, Reconstructor, RgbImage, content_area, decode,
};
use crate::lens::FocalPower;

/// Why a folder is no scan.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The folder cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Unreadable {
        /// The folder or file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// It holds no pictures of a scan.
    #[error("there is no picture named like pose0001_f0.350.png in {}", .0.display())]
    Empty(PathBuf),
    /// A name that cannot be meant.
    #[error("{}: {reason}", path.display())]
    Name {
        /// The file.
        path: PathBuf,
        /// What is wrong with its name.
        reason: String,
    },
    /// Poses without any picture.
    #[error("poses {} are missing: there is no picture of them", numbers(.0))]
    MissingPoses(Vec<usize>),
    /// A pose without some of the others' focal powers.
    #[error("pose {pose} has no picture at focal power {power:.3}, which other poses have")]
    MissingPower {
        /// The pose's number.
        pose: usize,
        /// The focal power.
        power: f64,
    },
    /// A stack of one picture.
    #[error("a scan needs at least two focal powers; every picture is at {0:.3}")]
    OnePower(f64),
    /// Pictures of different sizes.
    #[error("{} is {}x{} pixels, but {} is {}x{}; a scan's pictures are all of one size",
        other.display(), other_size.0, other_size.1, first.display(), size.0, size.1)]
    Sizes {
        /// The first picture.
        first: PathBuf,
        /// Its width and height.
        size: (usize, usize),
        /// One that differs.
        other: PathBuf,
        /// Its width and height.
        other_size: (usize, usize),
    },
    /// Pictures too small to be of use.
    #[error("{} is {}x{} pixels; a scan's pictures must be at least {LEAST_SIDE}x{LEAST_SIDE}", path.display(), size.0, size.1)]
    TooSmall {
        /// The file.
        path: PathBuf,
        /// Its width and height.
        size: (usize, usize),
    },
    /// A file that is no picture.
    #[error("{}: {error}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// Why.
        error: DecodeError,
    },
    /// It cannot be stored.
    #[error(transparent)]
    Record(#[from] RecordError),
}

impl From<ScanError> for ImportError {
    fn from(error: ScanError) -> Self {
        Self::Record(error.into())
    }
}

/// What a folder holds: for each pose its number there, and a file for each focal power, rising.
#[derive(Debug)]
pub struct Imported {
    poses: BTreeMap<usize, Vec<(FocalPower, PathBuf)>>,
}

impl Imported {
    /// Looks through `folder` and the folders in it. Names are read and compared; pictures are not yet opened.
    ///
    /// # Errors
    /// When names make no sense, or poses or focal powers are missing.
    pub fn look(folder: &Path) -> Result<Self, ImportError> {
        let mut poses: BTreeMap<usize, Vec<(FocalPower, PathBuf)>> = BTreeMap::new();
        for path in files(folder)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match parse(&name) {
                None => {}
                Some(Err(reason)) => return Err(ImportError::Name { path, reason }),
                Some(Ok((pose, power))) => poses.entry(pose).or_default().push((power, path)),
            }
        }
        for stack in poses.values_mut() {
            stack.sort_by(|a, b| a.0.get().total_cmp(&b.0.get()));
            if let Some(pair) = stack.windows(2).find(|pair| pair[0].0 == pair[1].0) {
                let reason = format!("{} is of the same pose and focal power", pair[0].1.display());
                return Err(ImportError::Name { path: pair[1].1.clone(), reason });
            }
        }
        let (Some(&first), Some(&last)) = (poses.keys().next(), poses.keys().next_back()) else {
            return Err(ImportError::Empty(folder.to_owned()));
        };
        let missing: Vec<usize> = (first..=last).filter(|number| !poses.contains_key(number)).take(10_000).collect();
        if !missing.is_empty() {
            return Err(ImportError::MissingPoses(missing));
        }
        let imported = Self { poses };
        imported.check_powers()?;
        Ok(imported)
    }

    fn check_powers(&self) -> Result<(), ImportError> {
        let powers = self.powers();
        if let [one] = powers[..] {
            return Err(ImportError::OnePower(one.get()));
        }
        for (&pose, stack) in &self.poses {
            let lacks = |power: &&FocalPower| !stack.iter().any(|(have, _)| have == *power);
            if let Some(power) = powers.iter().find(lacks) {
                return Err(ImportError::MissingPower { pose, power: power.get() });
            }
        }
        Ok(())
    }

    /// Every focal power of any pose, rising.
    fn powers(&self) -> Vec<FocalPower> {
        let mut powers: Vec<FocalPower> = self.poses.values().flatten().map(|(power, _)| *power).collect();
        powers.sort_by(|a, b| a.get().total_cmp(&b.get()));
        powers.dedup();
        powers
    }

    /// Number of poses.
    #[must_use]
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no pose.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }
}

/// Stores `imported` as a scan in `out`; poses are numbered from 1 there. `progress` is told after each.
///
/// # Errors
/// When a picture cannot be used, or the scan not be written.
pub fn import(imported: &Imported, camera: &str, out: &Path, progress: &dyn Fn()) -> Result<(), ImportError> {
    let header = Header {
        format: FORMAT.to_owned(),
        version: VERSION,
        software: concat!("parfocal ", env!("CARGO_PKG_VERSION")).to_owned(),
        camera: camera.to_owned(),
        lens: None,
        simulated: false,
        calibration: None,
        seed: 0,
        order: Order::Unknown,
        poses: imported.len(),
        focal_powers: imported.powers(),
    };
    let mut reader = Reader { reconstructor: Reconstructor::new(&Calibration::default()), first: None };
    // Before anything is written.
    imported.poses.values().flatten().try_for_each(|(_, path)| reader.measure(path))?;
    let mut recording = Recording::open(out, &header)?;
    for (pose, stack) in (1..).zip(imported.poses.values()) {
        if recording.folder().poses().contains_key(&pose) {
            continue;
        }
        let powers: Vec<FocalPower> = stack.iter().map(|(power, _)| *power).collect();
        let pictures = stack.iter().map(|(_, path)| reader.read(path)).collect::<Result<Vec<_>, _>>()?;
        let patch = patch(&pictures).ok_or_else(|| ImportError::Empty(out.to_owned()))?;
        recording.store(&shot(pose, &powers, Taken { pictures, patch, truth: None }))?;
        progress();
    }
    Ok(())
}

/// The patch in the content area that the first picture shows.
fn patch(pictures: &[GrayImage]) -> Option<PatchArea> {
    let first = pictures.first()?;
    PatchArea::central(first.width, first.height, content_area::detect(first).as_ref()).ok()
}

/// Reads pictures and sees to it that all are of one size.
struct Reader {
    reconstructor: Reconstructor,
    first: Option<(PathBuf, (usize, usize))>,
}

impl Reader {
    /// Compares a picture's size, of which only the beginning is read, to the first one's.
    fn measure(&mut self, path: &Path) -> Result<(), ImportError> {
        let damaged = |error: image::ImageError| ImportError::Picture {
            path: path.to_owned(),
            error: DecodeError::Damaged(error.to_string()),
        };
        let (width, height) = image::image_dimensions(path).map_err(damaged)?;
        self.check(path, (width as usize, height as usize))
    }

    fn check(&mut self, path: &Path, size: (usize, usize)) -> Result<(), ImportError> {
        if size.0 < LEAST_SIDE || size.1 < LEAST_SIDE {
            return Err(ImportError::TooSmall { path: path.to_owned(), size });
        }
        match &self.first {
            None => self.first = Some((path.to_owned(), size)),
            Some((first, first_size)) if *first_size != size => {
                let (first, other) = (first.clone(), path.to_owned());
                return Err(ImportError::Sizes { first, size: *first_size, other, other_size: size });
            }
            Some(_) => {}
        }
        Ok(())
    }

    fn read(&mut self, path: &Path) -> Result<GrayImage, ImportError> {
        let unreadable = |error| ImportError::Unreadable { path: path.to_owned(), error };
        let bytes = std::fs::read(path).map_err(unreadable)?;
        match decode(&bytes, false) {
            Ok(Picture::Gray(gray) | Picture::Rgb(_, gray)) => Ok(gray),
            Ok(Picture::Mosaic(mosaic)) => {
                let mut gray = GrayImage::default();
                self.reconstructor.reconstruct(&mosaic, &mut RgbImage::default(), &mut gray);
                Ok(gray)
            }
            Err(error) => Err(ImportError::Picture { path: path.to_owned(), error }),
        }
    }
}

/// The files in `folder` and in the folders right in it, by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let entries = |folder: &Path| -> Result<Vec<PathBuf>, ImportError> {
        let unreadable = |error| ImportError::Unreadable { path: folder.to_owned(), error };
        let entries = std::fs::read_dir(folder).map_err(unreadable)?;
        entries.map(|entry| entry.map(|entry| entry.path()).map_err(unreadable)).collect()
    };
    let (folders, mut files): (Vec<_>, Vec<_>) = entries(folder)?.into_iter().partition(|path| path.is_dir());
    for folder in folders {
        files.extend(entries(&folder)?);
    }
    files.sort();
    Ok(files)
}

/// Pose and focal power of a name like `pose0001_f0.350.png`; `None` of a file that means something else.
fn parse(name: &str) -> Option<Result<(usize, FocalPower), String>> {
    let (stem, extension) = name.rsplit_once('.')?;
    if !["png", "jpg", "jpeg", "tif", "tiff"].iter().any(|known| extension.eq_ignore_ascii_case(known)) {
        return None;
    }
    let (pose, power) = stem.strip_prefix("pose")?.split_once("_f")?;
    let number = pose.parse::<usize>().map_err(|_| format!("'{pose}' is no number of a pose"));
    let power = power
        .parse::<f64>()
        .map_err(|_| format!("'{power}' is no focal power"))
        .and_then(|value| FocalPower::new(value).map_err(|error| error.to_string()));
    Some(number.and_then(|number| power.map(|power| (number, power))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_pose_and_focal_power() {
        let parsed = |name| parse(name).map(|parsed| parsed.map(|(pose, power)| (pose, power.get())));
        assert_eq!(parsed("pose0012_f0.350.png"), Some(Ok((12, 0.35))));
        assert_eq!(parsed("pose3_f1.TIFF"), Some(Ok((3, 1.0))));
        assert_eq!(parsed("notes.txt"), None);
        assert_eq!(parsed("overview.png"), None);
        assert!(parsed("pose1_f1.5.png").unwrap().unwrap_err().contains("from 0 to 1"));
        assert!(parsed("poseA_f0.5.png").unwrap().unwrap_err().contains("no number"));
    }
}
