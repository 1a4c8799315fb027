//! The values beside each frame: one array (a column) per value, in files of [`COLUMN_CHUNK`] frames.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use serde_json::{Value, json};
use zarrs::array::data_type::{float64, int64, uint64};
use zarrs::array::{Element, ElementOwned, FillValue};

use super::codec::{Coder, plain_codecs};
use super::error::RecordingError;
use super::header::Header;
use super::shard::SHARD_FRAMES;

/// Values in a file of a column: a multiple of [`SHARD_FRAMES`].
pub const COLUMN_CHUNK: usize = 160 * SHARD_FRAMES;

/// What is known about a frame besides its mosaic.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PatchRow {
    /// Its left column and top row, in mosaic cells.
    pub corner: (u64, u64),
    /// How often the policy had been made to forget what it saw, because the patch had jumped or the focus had been
    /// held. What was seen before a change is not comparable with what was seen after it.
    pub jumps: u64,
}

/// A value that is stored beside each frame.
pub struct Column {
    /// The array's name.
    pub name: &'static str,
    /// Where a row has it.
    pub field: Field,
    /// What the array's description says of it.
    pub attributes: fn(&Header) -> Value,
}

/// A field of a row.
#[derive(Clone, Copy)]
pub enum Field {
    /// A time.
    Time(fn(&mut FrameRow) -> &mut i64),
    /// A number of something.
    Count(fn(&mut FrameRow) -> &mut u64),
    /// Anything else.
    Number(fn(&mut FrameRow) -> &mut f64),
}

impl Field {
    /// The type of the array's elements.
    pub const fn data_type(self) -> &'static str {
        match self {
            Self::Time(_) => "int64",
            Self::Count(_) => "uint64",
            Self::Number(_) => "float64",
        }
    }
}

/// All columns.
pub const COLUMNS: [Column; 9] = [
    Column {
        name: "time",
        field: Field::Time(|row| &mut row.time),
        attributes: |header| {
            json!({
                "long_name": "end of the exposure",
                "units": format!("nanoseconds since {}", header.started.strftime("%Y-%m-%dT%H:%M:%S.%f")),
                "calendar": "proleptic_gregorian",
            })
        },
    },
    Column {
        name: "frame_number",
        field: Field::Count(|row| &mut row.number),
        attributes: |_| json!({"long_name": "the camera's number of the frame; a gap is a missing frame"}),
    },
    Column {
        name: "exposure",
        field: Field::Number(|row| &mut row.exposure),
        attributes: |_| json!({"long_name": "exposure time", "units": "ms"}),
    },
    Column {
        name: "focal_power_asked",
        field: Field::Number(|row| &mut row.asked),
        attributes: |_| json!({"long_name": "focal power asked of the lens after the frame", "units": "1"}),
    },
    Column {
        name: "focal_power_measured",
        field: Field::Number(|row| &mut row.measured),
        attributes: |_| {
            json!({
                "long_name": "focal power at the middle of the exposure; NaN while unknown",
                "units": "1",
            })
        },
    },
    Column {
        name: "focal_power_optimal",
        field: Field::Number(|row| &mut row.optimal),
        attributes: |_| json!({"long_name": "best focal power, where a simulation knows it; else NaN", "units": "1"}),
    },
    Column {
        name: "patch_x",
        field: Field::Count(|row| &mut row.patch.corner.0),
        attributes: |_| json!({"long_name": "left column of the patch in mosaic cells", "units": "1"}),
    },
    Column {
        name: "patch_y",
        field: Field::Count(|row| &mut row.patch.corner.1),
        attributes: |_| json!({"long_name": "top row of the patch in mosaic cells", "units": "1"}),
    },
    Column {
        name: "patch_jumps",
        field: Field::Count(|row| &mut row.patch.jumps),
        attributes: |_| {
            json!({
                "long_name": "how often the patch had jumped or the focus had been let go; policies forget at a change",
            })
        },
    },
];

/// Encodes and decodes the files of the columns.
pub struct Coders {
    times: Coder,
    counts: Coder,
    numbers: Coder,
}

impl Coders {
    /// Coders for files of [`COLUMN_CHUNK`] values.
    ///
    /// # Errors
    /// If the codecs do not work.
    pub fn new() -> Result<Self, RecordingError> {
        let shape = [COLUMN_CHUNK];
        Ok(Self {
            times: Coder::new(int64(), FillValue::from(0_i64), &shape, plain_codecs())?,
            counts: Coder::new(uint64(), FillValue::from(0_u64), &shape, plain_codecs())?,
            numbers: Coder::new(float64(), FillValue::from(f64::NAN), &shape, plain_codecs())?,
        })
    }

    /// The file of `column` with the values of `rows`. At most [`COLUMN_CHUNK`] rows fit; more are left out.
    ///
    /// # Errors
    /// If the codec fails.
    pub fn encode(&self, column: &Column, rows: &[FrameRow]) -> Result<Vec<u8>, RecordingError> {
        match column.field {
            Field::Time(field) => encoded(&self.times, rows, field, 0),
            Field::Count(field) => encoded(&self.counts, rows, field, 0),
            Field::Number(field) => encoded(&self.numbers, rows, field, f64::NAN),
        }
    }

    /// The rows of the first `frames` frames in `folder`.
    ///
    /// # Errors
    /// If a file cannot be read, or is missing or damaged.
    pub fn read(&self, folder: &Path, frames: usize) -> Result<Vec<FrameRow>, RecordingError> {
        let mut rows = Vec::new();

        for file in 0..frames.div_ceil(COLUMN_CHUNK) {
            let mut part = vec![FrameRow::default(); COLUMN_CHUNK.min(frames - rows.len())];
            for column in &COLUMNS {
                let path = folder.join(column.name).join(format!("c/{file}"));
                let damaged = || {
                    let name = column.name;
                    let damage = format!("the values of `{name}` are missing or do not match their checksum");
                    RecordingError::damaged(&path, damage)
                };
                let stored = fs::read(&path).map_err(|error| match error.kind() {
                    ErrorKind::NotFound => damaged(),
                    _ => RecordingError::unreadable(&path)(error),
                })?;

                let decoded = match column.field {
                    Field::Time(field) => decode(&self.times, stored, field, &mut part),
                    Field::Count(field) => decode(&self.counts, stored, field, &mut part),
                    Field::Number(field) => decode(&self.numbers, stored, field, &mut part),
                };
                decoded.map_err(|_| damaged())?;
            }
            rows.extend(part);
        }

        Ok(rows)
    }
}

fn encoded<T: Element + Copy>(
    coder: &Coder,
    rows: &[FrameRow],
    field: fn(&mut FrameRow) -> &mut T,
    fill: T,
) -> Result<Vec<u8>, RecordingError> {
    let value = |mut row: FrameRow| *field(&mut row);
    let mut values: Vec<T> = rows.iter().copied().map(value).collect();
    values.resize(COLUMN_CHUNK, fill);
    coder.encode(&values)
}

/// Decodes a file into `field` of `rows`.
fn decode<T: ElementOwned>(
    coder: &Coder,
    stored: Vec<u8>,
    field: fn(&mut FrameRow) -> &mut T,
    rows: &mut [FrameRow],
) -> Result<(), RecordingError> {
    for (row, value) in rows.iter_mut().zip(coder.decode(stored)?) {
        *field(row) = value;
    }
    Ok(())
}
