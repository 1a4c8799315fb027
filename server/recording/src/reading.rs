//! Reads a recording.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::Value;
use zarrs::array::FillValue;
use zarrs::array::data_type::{float64, int64};

use super::codec::{Coder, plain_codecs};
use super::columns::{Coders, FrameRow};
use super::error::RecordingError;
use super::header::{CALIBRATION, FORMAT, Header, VERSION};
use super::layout::{BAND_NUMBERS, BAND_PLACES, DESCRIPTION, MOSAIC};
use super::shard::{Index, SHARD_FRAMES};
use super::view;
use parfocal_imaging::{BANDS, CELL, MosaicFrame};

/// Longest side of a mosaic that a description may give, samples.
const LARGEST_SIDE: u64 = 1 << 14;
/// Most frames that a description may give: 46 days at 25 a second.
const MOST_FRAMES: u64 = 100_000_000;

/// A recording's description and the values beside its frames. The frames stay on disk.
pub struct Recording {
    folder: PathBuf,
    header: Header,
    size: (usize, usize),
    rows: Vec<FrameRow>,
    coder: Coder,
    index: Index,
}

impl Recording {
    /// Opens the recording in `folder`, whether it was ended or cut short.
    ///
    /// # Errors
    /// If there is none, it has another version, or its description is invalid or damaged.
    pub fn open(folder: &Path) -> Result<Self, RecordingError> {
        let path = folder.join(DESCRIPTION);
        let text = fs::read(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound if folder.join(view::HEADER).exists() => RecordingError::View(folder.to_owned()),
            ErrorKind::NotFound | ErrorKind::NotADirectory => RecordingError::NoRecording(folder.to_owned()),
            _ => RecordingError::unreadable(&path)(error),
        })?;

        let described: Value = serde_json::from_slice(&text).map_err(|e| RecordingError::nonsense(&path, e))?;
        let attributes = &described["attributes"];
        if attributes["format"] != FORMAT {
            return Err(RecordingError::NoRecording(folder.to_owned()));
        }
        match attributes["version"].as_u64() {
            Some(VERSION) => {}
            Some(found) => return Err(RecordingError::other_version(folder, found)),
            None => return Err(RecordingError::nonsense(&path, "it has no version")),
        }

        let header: Header =
            serde_json::from_value(attributes.clone()).map_err(|e| RecordingError::nonsense(&path, e))?;
        let (frames, size) = extent(&described).map_err(|reason| RecordingError::nonsense(&path, reason))?;

        let rows = Coders::new()?.read(folder, frames)?;
        let coder = Coder::of_frames(size.0, size.1)?;
        Ok(Self { folder: folder.to_owned(), header, size, rows, coder, index: Index::new()? })
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of its calibration.
    pub fn calibration(&self) -> PathBuf {
        self.folder.join(CALIBRATION)
    }

    /// How it was made.
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// Width and height of its mosaics in samples.
    pub const fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The values beside each frame: time, number, exposure, focal powers and patch.
    pub fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    /// Number of frames that are missing between the first and the last, by the camera's numbers.
    pub fn missing(&self) -> u64 {
        let numbered = match (self.rows.first(), self.rows.last()) {
            (Some(first), Some(last)) => last.number.saturating_sub(first.number).saturating_add(1),
            _ => 0,
        };
        numbered.saturating_sub(self.rows.len() as u64)
    }

    /// Frames per second from the first to the last; `None` if they take no time.
    pub fn rate(&self) -> Option<f64> {
        let seconds = self.seconds();
        (seconds > 0.0).then(|| (self.rows.len() - 1) as f64 / seconds)
    }

    /// Seconds from the first frame to the last; 0 if a recording from elsewhere has the last one before the first.
    pub fn seconds(&self) -> f64 {
        match (self.rows.first(), self.rows.last()) {
            (Some(first), Some(last)) => last.time.saturating_sub(first.time).max(0) as f64 / 1e9,
            _ => 0.0,
        }
    }

    /// Bytes of its frames on disk. Files that cannot be read count as 0.
    pub fn bytes(&self) -> u64 {
        let shards = 0..self.rows.len().div_ceil(SHARD_FRAMES);
        shards.filter_map(|shard| fs::metadata(self.shard(shard)).ok()).map(|file| file.len()).sum()
    }

