//! Writes a recorded scan's folder. A pose's pictures get their final name all at once, when all are stored. Only then
//! does the pose get its line. So however the recording ends, each pose is either whole or missing.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::{HEADER, Header, Image, POSES, Pose, ScanError, ScanFolder};
use parfocal_base::FocalPower;
use parfocal_base::files::{LockedFile, is_new_or_empty, replace, write_through};
use parfocal_imaging::{GrayImage, PatchArea};

/// A scan that is being recorded, by one process at a time.
#[derive(Debug)]
pub struct ScanRecording {
    folder: ScanFolder,
    /// The file of lines, locked as long as this value lives.
    journal: LockedFile,
}

/// A pose as it was taken.
#[derive(Debug, Clone)]
pub struct TakenPose {
    /// Its number, from 1.
    pub pose: usize,
    /// Its pictures, in the order in which they were taken; all of one size.
    pub images: Vec<(FocalPower, GrayImage)>,
    /// The patch's place.
    pub patch: PatchArea,
    /// The focal power at which the patch is sharpest in the stack.
    pub optimum: FocalPower,
    /// The best focal power; `None` unless a simulation knows it.
    pub truth: Option<FocalPower>,
}

impl TakenPose {
    /// Width and height of its pictures.
    fn size(&self) -> (usize, usize) {
        self.images.first().map_or((0, 0), |(_, picture)| (picture.width, picture.height))
    }
}

impl ScanRecording {
    /// Begins a scan in `path`, a new or empty folder, or continues the scan there if it was begun with
    /// the same `header` (apart from the software's version).
    ///
    /// # Errors
    /// If the folder holds anything else, another process records into it, or it cannot be written.
    pub fn open(path: &Path, header: &Header) -> Result<Self, ScanError> {
        let unwritable = |error: io::Error| ScanError::unwritable(path, 0, &error);
        fs::create_dir_all(path).map_err(unwritable)?;

        if !path.join(HEADER).exists() {
            if !is_new_or_empty(path).map_err(unwritable)? {
                let path = path.display();
                return Err(ScanError(format!("{path} is not empty and is not a scan; choose a new folder")));
            }
            replace(&path.join(HEADER), &pretty(header)).map_err(unwritable)?;
        }

        let lines = path.join(POSES);
        let journal = File::options().create(true).append(true).open(&lines);
        let journal = journal.map_err(|error| ScanError::unwritable(&lines, 0, &error))?;
        let busy = |_| ScanError(format!("another parfocal is recording into {}", path.display()));
        let journal = LockedFile::of(journal).map_err(busy)?;

        let folder = ScanFolder::open(path)?;
        same(folder.header(), header).map_err(|difference| ScanError::other(path, difference))?;

        let recording = Self { folder, journal };
        recording.tidy_up()?;
        Ok(recording)
    }

    /// The scan's folder, with the poses stored so far.
    pub const fn folder(&self) -> &ScanFolder {
        &self.folder
    }

    /// Stores a pose.
    ///
    /// # Errors
    /// If its pictures have another size than those of the poses before, or it cannot be written. Then no part of it is
    /// left.
    pub fn store(&mut self, shot: &TakenPose) -> Result<(), ScanError> {
        let (width, height) = shot.size();
        if let Some(first) = self.folder.of_another_size(width, height) {
            let had = format!("with pictures of {}x{} pixels, not {width}x{height}", first.width, first.height);
            return Err(ScanError::other(self.folder.path(), &had));
        }

        let name = format!("pose{:04}", shot.pose);
        let partial = self.folder.path().join(format!(".{name}.partial"));
        let stored = self.write(shot, &name, &partial);

        if stored.is_err() {
            let _ = fs::remove_dir_all(&partial);
        }

        let pose = stored.map_err(|error| self.unwritable(&error))?;
        self.folder.insert(pose);
        Ok(())
    }

