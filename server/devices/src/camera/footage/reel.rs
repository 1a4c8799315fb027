//! The pictures of a footage camera over time: a video, or stills one after another.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::time::Duration;

use image::ImageReader;

use super::clip::Clip;
use super::size::{HEIGHT, WIDTH, large_enough};
use super::video::FootageError;
use parfocal_imaging::{RgbImage, decode_any, is_mosaic};

/// Time for which a still is shown.
const STILL: Duration = Duration::from_secs(5);

/// The source of the pictures.
pub(super) enum Reel {
    /// A video.
    Video(Clip),
    /// Stills.
    Stills(Stills),
}

impl Reel {
    /// Opens a video, an image, or a folder of images.
    pub(super) fn open(path: &Path) -> Result<Self, FootageError> {
        let metadata = std::fs::metadata(path).map_err(|error| FootageError::unreadable(path, error))?;
        if metadata.is_dir() {
            return Stills::open(pictures_in(path)?).map(Self::Stills);
        }
        if is_picture(path) {
            return Stills::open(vec![path.to_owned()]).map(Self::Stills);
        }
        Clip::open(path).map(Self::Video)
    }

    /// The picture at `time` after the start; times must be asked for in rising order.
    pub(super) fn at(&mut self, time: Duration) -> Result<&RgbImage, FootageError> {
        match self {
            Self::Video(video) => Ok(video.at(time)),
            Self::Stills(stills) => stills.at(time),
        }
    }
}

/// Stills, each shown for a while, over and over.
pub(super) struct Stills {
    files: Vec<PathBuf>,
    shown: usize,
    picture: RgbImage,
}

impl Stills {
    fn open(files: Vec<PathBuf>) -> Result<Self, FootageError> {
        for file in &files {
            let reader = picture_reader(file).map_err(|error| FootageError::unreadable(file, error))?;
            let (width, height) = reader.into_dimensions().map_err(|error| FootageError::unreadable(file, error))?;
            large_enough(file, width as usize, height as usize)?;
        }

        let picture = still(&files[0])?;
        Ok(Self { files, shown: 0, picture })
    }

    fn at(&mut self, time: Duration) -> Result<&RgbImage, FootageError> {
        let turn = (time.as_nanos() / STILL.as_nanos() % self.files.len() as u128) as usize;
        if turn != self.shown {
            self.shown = turn;
            self.picture = still(&self.files[turn])?;
        }
        Ok(&self.picture)
    }
}

/// Begins to read the picture in `file`. The contents decide on the format, because the name may be wrong.
///
/// # Errors
/// If the file cannot be read.
pub fn picture_reader(file: &Path) -> io::Result<ImageReader<BufReader<File>>> {
    ImageReader::open(file).and_then(ImageReader::with_guessed_format)
}

/// Reads a picture, scaled down to at most [`WIDTH`] x [`HEIGHT`].
fn still(file: &Path) -> Result<RgbImage, FootageError> {
    let bytes = std::fs::read(file).map_err(|error| FootageError::unreadable(file, error))?;
    let picture = decode_any(&bytes).map_err(|error| FootageError::unreadable(file, error))?;

    if is_mosaic(&picture) {
        // A mosaic's colours would have to be marked as estimated, which footage's are not.
        let reason = "it is a sensor's mosaic: look at it with `parfocal inspect`, or import it as part of a scan";
        return Err(FootageError::unreadable(file, reason));
    }

    let fits = picture.width() as usize <= WIDTH && picture.height() as usize <= HEIGHT;
    let scaled =
        if fits { picture } else { picture.resize(WIDTH as u32, HEIGHT as u32, image::imageops::FilterType::Triangle) };
    let rgb = scaled.to_rgb8();

    let width = rgb.width() as usize;
    let height = rgb.height() as usize;
    large_enough(file, width, height)?;
    RgbImage::new(width, height, rgb.into_raw()).map_err(|error| FootageError::unreadable(file, error))
}

/// Whether `path` has the file extension of a picture.
#[must_use]
pub fn is_picture(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["png", "jpg", "jpeg", "tif", "tiff"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// The pictures in a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read or has no picture.
pub fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, FootageError> {
    let unreadable = |error: std::io::Error| FootageError::unreadable(folder, error);
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
    let mut files = paths.map_err(unreadable)?;

    files.retain(|file| is_picture(file));
    files.sort();
    if files.is_empty() { Err(FootageError::Empty(folder.to_owned())) } else { Ok(files) }
}
