//! Imports a scan: a folder of pictures named by pose and focal power, recorded by any program.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::{PosePictures, shot};
use crate::LearningError;
use crate::scans::mosaics::RawMosaics;
use parfocal_base::FocalPower;
use parfocal_base::files::is_systems_own;
use parfocal_base::notices::tell;
use parfocal_devices::camera::footage::{WideSamples, is_picture, is_raw, picture_head};
use parfocal_devices::camera::recorded::{
    Header, LEAST_SIDE, MOST_POSES, ScanError, ScanFolder, ScanRecording, poses as numbered,
};
use parfocal_imaging::{
    DecodeError, GrayImage, PatchArea, Picture, PictureFile, PixelFormat, Reconstructor, SENSOR_SIZE, content_area,
};

/// The scan in a folder: for each pose number, a file for each focal power, in rising order.
#[derive(Debug)]
pub struct Imported {
    poses: BTreeMap<usize, Vec<(FocalPower, PathBuf)>>,
    /// Bits of the samples in 16-bit files, if the caller knows them.
    bits: Option<u8>,
    /// The format of raw mosaics, if the caller knows it.
    raw: Option<PixelFormat>,
}

impl Imported {
    /// Searches `folder` and the folders directly in it. Reads and compares names, but does not open pictures yet.
    ///
    /// The samples of 16-bit files are numbers of so many `bits`; if it is `None`, of the fewest that hold the largest
    /// sample of all pictures. Raw mosaics are in the format `raw`; if it is `None`, in the one of their length.
    ///
    /// # Errors
    /// If names make no sense, or poses or focal powers are missing.
    pub fn look(folder: &Path, bits: Option<u8>, raw: Option<PixelFormat>) -> Result<Self, LearningError> {
        let mut poses: BTreeMap<usize, Vec<(FocalPower, PathBuf)>> = BTreeMap::new();
        for path in files(folder)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match parse(&name) {
                None => {}
                Some(Err(reason)) => return Err(LearningError::of(&path, reason)),
                Some(Ok((pose, power))) => poses.entry(pose).or_default().push((power, path)),
            }
        }

        for stack in poses.values_mut() {
            stack.sort_by(|a, b| a.0.get().total_cmp(&b.0.get()));
            if let Some(pair) = stack.windows(2).find(|pair| pair[0].0 == pair[1].0) {
                let reason = format!("{} is of the same pose and focal power", pair[0].1.display());
                return Err(LearningError::of(&pair[1].1, reason));
            }
        }

        let (Some(&first), Some(&last)) = (poses.keys().next(), poses.keys().next_back()) else {
            return Err(empty(folder));
        };

        let missing: Vec<usize> = (first..=last).filter(|number| !poses.contains_key(number)).take(10_000).collect();
        if !missing.is_empty() {
            let poses = numbered(&missing);
            bail!("there is no picture of {poses} in {}; pose numbers must have no gaps", folder.display());
        }

        if poses.len() > MOST_POSES {
            let folder = folder.display();
            let count = poses.len();
            bail!("{folder} holds {count} poses; a scan has at most {MOST_POSES}: import it in parts");
        }

