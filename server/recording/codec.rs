//! Chunks of Zarr arrays, to bytes and back.

use std::num::NonZeroU64;

use serde_json::{Value, json};
use zarrs::array::{
    ArrayBytesRaw, ArrayToBytesCodecTraits, CodecChain, CodecOptions, DataType, Element, ElementOwned, FillValue,
};
use zarrs::metadata::v3::MetadataV3;

use super::error::RecordingError;

/// Codecs of a frame. LZ4 after sorting bits by their significance takes a third of the time of Zstandard and leaves
/// a tenth more; the checksum names the frame that is damaged.
pub fn frame_codecs() -> Value {
    json!([
        {"name": "bytes", "configuration": {"endian": "little"}},
        {
            "name": "blosc",
            "configuration": {"cname": "lz4", "clevel": 1, "shuffle": "bitshuffle", "typesize": 2, "blocksize": 0}
        },
        {"name": "crc32c"}
    ])
}

/// Codecs of a shard's index, and of values that take up little room.
pub fn plain_codecs() -> Value {
    json!([{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "crc32c"}])
}

/// Encodes and decodes the chunks of one array.
pub struct Coder {
    chain: CodecChain,
    data_type: DataType,
    fill: FillValue,
    shape: Vec<NonZeroU64>,
    options: CodecOptions,
}

impl Coder {
    /// For chunks of `shape` (lengths of its dimensions, in elements), stored by `codecs`.
    ///
    /// # Errors
    /// When there is no such codec.
    pub fn new(data_type: DataType, fill: FillValue, shape: &[usize], codecs: Value) -> Result<Self, RecordingError> {
        let failed = |problem: String| RecordingError::Codec(problem);
        let metadata: Vec<MetadataV3> = serde_json::from_value(codecs).map_err(|error| failed(error.to_string()))?;
        let chain = CodecChain::from_metadata(&metadata).map_err(|error| failed(error.to_string()))?;

        let shape: Option<Vec<NonZeroU64>> = shape.iter().map(|&length| NonZeroU64::new(length as u64)).collect();
        let shape = shape.ok_or_else(|| failed("a chunk has no elements".to_owned()))?;
        let options = CodecOptions::default().with_concurrent_target(1).with_validate_checksums(true);
        Ok(Self { chain, data_type, fill, shape, options })
    }

    /// Coder of frames of `width` x `height` samples.
    ///
    /// # Errors
    /// As [`Coder::new`].
    pub fn of_frames(width: usize, height: usize) -> Result<Self, RecordingError> {
        let shape = [1, height, width];
        Self::new(zarrs::array::data_type::uint16(), FillValue::from(0_u16), &shape, frame_codecs())
    }

    /// The stored form of a whole chunk.
    ///
    /// # Errors
    /// When there are not as many elements as the chunk has.
    pub fn encode<T: Element>(&self, elements: &[T]) -> Result<Vec<u8>, RecordingError> {
        let bytes = T::to_array_bytes(&self.data_type, elements).map_err(|error| failed(&error))?;
        let encoded = self.chain.encode(bytes, &self.shape, &self.data_type, &self.fill, &self.options);
        encoded.map(ArrayBytesRaw::into_owned).map_err(|error| failed(&error))
    }

    /// The elements of a stored chunk.
    ///
    /// # Errors
    /// When it is damaged.
    pub fn decode<T: ElementOwned>(&self, stored: Vec<u8>) -> Result<Vec<T>, RecordingError> {
        let bytes = self.chain.decode(stored.into(), &self.shape, &self.data_type, &self.fill, &self.options);
        let bytes = bytes.map_err(|error| failed(&error))?;
        T::from_array_bytes(&self.data_type, bytes).map_err(|error| failed(&error))
    }
}

fn failed(error: &dyn std::fmt::Display) -> RecordingError {
    RecordingError::Codec(error.to_string())
}
