//! Reads a recording of the view, whether it was ended or cut short.

use std::fs::{self, File};
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::error::RecordingError;
use super::header::Ended;
use super::view::{HEADER, INDEX, PICTURES, VIEW_FORMAT, VIEW_VERSION, ViewHeader};

/// The first and the last two bytes of a JPEG picture.
const JPEG_BEGINS: [u8; 2] = [0xFF, 0xD8];
const JPEG_ENDS: [u8; 2] = [0xFF, 0xD9];

/// A picture of the view, and its place in the file of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub struct ViewRow {
    /// The camera's number of the frame.
    #[serde(rename = "frame_number")]
    pub number: u64,
    /// End of the exposure, nanoseconds since the recording's start.
    #[serde(rename = "time_ns")]
    pub time: u64,
    /// Offset of its first byte in that file.
    pub offset: u64,
    /// Its length in bytes.
    pub length: u64,
    /// Its width in pixels.
    pub width: u32,
    /// Its height in pixels.
    pub height: u32,
}

/// A recording of the view: its description and the places of its pictures, which stay on disk.
pub struct ViewRecording {
    folder: PathBuf,
    header: ViewHeader,
    rows: Vec<ViewRow>,
}

impl ViewRecording {
    /// Opens the recording in `folder`.
    ///
    /// # Errors
    /// If there is none, it has another version, or its description or index is invalid.
    pub fn open(folder: &Path) -> Result<Self, RecordingError> {
        let path = folder.join(HEADER);
        let text = fs::read(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => RecordingError::NoRecording(folder.to_owned()),
            _ => RecordingError::unreadable(&path)(error),
        })?;

        let header: ViewHeader = serde_json::from_slice(&text).map_err(|e| RecordingError::nonsense(&path, e))?;
        if header.format != VIEW_FORMAT {
            return Err(RecordingError::NoRecording(folder.to_owned()));
        }
        if header.version != VIEW_VERSION {
            return Err(RecordingError::other_version(folder, header.version));
        }

        let rows = read_index(folder)?;
        Ok(Self { folder: folder.to_owned(), header, rows })
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How it was made.
    pub const fn header(&self) -> &ViewHeader {
        &self.header
    }

    /// Its pictures, in order.
    pub fn rows(&self) -> &[ViewRow] {
        &self.rows
    }

    /// Bytes of its pictures, by the index. The sum saturates, because a damaged row before the last may give any
    /// length.
    pub fn bytes(&self) -> u64 {
        self.rows.iter().fold(0, |sum, row| sum.saturating_add(row.length))
    }

    /// Picture `number`, from 0, as JPEG.
    ///
    /// # Errors
    /// If there is no such picture, or its file cannot be read or is damaged.
    pub fn picture(&self, number: usize) -> Result<Vec<u8>, RecordingError> {
        let Some(row) = self.rows.get(number) else {
            let frames = self.rows.len();
            return Err(RecordingError::NoFrame { path: self.folder.clone(), frames, asked: number });
        };

        let path = self.folder.join(PICTURES);
        let mut file = File::open(&path).map_err(RecordingError::unreadable(&path))?;
        file.seek(SeekFrom::Start(row.offset)).map_err(RecordingError::unreadable(&path))?;

        let mut jpeg = Vec::new();
        file.take(row.length).read_to_end(&mut jpeg).map_err(RecordingError::unreadable(&path))?;

        let whole = jpeg.len() as u64 == row.length && jpeg.starts_with(&JPEG_BEGINS) && jpeg.ends_with(&JPEG_ENDS);
        if whole {
            return Ok(jpeg);
        }
        let damage = format!("picture {number} is cut off, or is not a JPEG picture");
        Err(RecordingError::damaged(&path, damage))
    }

    /// Reads every picture, and returns what is wrong with those that are not whole, and which file is cut off.
    pub fn check(&self) -> Vec<String> {
        let pictures = (0..self.rows.len()).filter_map(|number| self.picture(number).err());
        pictures.map(|error| error.to_string()).chain(self.cut_off()).collect()
    }

    /// Which file lacks its end. Of a recording that was stopped as it should, everything had reached the disk: then
    /// index and pictures agree, unless a copy was cut short.
    fn cut_off(&self) -> Option<String> {
        if !matches!(self.header.ended, Some(Ended::Stopped | Ended::DiskNearlyFull)) {
            return None;
        }
        let index = self.folder.join(INDEX);
        let pictures = self.folder.join(PICTURES);
        let (text, bytes) = match (fs::read_to_string(&index), fs::metadata(&pictures)) {
            (Ok(text), Ok(about)) => (text, about.len()),
            // Opening it has told that.
            _ => return None,
        };

        let listed = text.matches('\n').count().saturating_sub(1);
        let end = self.rows.last().map_or(0, |row| row.offset.saturating_add(row.length));
        let (file, lacks) = if listed > self.rows.len() {
            (pictures, format!("{} of {listed} pictures", listed - self.rows.len()))
        } else if !text.ends_with('\n') || bytes > end {
            (index, "the places of the last pictures".to_owned())
        } else {
            return None;
        };
        Some(format!("{} is cut off: it lacks {lacks}; restore it from a copy", file.display()))
    }
}

/// The index's rows up to the last one that is whole and whose picture is there. A crash or a power cut may leave a
/// half-written line, or lines whose pictures never reached the disk.
fn read_index(folder: &Path) -> Result<Vec<ViewRow>, RecordingError> {
    let path = folder.join(INDEX);
    let text = fs::read_to_string(&path).map_err(RecordingError::unreadable(&path))?;
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);

    let mut rows: Vec<ViewRow> = csv::Reader::from_reader(whole.as_bytes())
        .deserialize()
        .collect::<Result<_, csv::Error>>()
        .map_err(|error| RecordingError::nonsense(&path, error))?;

    let pictures = folder.join(PICTURES);
    let bytes = fs::metadata(&pictures).map_err(RecordingError::unreadable(&pictures))?.len();
    let there = |row: &ViewRow| row.offset.checked_add(row.length).is_some_and(|end| end <= bytes);
    let kept = rows.iter().rposition(there).map_or(0, |last| last + 1);
    rows.truncate(kept);
    Ok(rows)
}
