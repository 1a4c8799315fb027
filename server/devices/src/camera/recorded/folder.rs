//! Reads a recorded scan's folder, and checks everything the folder says before using any of it.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

use image::DynamicImage;
use sha2::{Digest, Sha256};

use super::{FORMAT, HEADER, Header, Image, LEAST_SIDE, MOST_POSES, POSES, Pose, ScanError, VERSION};
use parfocal_base::FocalPower;
use parfocal_imaging::{DecodeError, GrayImage, PATCH_SIDE, PictureFile};

/// A recorded scan, possibly with poses missing.
#[derive(Debug, Clone)]
pub struct ScanFolder {
    path: PathBuf,
    header: Header,
    poses: BTreeMap<usize, Pose>,
    /// Bytes of [`POSES`] that hold whole lines.
    pub(super) whole_bytes: u64,
}

/// A picture that differs from what was stored, or cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The picture's file, relative to the scan's folder.
    pub file: String,
    /// What is wrong, as a sentence.
    pub reason: String,
}

impl ScanFolder {
    /// Reads the description of the scan in `path`. Pictures are only read when they are asked for.
    ///
    /// # Errors
    /// If there is no scan, or its description cannot be read or is invalid.
    pub fn open(path: &Path) -> Result<Self, ScanError> {
        let file = path.join(HEADER);
        let text = fs::read_to_string(&file).map_err(|error| match error.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => {
                ScanError(format!("{} is not a recorded scan: it has no {HEADER}", path.display()))
            }
            _ => ScanError::unreadable(&file)(error),
        })?;
        let header: Header = serde_json::from_str(&text).map_err(|error| ScanError::nonsense(&file, error))?;
        check_header(&header).map_err(|reason| ScanError::nonsense(&file, reason))?;