    /// The mosaic of frame `number`, from 0.
    ///
    /// # Errors
    /// If there is no such frame, or its file cannot be read or is damaged.
    pub fn frame(&self, number: usize) -> Result<MosaicFrame, RecordingError> {
        if number >= self.rows.len() {
            let frames = self.rows.len();
            return Err(RecordingError::NoFrame { path: self.folder.clone(), frames, asked: number });
        }

        let shard = number / SHARD_FRAMES;
        let path = self.shard(shard);
        let damaged = |damage: String| RecordingError::damaged(&path, damage);
        let first = shard * SHARD_FRAMES;
        let last = (first + SHARD_FRAMES).min(self.rows.len()) - 1;

        let mut file = File::open(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => damaged(format!("the file is missing, so frames {first} to {last} are lost")),
            _ => RecordingError::unreadable(&path)(error),
        })?;
        let places = self.index.read(&mut file).map_err(RecordingError::unreadable(&path))?;
        let places = places.ok_or_else(|| {
            damaged(format!(
                "its index is cut off or does not match its checksum, so frames {first} to {last} cannot be found in it"
            ))
        })?;
        let place = places.get(number - first).copied().flatten();
        let (offset, length) = place.ok_or_else(|| damaged(format!("frame {number} is not in it")))?;

        let mut stored = vec![0; length as usize];
        file.seek(SeekFrom::Start(offset)).map_err(RecordingError::unreadable(&path))?;
        file.read_exact(&mut stored).map_err(RecordingError::unreadable(&path))?;

        let mosaic = self.coder.decode::<u16>(stored).ok();
        let mosaic = mosaic.and_then(|samples| MosaicFrame::new(self.size.0, self.size.1, samples).ok());
        mosaic.ok_or_else(|| damaged(format!("frame {number} does not match its checksum")))
    }

    /// Reads every frame and what describes the bands, and returns what is wrong with those that cannot be read. Damage
    /// of a whole file is reported once.
    pub fn check(&self) -> Vec<String> {
        let problem = |number| self.frame(number).err().map(|error: RecordingError| error.to_string());
        let mut problems: Vec<String> = (0..self.rows.len()).into_par_iter().filter_map(problem).collect();
        problems.dedup();

        let bands = self.check_bands().unwrap_or_else(|error| vec![error.to_string()]);
        problems.extend(bands);
        problems
    }

    /// What is wrong with the arrays that describe the bands. This program takes the bands from the calibration; others
    /// read the arrays.
    fn check_bands(&self) -> Result<Vec<String>, RecordingError> {
        let numbers = Coder::new(float64(), FillValue::from(f64::NAN), &[BANDS], plain_codecs())?;
        let places = Coder::new(int64(), FillValue::from(0_i64), &[BANDS], plain_codecs())?;

        let numbers = BAND_NUMBERS
            .map(|name| (name, fs::read(self.band_file(name)).map(|stored| numbers.decode::<f64>(stored).is_ok())));
        let places = BAND_PLACES
            .map(|name| (name, fs::read(self.band_file(name)).map(|stored| places.decode::<i64>(stored).is_ok())));
        let problem = |(name, is_whole): (&str, io::Result<bool>)| {
            let damage = match is_whole {
                Ok(true) => return None,
                Ok(false) => "do not match their checksum".to_owned(),
                Err(error) => format!("cannot be read: {error}"),
            };
            let path = self.band_file(name);
            Some(format!("{}: the values of `{name}` {damage}; restore it from a copy", path.display()))
        };
        Ok(numbers.into_iter().chain(places).filter_map(problem).collect())
    }

    /// The one file of the array `name`, which describes the bands.
    fn band_file(&self, name: &str) -> PathBuf {
        self.folder.join(name).join("c/0")
    }

    fn shard(&self, number: usize) -> PathBuf {
        self.folder.join(MOSAIC).join(format!("c/{number}/0/0"))
    }
}

/// Number, width and height of the mosaics in a group's description.
fn extent(described: &Value) -> Result<(usize, (usize, usize)), String> {
    let arrays = &described["consolidated_metadata"]["metadata"];
    let mosaic = &arrays[MOSAIC];
    let shape: Vec<u64> =
        serde_json::from_value(mosaic["shape"].clone()).map_err(|_| "it has no mosaics".to_owned())?;
    let &[frames, height, width] = shape.as_slice() else {
        return Err("its mosaics do not have three dimensions".into());
    };

    let side = |length: u64| (1..=LARGEST_SIDE).contains(&length) && length.is_multiple_of(CELL as u64);
    if !side(width) || !side(height) || frames > MOST_FRAMES {
        return Err(format!("it claims {frames} mosaics of {width}x{height} samples, which is not possible"));
    }

    let chunk = serde_json::json!([SHARD_FRAMES, height, width]);
    if mosaic["chunk_grid"]["configuration"]["chunk_shape"] != chunk {
        return Err(format!("its files do not hold {SHARD_FRAMES} frames each"));
    }
    Ok((frames as usize, (width as usize, height as usize)))
}