        let imported = Self { poses, bits, raw };
        imported.check_powers()?;
        Ok(imported)
    }

    fn check_powers(&self) -> Result<(), LearningError> {
        let powers = self.powers();
        if let [one] = powers[..] {
            let one = one.get();
            bail!("a scan needs at least two focal powers; every picture is at {one:.3}");
        }
        for (&pose, stack) in &self.poses {
            let lacks = |power: &&FocalPower| !stack.iter().any(|(have, _)| have == *power);
            if let Some(power) = powers.iter().find(lacks) {
                let power = power.get();
                bail!("pose {pose} has no picture at focal power {power:.3}, which other poses have");
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
    pub fn count(&self) -> usize {
        self.poses.len()
    }
}

/// Stores `imported` as a scan in `out`; poses are numbered from 1 there. Poses that `out` holds already must show the
/// same pictures. `progress` is called after each pose.
///
/// # Errors
/// If a picture cannot be used, `out` holds another scan, or it cannot be written.
pub fn import(imported: &Imported, camera: &str, out: &Path, progress: &dyn Fn()) -> Result<(), LearningError> {
    let header = Header::new(camera, 0, imported.count(), imported.powers());

    let mut reader = Reader {
        reconstructor: Reconstructor::default(),
        mosaics: RawMosaics::new(imported.raw),
        first: None,
        wide: WideSamples::default(),
        bits: 16,
    };

    // Checks all sizes before anything is written.
    imported.poses.values().flatten().try_for_each(|(_, path)| reader.measure(path))?;
    reader.settle_bits(imported.bits)?;

    let mut recording = ScanRecording::open(out, &header)?;
    for (pose, stack) in (1..).zip(imported.poses.values()) {
        let powers: Vec<FocalPower> = stack.iter().map(|(power, _)| *power).collect();
        let pictures = stack.iter().map(|(_, path)| reader.read(path)).collect::<Result<Vec<_>, _>>()?;

        if recording.folder().poses().contains_key(&pose) {
            if !shows(recording.folder(), pose, &pictures)? {
                let difference = format!("with other pictures of pose {pose}");
                return Err(ScanError::other(out, &difference).into());
            }
        } else {
            let patch = patch(&pictures).ok_or_else(|| empty(out))?;
            recording.store(&shot(pose, &powers, PosePictures { pictures, patch, truth: None }))?;
        }
        progress();
    }
    Ok(())
}

/// Whether the stored pictures of `pose` equal `pictures`, which are in order of rising focal power.
fn shows(scan: &ScanFolder, pose: usize, pictures: &[GrayImage]) -> Result<bool, ScanError> {
    let Some(stored) = scan.poses().get(&pose) else { return Ok(false) };
    for (power, picture) in scan.header().focal_powers.iter().zip(pictures) {
        let Some(image) = stored.images.iter().find(|image| image.focal_power == *power) else { return Ok(false) };
        let kept = scan.picture(stored, image)?;

        // Levels are rounded when they are stored.
        let mut levels = kept.data.iter().zip(&picture.data);
        let alike = levels.all(|(kept, level)| (kept - level).abs() <= 0.5);
        if (kept.width, kept.height) != (picture.width, picture.height) || !alike {
            return Ok(false);
        }
    }

    Ok(true)
}

/// The patch in the content area that the first picture shows.
fn patch(pictures: &[GrayImage]) -> Option<PatchArea> {
    let first = pictures.first()?;
    PatchArea::central(first.width, first.height, content_area::detect(first).as_ref()).ok()
}

/// Reads pictures and checks that all are of one size.
struct Reader {
    reconstructor: Reconstructor,
    mosaics: RawMosaics,
    first: Option<(PathBuf, (usize, usize))>,
    wide: WideSamples,
    /// Bits of samples that fill 16.
    bits: u8,
}

impl Reader {
    /// Decides how many bits the samples have that were measured: as many as are `given`, else the fewest that hold all.
    fn settle_bits(&mut self, given: Option<u8>) -> Result<(), LearningError> {
        if let Some(bits) = given {
            self.wide.check(bits)?;
            self.bits = bits;
            return Ok(());
        }

        let (bits, note) = self.wide.guess();
        self.bits = bits;
        if let Some(note) = note {
            tell(format_args!("note: {note}; --bits says otherwise"));
        }
        Ok(())
    }

    /// Compares a picture's size with the first one's. Reads only the beginning of the file, except of one with 16-bit
    /// samples, whose largest counts, and of a raw mosaic.
    fn measure(&mut self, path: &Path) -> Result<(), LearningError> {
        if is_raw(path) {
            self.read(path)?;
            return self.check(path, SENSOR_SIZE);
        }

        let head = picture_head(path).map_err(unreadable(path))?;
        let size = PictureFile::open(&head).and_then(|file| file.single()?.size(0));
        let size = size.map_err(unusable(path))?;
        self.check(path, size)?;

        if PictureFile::open(&head).map_err(unusable(path))?.is_wide() {
            let bytes = std::fs::read(path).map_err(unreadable(path))?;
            let seen = PictureFile::open(&bytes).and_then(|file| self.wide.see(path, &file, 0));
            seen.map_err(unusable(path))?;
        }
        Ok(())
    }

    fn check(&mut self, path: &Path, size: (usize, usize)) -> Result<(), LearningError> {
        let (width, height) = size;
        let is = format!("{} is {width}x{height} pixels", path.display());
        if width < LEAST_SIDE || height < LEAST_SIDE {
            bail!("{is}; a scan's pictures must be at least {LEAST_SIDE}x{LEAST_SIDE}");
        }

        let (first, (first_width, first_height)) = self.first.get_or_insert_with(|| (path.to_owned(), size));
        if (*first_width, *first_height) != size {
            let first = first.display();
            bail!("{is}, but {first} is {first_width}x{first_height}; all pictures of a scan must have one size");
        }
        Ok(())
    }

    fn read(&mut self, path: &Path) -> Result<GrayImage, LearningError> {
        let bytes = std::fs::read(path).map_err(unreadable(path))?;
        if is_raw(path) {
            let frame = self.mosaics.read(path, &bytes).map_err(unusable(path))?;
            return Ok(Picture::Mosaic(frame).into_gray(&mut self.reconstructor));
        }

        let file = PictureFile::open(&bytes).and_then(PictureFile::single).map_err(unusable(path))?;
        let picture = file.with_bits(self.bits).read(0, false).map_err(unusable(path))?;
        Ok(picture.into_gray(&mut self.reconstructor))
    }
}

/// The error that `path` holds no pictures of a scan.
fn empty(path: &Path) -> LearningError {
    LearningError::new(format!("there is no picture named like pose0001_f0.350.png in {}", path.display()))
}

fn unreadable(path: &Path) -> impl Fn(io::Error) -> LearningError {
    |error| LearningError::unreadable(path, &error)
}

fn unusable(path: &Path) -> impl Fn(DecodeError) -> LearningError {
    |error| LearningError::of(path, error)
}

/// The files in `folder` and in the folders directly in it, sorted.
fn files(folder: &Path) -> Result<Vec<PathBuf>, LearningError> {
    let entries = |folder: &Path| -> Result<Vec<PathBuf>, LearningError> {
        let entries = std::fs::read_dir(folder).map_err(unreadable(folder))?;
        entries.map(|entry| entry.map(|entry| entry.path()).map_err(unreadable(folder))).collect()
    };

    let (folders, mut files): (Vec<_>, Vec<_>) = entries(folder)?.into_iter().partition(|path| path.is_dir());
    for folder in folders {
        files.extend(entries(&folder)?);
    }

    // An operating system's own file may have the name of a picture: `._pose0001_f0.350.png`.
    files.retain(|file| !file.file_name().is_some_and(is_systems_own));
    files.sort();
    Ok(files)
}

/// Pose and focal power of a name like `pose0001_f0.350.png`; `None` for any other file.
fn parse(name: &str) -> Option<Result<(usize, FocalPower), String>> {
    if !is_picture(Path::new(name)) && !is_raw(Path::new(name)) {
        return None;
    }

    let (stem, _) = name.rsplit_once('.')?;
    let (pose, power) = stem.strip_prefix("pose")?.split_once("_f")?;
    let number = pose.parse::<usize>().map_err(|_| format!("'{pose}' is not the number of a pose"));
    let power = power
        .parse::<f64>()
        .map_err(|_| format!("'{power}' is not a focal power"))
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
        assert_eq!(parsed("pose3_f1.raw"), Some(Ok((3, 1.0))));
        assert_eq!(parsed("notes.txt"), None);
        assert_eq!(parsed("overview.png"), None);
        assert!(parsed("pose1_f1.5.png").unwrap().unwrap_err().contains("from 0 to 1"));
        assert!(parsed("poseA_f0.5.png").unwrap().unwrap_err().contains("is not the number of a pose"));
    }
}
