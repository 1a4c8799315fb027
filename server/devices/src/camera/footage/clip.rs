//! A video over time. A short one plays forwards and backwards, so that it never jumps. A long one plays
//! from beginning to end over and over, with a cut in between; only a window that moves along with it is
//! kept in memory.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::Bytes;
use turbojpeg::{Decompressor, Image, PixelFormat};

use super::coverage::cut_off;
use super::video::{FootageError, HEIGHT, Video, WIDTH, large_enough};
use parfocal_base::notices::tell;
use parfocal_imaging::{JpegEncoder, RgbImage};

/// Pictures a second.
const FPS: u32 = 25;
/// Most pictures kept, as JPEGs of 50 to 100 KB each: 30 seconds.
const MOST: usize = 30 * FPS as usize;
/// Quality of the kept JPEGs: hardly any loss.
const QUALITY: u8 = 96;

/// A video. It is decoded while it plays.
pub(super) struct Clip {
    shelf: Arc<Shelf>,
    loader: Option<JoinHandle<()>>,
    decompressor: Option<Decompressor>,
    index: usize,
    backwards: bool,
    steps: u128,
    picture: RgbImage,
}

impl Clip {
    /// Opens a video.
    pub(super) fn open(path: &Path) -> Result<Self, FootageError> {
        Self::with(path, MOST)
    }

    /// Opens a video. At most `most` of its pictures are kept.
    fn with(path: &Path, most: usize) -> Result<Self, FootageError> {
        let failed = |error: &dyn std::fmt::Display| FootageError::unreadable(path, error);
        let mut video = Video::open(path, FPS, WIDTH, HEIGHT)?;
        let picture = video.next().ok_or_else(|| failed(&"it holds no pictures"))?;
        large_enough(path, picture.width, picture.height)?;
        if let Some(cut) = cut_off(path) {
            tell(format_args!("note: {} is cut off: {cut}", path.display()));
        }

        let mut encoder = JpegEncoder::new(QUALITY).map_err(|error| failed(&error))?;
        let first = encoder.encode(&picture).map_err(|error| failed(&error))?;

        let shelf = Arc::new(Shelf::new(first, most));
        let loader = Loader { path: path.to_owned(), encoder, shelf: Arc::clone(&shelf) };
        let thread = std::thread::Builder::new().name("footage".to_owned());
        let thread = thread.spawn(move || loader.run(video)).map_err(|error| failed(&error))?;

        let decompressor = Decompressor::new().ok();
        Ok(Self { shelf, loader: Some(thread), decompressor, index: 0, backwards: false, steps: 0, picture })
    }

    /// The picture at `time` after the start; times must be asked for in rising order.
    pub(super) fn at(&mut self, time: Duration) -> &RgbImage {
        let due = time.as_nanos() * u128::from(FPS) / 1_000_000_000;
        if due > self.steps {
            let jpeg = self.advance(due);
            if let (Some(jpeg), Some(decompressor)) = (jpeg, &mut self.decompressor) {
                let RgbImage { width, height, data } = &mut self.picture;
                let width = *width;
                let height = *height;
                let image = Image { pixels: &mut data[..], width, pitch: 3 * width, height, format: PixelFormat::RGB };
                // The JPEG is our own and has exactly this size. If decoding fails nevertheless, the previous picture
                // stays.
                let _ = decompressor.decompress(&jpeg, image);
            }
        }

        &self.picture
    }

    /// Moves on to step `due`, as far as the loader has come, and returns the picture there.
    fn advance(&mut self, due: u128) -> Option<Bytes> {
        let mut held = self.shelf.lock();

        while self.steps < due {
            self.steps += 1;
            if held.whole {
                (self.index, self.backwards) = there_and_back(self.index, self.backwards, held.pictures.len());
            } else if self.index + 1 < held.pictures.len() {
                self.index += 1;
                if held.pictures.len() >= self.shelf.most {
                    // The window moves on: the oldest picture makes room for a new one.
                    held.pictures.pop_front();
                    held.moved_on = true;
                    self.index -= 1;
                }
            }
        }

        self.shelf.changed.notify_all();
        held.pictures.get(self.index).cloned()
    }
}

