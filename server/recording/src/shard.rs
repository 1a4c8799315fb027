//! Shards: files that hold the frames of one stretch of time, each compressed by itself, and an index at their end
//! (codec `sharding_indexed` of Zarr v3). We write them ourselves, because frames are compressed as they come and a
//! shard is stored whole.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use zarrs::array::FillValue;
use zarrs::array::data_type::uint64;

use super::codec::{Coder, plain_codecs};
use super::error::RecordingError;

/// Frames in a shard, which is one file: a second at 25 frames a second.
pub const SHARD_FRAMES: usize = 25;
/// Offset and length of a chunk that is absent.
const ABSENT: u64 = u64::MAX;
/// Bytes of the index's checksum.
const CHECKSUM: usize = 4;

/// Offset and length of a frame in its shard, bytes.
pub type ByteRange = (u64, u64);

/// Encodes and reads the index of shards of [`SHARD_FRAMES`] frames.
pub struct Index {
    coder: Coder,
}

impl Index {
    /// An index.
    ///
    /// # Errors
    /// If the codecs do not work.
    pub fn new() -> Result<Self, RecordingError> {
        let coder = Coder::new(uint64(), FillValue::from(ABSENT), &[SHARD_FRAMES, 1, 1, 2], plain_codecs())?;
        Ok(Self { coder })
    }

    /// The index of a shard that begins with these frames, given their stored lengths.
    ///
    /// # Errors
    /// If there are more than [`SHARD_FRAMES`] of them.
    pub fn encode(&self, lengths: &[usize]) -> Result<Vec<u8>, RecordingError> {
        let mut places = Vec::with_capacity(2 * SHARD_FRAMES);
        let mut offset = 0;
        for &length in lengths {
            places.extend([offset, length as u64]);
            offset += length as u64;
        }

        places.resize((2 * SHARD_FRAMES).max(places.len()), ABSENT);
        self.coder.encode(&places)
    }

    /// Offset and length of each frame in a shard, with `None` for each that it lacks. `None` for the whole shard if
    /// its index is cut off or damaged.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn read(&self, shard: &mut File) -> io::Result<Option<Vec<Option<ByteRange>>>> {
        let length = 16 * SHARD_FRAMES + CHECKSUM;
        let whole = shard.metadata()?.len();
        let Some(start) = whole.checked_sub(length as u64) else { return Ok(None) };

        let mut stored = vec![0; length];
        shard.seek(SeekFrom::Start(start))?;
        shard.read_exact(&mut stored)?;

        let Ok(places) = self.coder.decode::<u64>(stored) else { return Ok(None) };
        let place = |pair: &[u64]| match *pair {
            [offset, length] if offset.checked_add(length).is_some_and(|end| end <= start) => Some((offset, length)),
            _ => None,
        };
        Ok(Some(places.chunks_exact(2).map(place).collect()))
    }
}
