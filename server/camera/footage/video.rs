//! Videos, decoded by the `ffmpeg` program.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

use crate::imaging::RgbImage;

/// Bytes beyond which a picture is implausible, and the stream damaged.
const MOST_BYTES: usize = 1 << 28;

/// Why footage cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FootageError {
    /// The file or folder does not exist, or may not be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The decoder is missing.
    #[error("cannot start `ffmpeg`, which decodes videos ({0}); install it, on Debian with `apt install ffmpeg`")]
    NoDecoder(std::io::Error),
    /// A folder without pictures.
    #[error("there is no picture (PNG, JPEG or TIFF) in {}", .0.display())]
    Empty(PathBuf),
    /// Pictures too small to hold a patch and to move about in.
    #[error("{} is {width}x{height} pixels, but at least {least}x{least} are needed", path.display())]
    TooSmall {
        /// The file.
        path: PathBuf,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Least width and height.
        least: usize,
    },
}

impl FootageError {
    pub(crate) fn unreadable(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self::Unreadable { path: path.to_owned(), reason: reason.to_string() }
    }
}

/// The pictures of a video in order of time, as an iterator; a damaged video ends where the damage begins.
#[derive(Debug)]
pub struct Video {
    decoder: Child,
    pictures: BufReader<ChildStdout>,
}

impl Video {
    /// Starts decoding `path` at `fps` pictures a second, each scaled down to at most `width` x `height`
    /// pixels, its aspect kept.
    ///
    /// # Errors
    /// When the file or the decoder is missing, or the file holds no video.
    pub fn open(path: &Path, fps: u32, width: usize, height: usize) -> Result<Self, FootageError> {
        check(path)?;
        let scale = format!(
            "fps={fps},scale='min({width},iw)':'min({height},ih)':force_original_aspect_ratio=decrease:flags=area"
        );

        let mut decoder = ffmpeg(path)
            .args(["-an", "-vf", &scale, "-f", "image2pipe", "-c:v", "ppm", "-"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(FootageError::NoDecoder)?;

        let Some(pictures) = decoder.stdout.take() else {
            return Err(FootageError::unreadable(path, "ffmpeg gives no output"));
        };

        Ok(Self { decoder, pictures: BufReader::with_capacity(1 << 20, pictures) })
    }
}

impl Iterator for Video {
    type Item = RgbImage;

    fn next(&mut self) -> Option<RgbImage> {
        ppm(&mut self.pictures).ok().flatten()
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        // Either fails only if the decoder has already ended by itself.
        let _ = self.decoder.kill();
        let _ = self.decoder.wait();
    }
}

/// Decodes one picture and drops it, to learn whether the decoder can read the file.
fn check(path: &Path) -> Result<(), FootageError> {
    std::fs::File::open(path).map_err(|error| FootageError::unreadable(path, error))?;
    let tried = ffmpeg(path).args(["-an", "-frames:v", "1", "-f", "null", "-"]).output();
    let tried = tried.map_err(FootageError::NoDecoder)?;
    if tried.status.success() {
        return Ok(());
    }

    let told = String::from_utf8_lossy(&tried.stderr);
    let last = told.lines().last().unwrap_or("no reason given");
    Err(FootageError::unreadable(path, format!("ffmpeg finds no video in it ({last})")))
}

/// The decoder with the file at `path` as its input; the caller adds what to do with it.
#[must_use]
pub fn ffmpeg(path: &Path) -> Command {
    // The decoder would take anything before a colon in a bare name for a protocol.
    let mut name = OsString::from("file:");
    name.push(path);

    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-nostdin", "-i"]).arg(name).stdin(Stdio::null());
    command
}

/// Reads a binary PPM picture: `P6`, width, height and 255 between white space, then three bytes a pixel.
/// `None` at the stream's end.
fn ppm(stream: &mut impl BufRead) -> std::io::Result<Option<RgbImage>> {
    let damaged = || std::io::Error::from(std::io::ErrorKind::InvalidData);
    let mut magic = Vec::new();
    if stream.take(3).read_to_end(&mut magic)? == 0 {
        return Ok(None);
    }

    let mut numbers = [0_usize; 3];
    for number in &mut numbers {
        *number = decimal(stream)?;
    }
    let [width, height, depth] = numbers;

    let bytes = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3)).filter(|size| *size <= MOST_BYTES);
    let bytes = bytes.filter(|_| magic == b"P6\n" && depth == 255).ok_or_else(damaged)?;

    let mut data = vec![0; bytes];
    stream.read_exact(&mut data)?;

    RgbImage::new(width, height, data).map(Some).map_err(|_| damaged())
}

/// A decimal number and the one white space after it.
fn decimal(stream: &mut impl BufRead) -> std::io::Result<usize> {
    let mut number = 0_usize;
    loop {
        let mut byte = [0];
        stream.read_exact(&mut byte)?;
        match byte[0] {
            digit @ b'0'..=b'9' => number = number.saturating_mul(10).saturating_add(usize::from(digit - b'0')),
            space if space.is_ascii_whitespace() => return Ok(number),
            _ => return Err(std::io::ErrorKind::InvalidData.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_read_one_after_another() {
        let mut stream: &[u8] = b"P6\n2 1\n255\n\x01\x02\x03\x04\x05\x06P6\n1 1\n255\n\x07\x08\x09";
        assert_eq!(ppm(&mut stream).unwrap().unwrap(), RgbImage::new(2, 1, vec![1, 2, 3, 4, 5, 6]).unwrap());
        assert_eq!(ppm(&mut stream).unwrap().unwrap(), RgbImage::new(1, 1, vec![7, 8, 9]).unwrap());
        assert!(ppm(&mut stream).unwrap().is_none());
    }

    #[test]
    fn damaged_streams_are_errors() {
        for mut stream in
            [&b"P6\n2 1\n255\n\x01\x02"[..], b"P5\n1 1\n255\n\x01", b"P6\n9999999 9999999\n255\n", b"P6\nx"]
        {
            assert!(ppm(&mut stream).is_err());
        }
    }
}
