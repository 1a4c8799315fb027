//! Encodes chunks of Zarr arrays as bytes, and decodes them.

use std::num::NonZeroU64;

use serde_json::{Value, json};
use zarrs::array::{
    ArrayBytesRaw, ArrayToBytesCodecTraits, CodecChain, CodecOptions, DataType, Element, ElementOwned, FillValue,
};
use zarrs::metadata::v3::MetadataV3;

use super::error::RecordingError;

/// Codecs of a frame. LZ4 after sorting bits by their significance takes a third of the time of Zstandard, and its
/// output is a tenth larger. The checksum shows which frame is damaged.
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

/// Codecs of a shard's index, and of small arrays.
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
    /// A coder for chunks of `shape` (lengths of its dimensions, in elements), stored by `codecs`.
    ///
    /// # Errors
    /// If a codec is unknown, or a dimension has no elements.
    pub fn new(data_type: DataType, fill: FillValue, shape: &[usize], codecs: Value) -> Result<Self, RecordingError> {
        let metadata: Vec<MetadataV3> = serde_json::from_value(codecs).map_err(RecordingError::codec)?;
        let chain = CodecChain::from_metadata(&metadata).map_err(RecordingError::codec)?;

        let shape: Option<Vec<NonZeroU64>> = shape.iter().map(|&length| NonZeroU64::new(length as u64)).collect();
        let shape = shape.ok_or_else(|| RecordingError::codec("a chunk has no elements"))?;
        let options = CodecOptions::default().with_concurrent_target(1).with_validate_checksums(true);
        Ok(Self { chain, data_type, fill, shape, options })
    }

    /// A coder for frames of `width` x `height` samples.
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
    /// If the number of elements is not that of a chunk.
    pub fn encode<T: Element>(&self, elements: &[T]) -> Result<Vec<u8>, RecordingError> {
        let bytes = T::to_array_bytes(&self.data_type, elements).map_err(RecordingError::codec)?;
        let encoded = self.chain.encode(bytes, &self.shape, &self.data_type, &self.fill, &self.options);
        encoded.map(ArrayBytesRaw::into_owned).map_err(RecordingError::codec)
    }

    /// The elements of a stored chunk.
    ///
    /// # Errors
    /// If it is damaged.
    pub fn decode<T: ElementOwned>(&self, stored: Vec<u8>) -> Result<Vec<T>, RecordingError> {
        let bytes = self.chain.decode(stored.into(), &self.shape, &self.data_type, &self.fill, &self.options);
        let bytes = bytes.map_err(RecordingError::codec)?;
        T::from_array_bytes(&self.data_type, bytes).map_err(RecordingError::codec)
    }
}
