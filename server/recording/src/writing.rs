//! Writes a recording. Each shard is written under another name and then renamed. Only after that do the arrays become
//! longer. So however the program ends, what was stored before can be opened.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::columns::{COLUMN_CHUNK, COLUMNS, Coders, FrameRow};
use super::error::RecordingError;
use super::header::{Ended, Header};
use super::layout::{BandArray, DESCRIPTION, MOSAIC, band_arrays, group, growing};
use super::shard::{Index, SHARD_FRAMES};
use parfocal_base::files::{remove, replace, replace_with};
use parfocal_imaging::Calibration;

/// A recording under way.
pub struct Writer {
    folder: PathBuf,
    header: Header,
    size: (usize, usize),
    /// Descriptions of the arrays that do not grow.
    fixed: Vec<(String, Value)>,
    index: Index,
    coders: Coders,
    /// Rows of each column's last file, which is not full yet. Includes the rows of frames that wait for their shard.
    rows: Vec<FrameRow>,
    /// Compressed frames that wait for their shard to be full.
    waiting: Vec<Vec<u8>>,
    /// Frames in whole shards.
    sharded: usize,
    /// Of those, the frames that the recording's description counts: what a reader finds.
    stored: usize,
}

impl Writer {
    /// Begins a recording of mosaics of `size` (width and height in samples) in `folder`, which must not exist.
    ///
    /// # Errors
    /// If the folder exists or cannot be written. No folder of its own is left then.
    pub fn create(
        folder: &Path,
        header: Header,
        size: (usize, usize),
        calibration: &Calibration,
    ) -> Result<Self, RecordingError> {
        in_new_folder(folder, || Self::begin(folder, header, size, calibration))
    }

    fn begin(
        folder: &Path,
        header: Header,
        size: (usize, usize),
        calibration: &Calibration,
    ) -> Result<Self, RecordingError> {
        let mut fixed = Vec::new();
        for BandArray { name, description, stored } in band_arrays(calibration)? {
            put(&folder.join(name).join("c/0"), 0, &stored)?;
            put(&folder.join(name).join(DESCRIPTION), 0, &pretty(&description))?;
            fixed.push((name.to_owned(), description));
        }

        let mut writer = Self {
            folder: folder.to_owned(),
            header,
            size,
            fixed,
            index: Index::new()?,
            coders: Coders::new()?,
            rows: Vec::new(),
            waiting: Vec::new(),
            sharded: 0,
            stored: 0,
        };
        writer.describe()?;
        Ok(writer)
    }

    /// The recording's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Width and height of its mosaics in samples.
    pub const fn size(&self) -> (usize, usize) {
        self.size
    }

    /// How the recording is made.
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// Number of frames that a reader would find if the program were killed now.
    pub const fn stored(&self) -> usize {
        self.stored
    }

    /// Bytes of the frames that wait for their shard.
    pub fn waiting_bytes(&self) -> u64 {
        self.waiting.iter().map(|frame| frame.len() as u64).sum()
    }

    /// Sets how many frames were lost so far; stored with the next shard.
    pub const fn set_lost(&mut self, frames: u64) {
        self.header.frames_lost = frames;
    }

    /// Adds a frame, compressed by [`super::codec::Coder::of_frames`] of this size. Every [`SHARD_FRAMES`] frames
    /// become a file.
    ///
    /// # Errors
    /// If it cannot be written. Then the frames of this shard are lost, and those before it are kept.
    pub fn add(&mut self, row: FrameRow, compressed: Vec<u8>) -> Result<(), RecordingError> {
        self.rows.push(row);
        self.waiting.push(compressed);
        if self.waiting.len() == SHARD_FRAMES { self.store() } else { Ok(()) }
    }

    /// Stores the frames that still wait, and notes how the recording ended. No frame can be added after that.
    ///
    /// # Errors
    /// If it cannot be written. [`Writer::stored`] is then the number of frames that a reader finds.
    pub fn finish(&mut self, ended: Ended) -> Result<(), RecordingError> {
        self.header.ended = Some(ended);
        if !self.waiting.is_empty() {
            return self.store();
        }
        self.check_in_place()?;
        self.describe()
    }