impl Drop for Clip {
    fn drop(&mut self) {
        self.shelf.lock().closed = true;
        self.shelf.changed.notify_all();
        if let Some(loader) = self.loader.take() {
            let _ = loader.join();
        }
    }
}

/// The pictures that the loader adds and the clip takes.
struct Shelf {
    held: Mutex<Held>,
    changed: Condvar,
    most: usize,
}

struct Held {
    pictures: VecDeque<Bytes>,
    /// Whether no more pictures will come: the video ended, or cannot be read any further.
    whole: bool,
    /// Whether pictures have been dropped: the video is longer than the window.
    moved_on: bool,
    /// Whether the clip is gone.
    closed: bool,
}

impl Shelf {
    fn new(first: Bytes, most: usize) -> Self {
        let held = Held { pictures: VecDeque::from([first]), whole: false, moved_on: false, closed: false };
        Self { held: Mutex::new(held), changed: Condvar::new(), most }
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a picture once there is room; returns `false` if the clip is gone.
    fn put(&self, jpeg: Bytes) -> bool {
        let held = self.lock();
        let full = |held: &mut Held| held.pictures.len() >= self.most && !held.closed;
        let mut held = self.changed.wait_while(held, full).unwrap_or_else(PoisonError::into_inner);

        held.pictures.push_back(jpeg);
        self.changed.notify_all();
        !held.closed
    }
}

/// Fills the shelf, on a thread of its own.
struct Loader {
    path: PathBuf,
    encoder: JpegEncoder,
    shelf: Arc<Shelf>,
}

impl Loader {
    /// Puts the pictures of `video` on the shelf, over and over if the video is longer than the window.
    fn run(mut self, mut video: Video) {
        let mut first = true;
        loop {
            let mut count = 0_u64;
            for picture in &mut video {
                let Ok(jpeg) = self.encoder.encode(&picture) else { break };
                if !self.shelf.put(jpeg) {
                    return;
                }
                count += 1;
            }

            if std::mem::take(&mut first) {
                self.tell_damage(&mut video, count + 1);
            }
            let longer = self.shelf.lock().moved_on;
            let again = longer.then(|| Video::open(&self.path, FPS, WIDTH, HEIGHT).ok()).flatten();

            let Some(again) = again else {
                self.shelf.lock().whole = true;
                return self.shelf.changed.notify_all();
            };

            video = again;
        }
    }

