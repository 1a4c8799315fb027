//! The pictures of a footage camera over time: a video there and back again, or stills one after another.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::Bytes;
use turbojpeg::{Decompressor, Image, PixelFormat};

use super::video::{FootageError, Video};
use crate::imaging::{JpegEncoder, RgbImage};

/// Most pixels across and down: what the blur can follow in real time.
pub(super) const WIDTH: usize = 1024;
/// See [`WIDTH`].
pub(super) const HEIGHT: usize = 384;
/// Least pixels across and down.
pub(super) const LEAST: usize = 64;

/// Pictures a second of a video.
const FPS: u32 = 25;
/// Most pictures kept of a video, as JPEGs of 50 to 100 KB each: 30 seconds.
const MOST: usize = 30 * FPS as usize;
/// Quality of the kept JPEGs: hardly any loss.
const QUALITY: u8 = 96;
/// How long a still is shown.
const STILL: Duration = Duration::from_secs(5);

/// Where the pictures come from.
pub(super) enum Reel {
    /// A video.
    Video(Loop),
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
        Loop::open(path).map(Self::Video)
    }

    /// The picture at `time` after the start; asked for in rising order.
    pub(super) fn at(&mut self, time: Duration) -> Result<&RgbImage, FootageError> {
        match self {
            Self::Video(video) => Ok(video.at(time)),
            Self::Stills(stills) => stills.at(time),
        }
    }
}

/// A video, played forwards and backwards in turn so that it never jumps. It goes on being decoded while it plays.
pub(super) struct Loop {
    kept: Arc<Mutex<Vec<Bytes>>>,
    loader: Option<JoinHandle<()>>,
    decompressor: Option<Decompressor>,
    index: usize,
    backwards: bool,
    steps: u128,
    picture: RgbImage,
}

impl Loop {
    fn open(path: &Path) -> Result<Self, FootageError> {
        let failed = |error: &dyn std::fmt::Display| FootageError::unreadable(path, error);
        let mut video = Video::open(path, FPS, WIDTH, HEIGHT)?;
        let first = video.next().ok_or_else(|| failed(&"it holds no pictures"))?;
        large_enough(path, first.width, first.height)?;
        let mut encoder = JpegEncoder::new(QUALITY).map_err(|error| failed(&error))?;
        let jpeg = encoder.encode(&first).map_err(|error| failed(&error))?;
        let kept = Arc::new(Mutex::new(vec![jpeg]));
        let shelf = Arc::clone(&kept);
        let loader = std::thread::Builder::new().name("footage".to_owned());
        let loader = loader.spawn(move || load(video, encoder, &shelf)).map_err(|error| failed(&error))?;
        let decompressor = Decompressor::new().ok();
        let loader = Some(loader);
        Ok(Self { kept, loader, decompressor, index: 0, backwards: false, steps: 0, picture: first })
    }

    fn at(&mut self, time: Duration) -> &RgbImage {
        let due = time.as_nanos() * u128::from(FPS) / 1_000_000_000;
        if due > self.steps {
            let jpeg = {
                let kept = shelf(&self.kept);
                while self.steps < due {
                    (self.index, self.backwards) = there_and_back(self.index, self.backwards, kept.len());
                    self.steps += 1;
                }
                kept.get(self.index).cloned()
            };
            if let (Some(jpeg), Some(decompressor)) = (jpeg, &mut self.decompressor) {
                let RgbImage { width, height, data } = &mut self.picture;
                let (width, height) = (*width, *height);
                let image = Image { pixels: &mut data[..], width, pitch: 3 * width, height, format: PixelFormat::RGB };
                // The JPEG is our own, of this very size; should it fail, the picture before stays.
                let _ = decompressor.decompress(&jpeg, image);
            }
        }
        &self.picture
    }
}

impl Drop for Loop {
    fn drop(&mut self) {
        // A full shelf is the loader's sign to stop.
        shelf(&self.kept).resize(MOST, Bytes::new());
        if let Some(loader) = self.loader.take() {
            let _ = loader.join();
        }
    }
}

/// Keeps a video's pictures until there are enough of them, or they change size.
fn load(video: Video, mut encoder: JpegEncoder, kept: &Mutex<Vec<Bytes>>) {
    for picture in video {
        let Ok(jpeg) = encoder.encode(&picture) else { return };
        let mut kept = shelf(kept);
        if kept.len() >= MOST {
            return;
        }
        kept.push(jpeg);
    }
}

fn shelf(kept: &Mutex<Vec<Bytes>>) -> MutexGuard<'_, Vec<Bytes>> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The next index of `0, 1, .. count - 1, count - 2, .. 1, 0, 1, ..`, and whether it goes backwards.
fn there_and_back(index: usize, backwards: bool, count: usize) -> (usize, bool) {
    match (index, backwards) {
        (0, true) | (_, false) if index + 1 < count => (index + 1, false),
        (1.., _) => (index - 1, true),
        _ => (0, false),
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
            let (width, height) =
                image::image_dimensions(file).map_err(|error| FootageError::unreadable(file, error))?;
            large_enough(file, width as usize, height as usize)?;
        }
        let picture = still(&files[0])?;
        Ok(Self { files, shown: 0, picture })
    }

    #[allow(clippy::cast_possible_truncation, reason = "a remainder of the number of files")]
    fn at(&mut self, time: Duration) -> Result<&RgbImage, FootageError> {
        let turn = (time.as_nanos() / STILL.as_nanos() % self.files.len() as u128) as usize;
        if turn != self.shown {
            self.shown = turn;
            self.picture = still(&self.files[turn])?;
        }
        Ok(&self.picture)
    }
}

/// Reads a picture, scaled down to at most [`WIDTH`] x [`HEIGHT`].
fn still(file: &Path) -> Result<RgbImage, FootageError> {
    let picture = image::open(file).map_err(|error| FootageError::unreadable(file, error))?;
    let fits = picture.width() as usize <= WIDTH && picture.height() as usize <= HEIGHT;
    let scaled = if fits {
        picture
    } else {
        #[allow(clippy::cast_possible_truncation, reason = "small constants")]
        picture.resize(WIDTH as u32, HEIGHT as u32, image::imageops::FilterType::Triangle)
    };
    let rgb = scaled.to_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    large_enough(file, width, height)?;
    RgbImage::new(width, height, rgb.into_raw()).map_err(|error| FootageError::unreadable(file, error))
}

fn large_enough(path: &Path, width: usize, height: usize) -> Result<(), FootageError> {
    if width >= LEAST && height >= LEAST {
        return Ok(());
    }
    Err(FootageError::TooSmall { path: path.to_owned(), width, height, least: LEAST })
}

fn is_picture(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["png", "jpg", "jpeg", "tif", "tiff"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// The pictures in a folder, by name.
fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, FootageError> {
    let unreadable = |error: std::io::Error| FootageError::unreadable(folder, error);
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
    let mut files = paths.map_err(unreadable)?;
    files.retain(|file| is_picture(file));
    files.sort();
    if files.is_empty() { Err(FootageError::Empty(folder.to_owned())) } else { Ok(files) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_video_plays_there_and_back_again() {
        let mut place = (0, false);
        let mut played = vec![0];
        for _ in 0..8 {
            place = there_and_back(place.0, place.1, 4);
            played.push(place.0);
        }
        assert_eq!(played, [0, 1, 2, 3, 2, 1, 0, 1, 2]);
        assert_eq!(there_and_back(0, false, 1), (0, false), "a video of one picture stands still");
    }
}
