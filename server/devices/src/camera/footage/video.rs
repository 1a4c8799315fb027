//! Videos, decoded by the `ffmpeg` program.

use std::ffi::OsString;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use super::pnm::next_pnm;
use parfocal_imaging::RgbImage;

/// Largest width of a picture in pixels: the blur can keep up with it in real time.
pub(super) const WIDTH: usize = 1024;
/// Largest height in pixels, for the same reason.
pub(super) const HEIGHT: usize = 384;
/// Least width and height in pixels, to hold a patch and a window that moves.
const LEAST: usize = 64;

/// Why footage cannot be used. The message names the file, and says what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct FootageError(pub(super) String);

impl FootageError {
    /// The file or folder `path` cannot be read, for `reason`.
    pub fn unreadable(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self(format!("cannot read {}: {reason}", path.display()))
    }

    /// The decoder cannot be started.
    pub fn no_decoder(error: &std::io::Error) -> Self {
        Self(format!(
            "cannot start `ffmpeg`, which decodes videos ({error}); install it, on Debian with `apt install ffmpeg`"
        ))
    }
}

/// Refuses pictures of fewer than [`LEAST`] pixels either way.
pub(super) fn large_enough(path: &Path, width: usize, height: usize) -> Result<(), FootageError> {
    if width >= LEAST && height >= LEAST {
        return Ok(());
    }
    let path = path.display();
    Err(FootageError(format!("{path} is {width}x{height} pixels, but at least {LEAST}x{LEAST} are needed")))
}

/// Filter of ffmpeg that makes pixels square, as players do: wide pixels become several, narrow ones fewer.
pub const SQUARE_PIXELS: &str = "scale='max(1,round(iw*sar))':ih,setsar=1";

/// The pictures of a video in order of time, as an iterator; a damaged video may end where the damage begins.
#[derive(Debug)]
pub struct Video {
    decoder: Child,
    pictures: BufReader<ChildStdout>,
    /// What ffmpeg says is wrong.
    errors: File,
}

impl Video {
    /// Starts decoding `path` at `fps` pictures a second, each scaled down to at most `width` x `height` pixels, with
    /// its aspect ratio kept.
    ///
    /// # Errors
    /// If the file or the decoder is missing, or the file holds no video.
    pub fn open(path: &Path, fps: u32, width: usize, height: usize) -> Result<Self, FootageError> {
        check(path)?;
        let scale = format!(
            "fps={fps},{SQUARE_PIXELS},\
             scale='min({width},iw)':'min({height},ih)':force_original_aspect_ratio=decrease:flags=area"
        );
        // A pipe that nobody reads would fill up and stop the decoder.
        let failed = |error: std::io::Error| FootageError::unreadable(path, format!("no temporary file: {error}"));
        let errors = tempfile::tempfile().map_err(failed)?;

        let mut decoder = ffmpeg(path)
            .args(["-an", "-vf", &scale, "-f", "image2pipe", "-c:v", "ppm", "-"])
            .stdout(Stdio::piped())
            .stderr(errors.try_clone().map_err(failed)?)
            .spawn()
            .map_err(|error| FootageError::no_decoder(&error))?;

        let Some(pictures) = decoder.stdout.take() else {
            return Err(FootageError::unreadable(path, "ffmpeg gives no output"));
        };

        Ok(Self { decoder, pictures: BufReader::with_capacity(1 << 20, pictures), errors })
    }

    /// What ffmpeg said last, if anything was wrong. To be asked when no more pictures come.
    pub fn damage(&mut self) -> Option<String> {
        // It has ended, unless it wrote what is not a picture.
        let _ = self.decoder.kill();
        let _ = self.decoder.wait();

        let mut text = Vec::new();
        self.errors.rewind().ok()?;
        (&self.errors).take(1 << 20).read_to_end(&mut text).ok()?;
        String::from_utf8_lossy(&text).lines().last().map(str::to_owned)
    }
}

impl Iterator for Video {
    type Item = RgbImage;

    fn next(&mut self) -> Option<RgbImage> {
        let picture = next_pnm(&mut self.pictures).ok().flatten()?.into_rgb8();
        let (width, height) = picture.dimensions();
        RgbImage::new(width as usize, height as usize, picture.into_raw()).ok()
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        // These fail only if the decoder has already ended by itself.
        let _ = self.decoder.kill();
        let _ = self.decoder.wait();
    }
}

/// Decodes one picture and drops it, to learn whether the decoder can read the file.
fn check(path: &Path) -> Result<(), FootageError> {
    std::fs::File::open(path).map_err(|error| FootageError::unreadable(path, error))?;
    let tried = ffmpeg(path).args(["-an", "-frames:v", "1", "-f", "null", "-"]).output();
    let tried = tried.map_err(|error| FootageError::no_decoder(&error))?;
    if tried.status.success() {
        return Ok(());
    }

    let complaint = String::from_utf8_lossy(&tried.stderr);
    let last = complaint.lines().last().unwrap_or("no reason given");
    Err(FootageError::unreadable(path, format!("ffmpeg finds no video in it ({last})")))
}

/// The decoder with the file at `path` as its input; the caller adds what to do with it.
pub fn ffmpeg(path: &Path) -> Command {
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-nostdin", "-i"]).arg(input(path)).stdin(Stdio::null());
    command
}

/// The file at `path` as ffmpeg's programs take it: they would treat anything before a colon in a bare name as a
/// protocol.
pub(super) fn input(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}