    fn write(&self, shot: &TakenPose, name: &str, partial: &Path) -> io::Result<Pose> {
        fs::create_dir(partial)?;
        let rounded = |power: f64| format!("{power:.3}");
        let unlike: BTreeSet<String> = shot.images.iter().map(|(power, _)| rounded(power.get())).collect();
        let write = |(power, picture): &(FocalPower, GrayImage)| -> io::Result<Image> {
            let png = png(picture)?;

            // The file is named by three decimals of the power, or by all digits if three do not tell the powers apart.
            let digits = if unlike.len() == shot.images.len() { rounded(power.get()) } else { power.get().to_string() };
            let file = format!("{name}_f{digits}.png");

            write_through(&partial.join(&file), &png)?;
            Ok(Image { focal_power: *power, file: format!("{name}/{file}"), sha256: hex::encode(Sha256::digest(&png)) })
        };

        let images = shot.images.par_iter().map(write).collect::<io::Result<Vec<_>>>()?;
        let whole = self.folder.path().join(name);

        // A folder under this name belongs to a pose whose line could not be written.
        let _ = fs::remove_dir_all(&whole);
        fs::rename(partial, &whole)?;

        let (width, height) = shot.size();
        let TakenPose { pose, patch, optimum, truth, .. } = *shot;
        let pose = Pose { pose, width, height, patch: (patch.x, patch.y), optimum, truth, images };

        self.note(&pose).inspect_err(|_| {
            let _ = fs::remove_dir_all(&whole);
        })?;

        Ok(pose)
    }

    /// Writes the line of `pose`. If that fails, the file stays as it was.
    fn note(&self, pose: &Pose) -> io::Result<()> {
        let mut journal: &File = &self.journal;
        let before = journal.metadata()?.len();
        let line = serde_json::to_string(pose)? + "\n";

        journal.write_all(line.as_bytes()).and_then(|()| journal.sync_data()).inspect_err(|_| {
            // Half a line would spoil the next one.
            let _ = journal.set_len(before);
        })
    }

    /// Removes what a killed recording left unfinished.
    fn tidy_up(&self) -> Result<(), ScanError> {
        let unwritable = |error: io::Error| self.unwritable(&error);
        self.journal.set_len(self.folder.whole_bytes).map_err(unwritable)?;

        for entry in fs::read_dir(self.folder.path()).map_err(unwritable)?.filter_map(Result::ok) {
            if is_partial(&entry.file_name().to_string_lossy()) {
                fs::remove_dir_all(entry.path()).map_err(unwritable)?;
            }
        }
        Ok(())
    }

    fn unwritable(&self, error: &io::Error) -> ScanError {
        ScanError::unwritable(self.folder.path(), self.folder.poses().len(), error)
    }
}

fn is_partial(name: &str) -> bool {
    name.starts_with(".pose") && name.ends_with(".partial")
}

/// Compares two headers; the error names the first difference.
fn same(stored: &Header, asked: &Header) -> Result<(), &'static str> {
    let differs = [
        (stored.camera != asked.camera, "of another camera"),
        (stored.lens != asked.lens, "with another lens"),
        (stored.calibration != asked.calibration, "with another calibration"),
        (stored.seed != asked.seed, "of another seed"),
        (stored.poses != asked.poses, "of another number of poses"),
        (stored.focal_powers != asked.focal_powers, "of other focal powers"),
        (stored.simulated != asked.simulated || stored.order != asked.order, "of another kind"),
    ];

    differs.iter().find(|(differs, _)| *differs).map_or(Ok(()), |(_, how)| Err(how))
}

fn pretty(header: &Header) -> Vec<u8> {
    // Serializing cannot fail: the header holds only names, numbers and lists of them.
    let mut text = serde_json::to_vec_pretty(header).unwrap_or_default();
    text.push(b'\n');
    text
}

/// A gray picture as 8-bit PNG; levels are rounded.
fn png(picture: &GrayImage) -> io::Result<Vec<u8>> {
    let levels: Vec<u8> = picture.data.iter().map(|value| value.round() as u8).collect();

    let mut bytes = Vec::with_capacity(levels.len());
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&levels, picture.width as u32, picture.height as u32, ExtendedColorType::L8)
        .map_err(io::Error::other)?;
    Ok(bytes)
}
