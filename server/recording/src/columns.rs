//! The values beside each frame: one array per value, in files of [`COLUMN_CHUNK`] frames.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use zarrs::array::data_type::{float64, int64, uint64};
use zarrs::array::{Element, ElementOwned, FillValue};

use super::codec::{Coder, plain_codecs};
use super::error::RecordingError;
use super::layout::{COLUMN_CHUNK, Column};

/// What is known about a frame besides its mosaic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameRow {
    /// End of the exposure, nanoseconds since the recording's start.
    pub time: i64,
    /// The camera's number of the frame.
    pub number: u64,
    /// Length of the exposure, milliseconds.
    pub exposure: f64,
    /// Focal power asked of the lens after the frame.
    pub asked: f64,
    /// Focal power at the middle of the exposure; NaN while unknown.
    pub measured: f64,
    /// Best focal power; NaN unless a simulation knows it.
    pub optimal: f64,
    /// The patch.
    pub patch: PatchRow,
}

/// The patch of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PatchRow {
    /// Its left column and top row, in mosaic cells.
    pub corner: (u64, u64),
    /// How often the policy had been made to forget what it saw, because the patch had jumped or the focus had been
    /// held. What was seen before a change is not comparable with what was seen after it.
    pub jumps: u64,
}

/// Encodes and decodes the files of the columns.
pub struct Columns {
    time: Coder,
    number: Coder,
    other: Coder,
}

impl Columns {
    /// A coder for files of [`COLUMN_CHUNK`] values.
    ///
    /// # Errors
    /// If the codecs do not work.
    pub fn new() -> Result<Self, RecordingError> {
        let shape = [COLUMN_CHUNK];
        Ok(Self {
            time: Coder::new(int64(), FillValue::from(0_i64), &shape, plain_codecs())?,
            number: Coder::new(uint64(), FillValue::from(0_u64), &shape, plain_codecs())?,
            other: Coder::new(float64(), FillValue::from(f64::NAN), &shape, plain_codecs())?,
        })
    }

    /// The file of `column` with the values of `rows`. At most [`COLUMN_CHUNK`] rows fit; more are left out.
    ///
    /// # Errors
    /// If the codec fails.
    pub fn encode(&self, column: Column, rows: &[FrameRow]) -> Result<Vec<u8>, RecordingError> {
        match column {
            Column::Time => padded(&self.time, rows.iter().map(|row| row.time), 0),
            Column::Number => padded(&self.number, rows.iter().map(|row| row.number), 0),
            Column::Exposure => padded(&self.other, rows.iter().map(|row| row.exposure), f64::NAN),
            Column::Asked => padded(&self.other, rows.iter().map(|row| row.asked), f64::NAN),
            Column::Measured => padded(&self.other, rows.iter().map(|row| row.measured), f64::NAN),
            Column::Optimal => padded(&self.other, rows.iter().map(|row| row.optimal), f64::NAN),
            Column::PatchX => self.of_patch(rows, |patch| patch.corner.0),
            Column::PatchY => self.of_patch(rows, |patch| patch.corner.1),
            Column::PatchJumps => self.of_patch(rows, |patch| patch.jumps),
        }
    }

    fn of_patch(&self, rows: &[FrameRow], value: fn(PatchRow) -> u64) -> Result<Vec<u8>, RecordingError> {
        padded(&self.number, rows.iter().map(|row| value(row.patch)), 0)
    }

    /// The rows of the first `frames` frames in `folder`.
    ///
    /// # Errors
    /// If a file cannot be read, or is missing or damaged.
    pub fn read(&self, folder: &Path, frames: usize) -> Result<Vec<FrameRow>, RecordingError> {
        let time: Vec<i64> = column(&self.time, folder, Column::Time, frames)?;
        let number: Vec<u64> = column(&self.number, folder, Column::Number, frames)?;
        let values = |which| column::<f64>(&self.other, folder, which, frames);
        let places = |which| column::<u64>(&self.number, folder, which, frames);

        let exposure = values(Column::Exposure)?;
        let asked = values(Column::Asked)?;
        let measured = values(Column::Measured)?;
        let optimal = values(Column::Optimal)?;
        let x = places(Column::PatchX)?;
        let y = places(Column::PatchY)?;
        let jumps = places(Column::PatchJumps)?;

        let row = |frame: usize| FrameRow {
            time: time[frame],
            number: number[frame],
            exposure: exposure[frame],
            asked: asked[frame],
            measured: measured[frame],
            optimal: optimal[frame],
            patch: PatchRow { corner: (x[frame], y[frame]), jumps: jumps[frame] },
        };
        Ok((0..frames).map(row).collect())
    }
}

fn padded<T: Element>(coder: &Coder, values: impl Iterator<Item = T>, fill: T) -> Result<Vec<u8>, RecordingError> {
    let mut values: Vec<T> = values.collect();
    values.resize(COLUMN_CHUNK, fill);
    coder.encode(&values)
}

/// The first `frames` values of a column.
fn column<T: ElementOwned>(
    coder: &Coder,
    folder: &Path,
    column: Column,
    frames: usize,
) -> Result<Vec<T>, RecordingError> {
    let mut values = Vec::new();

    for file in 0..frames.div_ceil(COLUMN_CHUNK) {
        let path = folder.join(column.name()).join(format!("c/{file}"));
        let damaged = || {
            let name = column.name();
            let damage = format!("the values of `{name}` are missing or do not match their checksum");
            RecordingError::damaged(&path, damage)
        };
        let stored = fs::read(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => damaged(),
            _ => RecordingError::unreadable(&path)(error),
        })?;
        values.extend(coder.decode::<T>(stored).map_err(|_| damaged())?);
    }

    values.truncate(frames);
    Ok(values)
}