    /// Checks that the folder still is where it was made. To make it anew would give a recording without its first
    /// frames, which counts them as saved.
    fn check_in_place(&mut self) -> Result<(), RecordingError> {
        match self.folder.join(DESCRIPTION).try_exists() {
            Ok(true) => Ok(()),
            Ok(false) => {
                self.stored = 0;
                Err(RecordingError::moved(&self.folder))
            }
            Err(error) => Err(RecordingError::unwritable(&self.folder, self.stored, &error)),
        }
    }

    /// Writes the waiting frames as a shard, then makes the arrays longer by them.
    fn store(&mut self) -> Result<(), RecordingError> {
        let frames = std::mem::take(&mut self.waiting);
        let lengths: Vec<usize> = frames.iter().map(Vec::len).collect();
        let in_place = self.check_in_place();
        let encoded = in_place.and_then(|()| self.index.encode(&lengths));
        let stored = encoded.and_then(|index| self.store_shard(&frames, &index));

        if let Err(error) = stored {
            // The rows of the lost frames must not become those of later ones.
            self.rows.truncate(self.rows.len() - frames.len());
            return Err(error);
        }

        for column in &COLUMNS {
            let file = self.folder.join(column.name).join("c").join((self.sharded / COLUMN_CHUNK).to_string());
            put(&file, self.sharded, &self.coders.encode(column, &self.rows)?)?;
        }

        self.sharded += frames.len();
        if self.rows.len() == COLUMN_CHUNK {
            self.rows.clear();
        }
        self.describe()
    }

    fn store_shard(&self, frames: &[Vec<u8>], index: &[u8]) -> Result<(), RecordingError> {
        let path = self.folder.join(MOSAIC).join(format!("c/{}/0/0", self.sharded / SHARD_FRAMES));
        let failed = |error: io::Error| RecordingError::unwritable(&self.folder, self.sharded, &error);
        make_parent(&path).map_err(failed)?;
        let write = |out: &mut BufWriter<File>| {
            frames.iter().try_for_each(|frame| out.write_all(frame))?;
            out.write_all(index)
        };
        replace_with(&path, write).map_err(failed)
    }

    /// Describes what is stored now: first all arrays in the group's file, then each array for readers that do not look
    /// there.
    fn describe(&mut self) -> Result<(), RecordingError> {
        let growing = growing(&self.header, self.size, self.sharded);
        let mut arrays = growing.clone();
        arrays.extend(self.fixed.iter().cloned());

        let whole = group(&self.header, &arrays)?;
        put(&self.folder.join(DESCRIPTION), self.sharded, &pretty(&whole))?;
        self.stored = self.sharded;

        for (name, description) in &growing {
            put(&self.folder.join(name).join(DESCRIPTION), self.sharded, &pretty(description))?;
        }
        Ok(())
    }
}

/// Makes the folder of a recording, which must be new, and begins the recording in it by `begin`. If that fails, the
/// folder is removed, because it would be in the way of the next attempt.
///
/// # Errors
/// If the folder exists or cannot be made, or `begin` fails.
pub fn in_new_folder<T>(folder: &Path, begin: impl FnOnce() -> Result<T, RecordingError>) -> Result<T, RecordingError> {
    make_folder(folder)?;
    begin().inspect_err(|_| remove(folder))
}

fn make_folder(folder: &Path) -> Result<(), RecordingError> {
    let failed = |error: io::Error| RecordingError::unwritable(folder, 0, &error);
    make_parent(folder).map_err(failed)?;
    fs::create_dir(folder).map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => RecordingError::Exists(folder.to_owned()),
        _ => failed(error),
    })
}

fn make_parent(path: &Path) -> io::Result<()> {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).map_or(Ok(()), fs::create_dir_all)
}

fn put(path: &Path, kept: usize, bytes: &[u8]) -> Result<(), RecordingError> {
    let written = make_parent(path).and_then(|()| replace(path, bytes));
    written.map_err(|error| RecordingError::unwritable(path, kept, &error))
}

fn pretty(description: &Value) -> Vec<u8> {
    let mut text = format!("{description:#}");
    text.push('\n');
    text.into_bytes()
}