        let mut folder = Self { path: path.to_owned(), header, poses: BTreeMap::new(), whole_bytes: 0 };
        folder.read_poses()?;
        Ok(folder)
    }

    /// Reads every whole line. A last line without its end was being written when the power failed, and is left out.
    fn read_poses(&mut self) -> Result<(), ScanError> {
        let file = self.path.join(POSES);
        let text = match fs::read(&file) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            text => text.map_err(ScanError::unreadable(&file))?,
        };
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        self.whole_bytes = whole as u64;

        for (index, line) in text[..whole].split(|&byte| byte == b'\n').enumerate().filter(|(_, line)| !line.is_empty())
        {
            let wrong = |reason: String| ScanError::nonsense(&file, format!("line {}: {reason}", index + 1));
            let pose: Pose = serde_json::from_slice(line).map_err(|error| wrong(error.to_string()))?;
            self.check_pose(&pose).map_err(wrong)?;
            self.poses.insert(pose.pose, pose);
        }

        Ok(())
    }

    fn check_pose(&self, pose: &Pose) -> Result<(), String> {
        let Pose { pose: number, width, height, patch, .. } = *pose;
        if !(1..=self.header.poses).contains(&number) {
            return Err(format!("there is no pose {number} of {}", self.header.poses));
        }
        if self.poses.contains_key(&number) {
            return Err(format!("pose {number} is listed twice"));
        }

        if let Some(first) = self.of_another_size(width, height) {
            return Err(format!(
                "pose {number} is {width}x{height} pixels, but pose {} is {}x{}",
                first.pose, first.width, first.height
            ));
        }

        let fits = |corner: usize, length: usize| corner.checked_add(PATCH_SIDE).is_some_and(|end| end <= length);
        if width < LEAST_SIDE || height < LEAST_SIDE || !fits(patch.0, width) || !fits(patch.1, height) {
            return Err(format!(
                "the patch at {patch:?} does not fit into {width}x{height} pixels, or these are fewer than 64x64"
            ));
        }

        let mut powers: Vec<FocalPower> = pose.images.iter().map(|image| image.focal_power).collect();
        powers.sort_by(|a, b| a.get().total_cmp(&b.get()));
        if powers != self.header.focal_powers {
            return Err(format!("pose {number} does not have exactly one picture for each focal power"));
        }

        // A scan from elsewhere must not name files outside its folder.
        let inside = |file: &str| Path::new(file).components().all(|part| matches!(part, Component::Normal(_)));
        match pose.images.iter().find(|image| image.file.is_empty() || !inside(&image.file)) {
            Some(image) => Err(format!("{:?} is not a file in the scan's folder", image.file)),
            None => Ok(()),
        }
    }

    /// A stored pose whose pictures do not have this size.
    pub(super) fn of_another_size(&self, width: usize, height: usize) -> Option<&Pose> {
        self.poses.values().next().filter(|first| (first.width, first.height) != (width, height))
    }

    /// The scan's folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The scan's header: what was to be recorded.
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// The poses that are stored, by number.
    pub const fn poses(&self) -> &BTreeMap<usize, Pose> {
        &self.poses
    }

    pub(super) fn insert(&mut self, pose: Pose) {
        self.poses.insert(pose.pose, pose);
    }

    /// Numbers of the poses that are not stored.
    pub fn missing(&self) -> Vec<usize> {
        (1..=self.header.poses).filter(|number| !self.poses.contains_key(number)).collect()
    }

    /// The folder, if no pose is missing.
    ///
    /// # Errors
    /// If a pose is missing.
    pub fn whole(self) -> Result<Self, ScanError> {
        let missing = self.missing();
        if missing.is_empty() { Ok(self) } else { Err(ScanError::missing(&self.path, &missing, self.header.poses)) }
    }

    /// Reads a picture of `pose`. Its gray levels are whole numbers.
    ///
    /// # Errors
    /// If it cannot be read, or is not the picture that was stored.
    pub fn picture(&self, pose: &Pose, image: &Image) -> Result<GrayImage, ScanError> {
        let path = self.path.join(&image.file);
        let bytes = fs::read(&path).map_err(ScanError::unreadable(&path))?;
        if hex::encode(Sha256::digest(&bytes)) != image.sha256 {
            return Err(ScanError(format!(
                "{} is damaged: its SHA-256 differs from {POSES}; restore it from a copy, or record the scan again",
                path.display()
            )));
        }

        let undecodable = |error: DecodeError| ScanError(format!("{}: {error}", path.display()));
        // Never a mosaic, not even at the sensor's size.
        let read = PictureFile::open(&bytes).and_then(PictureFile::single).and_then(|file| file.read_any(0));
        let size = (pose.width, pose.height);
        match read {
            Ok(DynamicImage::ImageLuma8(gray)) if (gray.width() as usize, gray.height() as usize) == size => {
                let (width, height) = size;
                Ok(GrayImage { width, height, data: gray.into_raw().into_iter().map(f32::from).collect() })
            }
            Ok(_) => {
                let error = DecodeError::OtherPixels(format!("not {}x{} gray of 8 bit", pose.width, pose.height));
                Err(undecodable(error))
            }
            Err(error) => Err(undecodable(error)),
        }
    }

    /// Checks every picture of `pose` against its checksum. Returns the bytes of the undamaged pictures, and the
    /// damage.
    pub fn check(&self, pose: &Pose) -> (u64, Vec<Damage>) {
        let mut bytes = 0;
        let mut damages = Vec::new();

        for image in &pose.images {
            let file = image.file.clone();
            match fs::read(self.path.join(&file)) {
                Ok(content) if hex::encode(Sha256::digest(&content)) == image.sha256 => bytes += content.len() as u64,
                Ok(_) => damages.push(Damage { file, reason: "its SHA-256 differs".to_owned() }),
                Err(error) => damages.push(Damage { file, reason: format!("it cannot be read: {error}") }),
            }
        }

        (bytes, damages)
    }
}

fn check_header(header: &Header) -> Result<(), String> {
    let Header { format, version, poses, focal_powers, .. } = header;
    if format != FORMAT {
        return Err(format!("its format is {format:?}, not {FORMAT:?}"));
    }
    if *version != VERSION {
        return Err(format!("its version is {version}; this program reads version {VERSION}"));
    }
    if !(1..=MOST_POSES).contains(poses) {
        return Err(format!("it has {poses} poses; a scan has 1 to {MOST_POSES}"));
    }
    if focal_powers.len() < 2 || !focal_powers.is_sorted_by(|a, b| a < b) {
        return Err("it needs at least two focal powers, in rising order".to_owned());
    }
    Ok(())
}