    /// Says how many pictures of a damaged video could be read.
    fn tell_damage(&self, video: &mut Video, count: u64) {
        if let Some(damage) = video.damage() {
            let path = self.path.display();
            tell(format_args!(
                "note: {path} is damaged (ffmpeg: {damage}); {count} pictures of it, {FPS} a second, could be read"
            ));
        }
    }
}

/// The next index of `0, 1, .. count - 1, count - 2, .. 1, 0, 1, ..`, and whether it goes backwards.
fn there_and_back(index: usize, backwards: bool, count: usize) -> (usize, bool) {
    match (index, backwards) {
        (0, true) | (_, false) if index + 1 < count => (index + 1, false),
        (1.., _) => (index - 1, true),
        _ => (0, false),
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_short_video_plays_there_and_back_again() {
        let mut place = (0, false);
        let mut played = vec![0];
        for _ in 0..8 {
            place = there_and_back(place.0, place.1, 4);
            played.push(place.0);
        }

        assert_eq!(played, [0, 1, 2, 3, 2, 1, 0, 1, 2]);
        assert_eq!(there_and_back(0, false, 1), (0, false), "a video of one picture stands still");
    }

    /// A video of `count` pictures, each four levels of gray brighter than the one before.
    fn ramp(folder: &Path, count: u32) -> Option<PathBuf> {
        let file = folder.join("ramp.mkv");
        let source = format!("nullsrc=s=64x64:r={FPS},format=gbrp,geq=r='16+4*N':g='16+4*N':b='16+4*N'");

        let mut ffmpeg = Command::new("ffmpeg");
        ffmpeg.args(["-v", "error", "-f", "lavfi", "-i", &source, "-frames:v", &count.to_string(), "-c:v", "ffv1"]);

        let made = ffmpeg.arg(&file).status().is_ok_and(|status| status.success());
        if !made {
            eprintln!("skipped: no ffmpeg to make a video with");
        }
        made.then_some(file)
    }

    /// The numbers of the pictures shown in `steps` steps, and the most that were ever kept.
    fn played(clip: &mut Clip, steps: u32) -> (Vec<i32>, usize) {
        let mut most = 0;
        let mut numbers = Vec::new();
        for step in 1..=steps {
            // While the decoder is behind, a clip shows the same picture. So the test waits for the decoder.
            let behind = |held: &mut Held| !held.whole && clip.index + 1 >= held.pictures.len();
            let held = clip.shelf.changed.wait_while(clip.shelf.lock(), behind).unwrap();
            most = most.max(held.pictures.len());
            drop(held);

            let gray = clip.at(Duration::from_secs(1) * step / FPS).data[0];
            // Rounded to the nearest, because the JPEG may be off by one level.
            numbers.push((i32::from(gray) - 16 + 2) / 4);
        }
        (numbers, most)
    }

    #[test]
    fn a_long_video_plays_whole_and_over_again_in_bounded_memory() {
        let folder = tempfile::tempdir().unwrap();
        let Some(file) = ramp(folder.path(), 40) else { return };
        let mut clip = Clip::with(&file, 8).unwrap();

        let (numbers, most) = played(&mut clip, 90);
        let expected: Vec<i32> = (1..=90).map(|step| step % 40).collect();
        assert_eq!(numbers, expected);
        assert!(most <= 8, "{most} pictures were kept");
    }

    #[test]
    fn a_video_that_fits_is_never_cut() {
        let folder = tempfile::tempdir().unwrap();
        let Some(file) = ramp(folder.path(), 5) else { return };
        let mut clip = Clip::with(&file, 8).unwrap();
        let (numbers, _) = played(&mut clip, 9);
        assert_eq!(numbers, [1, 2, 3, 4, 3, 2, 1, 0, 1]);
    }

    /// Lets ffmpeg write a video. `None` if there is no ffmpeg.
    fn written(file: &Path, source: &str, more: &[&str]) -> Option<PathBuf> {
        let mut ffmpeg = Command::new("ffmpeg");
        ffmpeg.args(["-v", "error", "-f", "lavfi", "-i", source]).args(more).arg(file);
        ffmpeg.status().is_ok_and(|status| status.success()).then(|| file.to_owned())
    }

    #[test]
    fn wide_and_narrow_pixels_are_made_square() {
        let folder = tempfile::tempdir().unwrap();
        for (ratio, width) in [("2/1", 180), ("8/9", 80), ("1/1", 90)] {
            let file = folder.path().join("pixels.mkv");
            let filter = format!("setsar={ratio}");
            let more = ["-vf", &filter, "-frames:v", "2", "-c:v", "ffv1", "-y"];
            let Some(file) = written(&file, "color=gray:s=90x144:r=25", &more) else { return };
            let picture = Video::open(&file, FPS, WIDTH, HEIGHT).unwrap().next().unwrap();
            assert_eq!((picture.width, picture.height), (width, 144), "{ratio}");
        }
    }

    #[test]
    fn of_a_video_that_is_cut_off_the_missing_seconds_are_known() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["video.mp4", "video.mkv", "video.avi"] {
            let more = ["-t", "4", "-c:v", "mpeg4", "-g", "5", "-movflags", "+faststart"];
            let Some(file) = written(&folder.path().join(name), "testsrc=s=160x120:r=25", &more) else { return };
            assert_eq!(cut_off(&file), None, "{name} is whole");

            let bytes = std::fs::read(&file).unwrap();
            std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
            let cut = cut_off(&file).unwrap();
            assert!((cut.announced - 4.0).abs() < 0.1 && (1.0..3.0).contains(&cut.read), "{name}: {cut:?}");
        }
    }
}
