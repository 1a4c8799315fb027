//! The strips and tiles of a TIFF page: decompressed, and their samples as numbers.

use std::io::Read;

use flate2::read::ZlibDecoder;
use weezl::BitOrder;
use weezl::decode::Decoder;

use super::super::picture::DecodeError;

/// How the samples of a page's chunks are stored.
pub(super) struct Coding {
    pub(super) compression: u64,
    /// Whether the first pixel of a byte is its lowest bit.
    pub(super) lowest_first: bool,
    /// Whether each sample but a row's first is stored as the difference from the one before.
    pub(super) differences: bool,
    pub(super) bits: usize,
    /// Whether samples of 16 bit have their low byte first.
    pub(super) little: bool,
    /// Samples of a pixel in a chunk: 1 where each channel has its own.
    pub(super) channels: usize,
}

impl Coding {
    /// The samples of a chunk of `width` x `height` pixels, row by row.
    pub(super) fn samples(&self, stored: &[u8], width: usize, height: usize) -> Result<Vec<u16>, DecodeError> {
        let across = width * self.channels;
        let row = (across * self.bits).div_ceil(8);
        let bytes = self.decompressed(stored, row * height)?;

        let mut samples = Vec::with_capacity(across * height);
        for row in bytes.chunks_exact(row) {
            let begin = samples.len();
            self.unpack(row, across, &mut samples);
            if self.differences {
                add_up(&mut samples[begin..], self.channels, self.bits);
            }
        }
        Ok(samples)
    }

    /// The first `length` bytes of what is stored compressed. What follows is padding.
    fn decompressed(&self, stored: &[u8], length: usize) -> Result<Vec<u8>, DecodeError> {
        let reversed: Vec<u8>;
        let stored = if self.lowest_first {
            reversed = stored.iter().map(|byte| byte.reverse_bits()).collect();
            &reversed[..]
        } else {
            stored
        };

        let bytes = match self.compression {
            1 => stored[..length.min(stored.len())].to_vec(),
            5 => lzw(stored, length)?,
            8 | 32_946 => deflate(stored, length),
            32_773 => pack_bits(stored, length),
            other => return Err(DecodeError::OtherPixels(format!("compression {}", name(other)))),
        };
        if bytes.len() < length {
            let reason = format!("a part of it holds {} of {length} bytes", bytes.len());
            return Err(DecodeError::Damaged(reason));
        }
        Ok(bytes)
    }

    /// Adds the `count` samples of a row.
    fn unpack(&self, row: &[u8], count: usize, samples: &mut Vec<u16>) {
        let word = |&pair: &[u8; 2]| if self.little { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) };
        match self.bits {
            8 => samples.extend(row[..count].iter().copied().map(u16::from)),
            16 => samples.extend(row.as_chunks::<2>().0[..count].iter().map(word)),
            // Other sizes are packed without gaps, highest bit first, whatever the order of bytes.
            bits => {
                let mut held = 0_u32;
                let mut have = 0;
                let mut bytes = row.iter();
                for _ in 0..count {
                    while have < bits {
                        held = held << 8 | u32::from(bytes.next().copied().unwrap_or(0));
                        have += 8;
                    }
                    have -= bits;
                    samples.push((held >> have & ((1 << bits) - 1)) as u16);
                }
            }
        }
    }
}

/// Replaces the differences of a row by the samples.
fn add_up(row: &mut [u16], channels: usize, bits: usize) {
    let mask = u16::MAX >> (16 - bits);
    for index in channels..row.len() {
        row[index] = row[index].wrapping_add(row[index - channels]) & mask;
    }
}

/// Writers may leave out the end code of a chunk that is full.
fn lzw(stored: &[u8], length: usize) -> Result<Vec<u8>, DecodeError> {
    // The first versions of LZW had their bits the other way round; a chunk begins with a clear code in both.
    if matches!(stored, [0, second, ..] if second & 1 == 1) {
        return Err(DecodeError::OtherPixels("LZW of before 1988".to_owned()));
    }

    let mut decoder = Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
    let mut bytes = vec![0; length];
    let mut filled = 0;
    let mut rest = stored;
    while filled < length {
        let step = decoder.decode_bytes(rest, &mut bytes[filled..]);
        filled += step.consumed_out;
        rest = &rest[step.consumed_in..];
        let stands = step.consumed_in == 0 && step.consumed_out == 0;
        if step.status.is_err() || stands {
            break;
        }
    }
    bytes.truncate(filled);
    Ok(bytes)
}

fn deflate(stored: &[u8], length: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    // What was read before an error stays; the caller sees that it is too short.
    let _ = ZlibDecoder::new(stored).take(length as u64).read_to_end(&mut bytes);
    bytes
}

/// A count and as many bytes, or a count below zero and a byte to repeat.
fn pack_bits(stored: &[u8], length: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(length);
    let mut rest = stored;
    while let Some((&count, after)) = rest.split_first() {
        if bytes.len() >= length {
            break;
        }
        rest = match count {
            128 => after,
            0..=127 => {
                let (literal, after) = after.split_at((usize::from(count) + 1).min(after.len()));
                bytes.extend_from_slice(literal);
                after
            }
            _ => {
                let Some((&byte, after)) = after.split_first() else { break };
                bytes.extend(std::iter::repeat_n(byte, 257 - usize::from(count)));
                after
            }
        };
    }
    bytes.truncate(length);
    bytes
}

/// What people call a compression.
fn name(compression: u64) -> String {
    match compression {
        2..=4 => "CCITT (fax)".to_owned(),
        6 => "JPEG of before 1995".to_owned(),
        34_712 | 33_003..=33_005 => "JPEG 2000".to_owned(),
        34_925 => "LZMA".to_owned(),
        50_000 | 34_926 => "Zstandard".to_owned(),
        50_001 | 34_927 => "WebP".to_owned(),
        other => format!("number {other}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_bits_are_repeated_or_taken_as_they_are() {
        // The example of the specification, section 9.
        let stored = [0xFE, 0xAA, 0x02, 0x80, 0x00, 0x2A, 0xFD, 0xAA, 0x03, 0x80, 0x00, 0x2A, 0x22, 0xF7, 0xAA];
        let expected = "aaaaaa80002aaaaaaaaa80002a22aaaaaaaaaaaaaaaaaaaa";
        let expected: Vec<u8> =
            (0..24).map(|at| u8::from_str_radix(&expected[2 * at..2 * at + 2], 16).unwrap()).collect();
        assert_eq!(pack_bits(&stored, 24), expected);
    }

    #[test]
    fn samples_of_any_size_are_packed_highest_bit_first() {
        let coding =
            |bits| Coding { compression: 1, lowest_first: false, differences: false, bits, little: true, channels: 1 };
        assert_eq!(coding(12).samples(&[0x12, 0x3A, 0xBC], 2, 1).unwrap(), [0x123, 0xABC]);
        assert_eq!(coding(10).samples(&[0b1000_0000, 0b0100_0000, 0b0001_1111, 0xFF], 3, 1).unwrap(), [513, 1, 1023]);
        assert_eq!(coding(1).samples(&[0b1010_0000, 0b0100_0000], 3, 2).unwrap(), [1, 0, 1, 0, 1, 0]);
        assert!(coding(16).samples(&[1, 2, 3], 2, 1).is_err());
    }
}
