//! A recording of the view: the JPEG pictures as the surgeon's page got them. Two files that any tool reads: the
//! pictures one after another, and a table of their places. `docs/recordings.md` describes them.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::error::RecordingError;
use super::header::Ended;
use super::writing::in_new_folder;
use parfocal_base::files::replace;

/// Value of [`ViewHeader::format`].
pub const VIEW_FORMAT: &str = "parfocal-view";
/// The pictures, one after another: what `ffmpeg -f mjpeg` reads.
pub const PICTURES: &str = "view.mjpeg";
/// The index: a line for each picture.
pub const INDEX: &str = "view.csv";
/// The description: how the recording was made.
pub const HEADER: &str = "view.json";
/// First line of the index. Width and height were added later. They are at the end, so that programs that count columns
/// can still read the file.
const COLUMNS: &str = "frame_number,time_ns,offset,length,width,height\n";
/// Value of [`ViewHeader::version`].
pub const VIEW_VERSION: u64 = 1;

/// How a recording of the view was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewHeader {
    /// Always [`VIEW_FORMAT`].
    pub format: String,
    /// Always [`VIEW_VERSION`].
    pub version: u64,
    /// The program that made it, and its version.
    pub software: String,
    /// Wall-clock time (UTC) from which `time_ns` counts.
    pub started: Timestamp,
    /// Name of the camera, for people.
    pub camera: String,
    /// The trial session that it was made in, if one was under way.
    pub session: Option<String>,
    /// Number of the server's start that recorded it, as in exports.
    pub run: Option<i64>,
    /// The monotonic clock at `started`, nanoseconds; comparable with the times of an export within a run.
    pub monotonic_ns: Option<i64>,
    /// How it ended; `None` while it is under way, or if it was cut short.
    pub ended: Option<Ended>,
}

/// A recording of the view under way. Nothing in it tells policies apart.
pub struct ViewWriter {
    folder: PathBuf,
    header: ViewHeader,
    pictures: File,
    index: File,
    bytes: u64,
    stored: usize,
}

impl ViewWriter {
    /// Begins a recording in `folder`, which must not exist.
    ///
    /// # Errors
    /// If the folder exists or cannot be written. No folder of its own is left then.
    pub fn create(folder: &Path, header: ViewHeader) -> Result<Self, RecordingError> {
        in_new_folder(folder, || Self::begin(folder, header))
    }

    fn begin(folder: &Path, header: ViewHeader) -> Result<Self, RecordingError> {
        let failed = |error: io::Error| RecordingError::unwritable(folder, 0, &error);
        let pictures = File::create_new(folder.join(PICTURES)).map_err(failed)?;
        let mut index = File::create_new(folder.join(INDEX)).map_err(failed)?;
        index.write_all(COLUMNS.as_bytes()).map_err(failed)?;

        let writer = Self { folder: folder.to_owned(), header, pictures, index, bytes: 0, stored: 0 };
        writer.describe()?;
        Ok(writer)
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Adds a picture of frame `number`, `size` (width and height) pixels large, whose exposure ended `time`
    /// nanoseconds after the start.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(
        &mut self,
        number: u64,
        time: u64,
        (width, height): (usize, usize),
        jpeg: &[u8],
    ) -> Result<(), RecordingError> {
        // The picture is written first, so that every line of the index has its picture.
        let line = format!("{number},{time},{},{},{width},{height}\n", self.bytes, jpeg.len());
        let written = self.pictures.write_all(jpeg).and_then(|()| self.index.write_all(line.as_bytes()));
        written.map_err(|error| RecordingError::unwritable(&self.folder, self.stored, &error))?;

        self.bytes += jpeg.len() as u64;
        self.stored += 1;
        Ok(())
    }

    /// Notes how the recording ended, and waits until everything is on disk.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self, ended: Ended) -> Result<(), RecordingError> {
        self.header.ended = Some(ended);
        let synced = self.pictures.sync_data().and_then(|()| self.index.sync_data());
        synced.map_err(|error| RecordingError::unwritable(&self.folder, self.stored, &error))?;
        self.describe()
    }

    fn describe(&self) -> Result<(), RecordingError> {
        let mut text = serde_json::to_vec_pretty(&self.header).map_err(RecordingError::codec)?;
        text.push(b'\n');
        let written = replace(&self.folder.join(HEADER), &text);
        written.map_err(|error| RecordingError::unwritable(&self.folder, self.stored, &error))
    }
}
