//! Pixel formats of machine vision cameras and of raw files, unpacked to 10 bit in u16.
//!
//! Names and layouts: EMVA, *Pixel Format Naming Convention*. Multi-byte samples are little-endian; `p` formats
//! are packed without gaps, lowest bits first.

/// A pixel format that this program reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelFormat {
    /// 8 bit.
    Mono8,
    /// 10 bit in 16.
    Mono10,
    /// 10 bit, four samples in five bytes.
    Mono10p,
    /// 12 bit in 16.
    Mono12,
    /// 12 bit, two samples in three bytes.
    Mono12p,
    /// 16 bit.
    Mono16,
}

impl PixelFormat {
    /// Every format, the best one for a 10-bit sensor on a busy link first.
    pub const ALL: [Self; 6] = [Self::Mono10p, Self::Mono10, Self::Mono12p, Self::Mono12, Self::Mono16, Self::Mono8];

    /// Name by the convention.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mono8 => "Mono8",
            Self::Mono10 => "Mono10",
            Self::Mono10p => "Mono10p",
            Self::Mono12 => "Mono12",
            Self::Mono12p => "Mono12p",
            Self::Mono16 => "Mono16",
        }
    }

    /// Bytes of `samples` samples.
    pub const fn bytes(self, samples: usize) -> usize {
        match self {
            Self::Mono8 => samples,
            Self::Mono10p => (samples * 10).div_ceil(8),
            Self::Mono12p => (samples * 12).div_ceil(8),
            Self::Mono10 | Self::Mono12 | Self::Mono16 => samples * 2,
        }
    }

    /// The greatest count.
    pub const fn white(self) -> u16 {
        match self {
            Self::Mono8 => 0xFF,
            Self::Mono10 | Self::Mono10p => 0x3FF,
            Self::Mono12 | Self::Mono12p => 0xFFF,
            Self::Mono16 => 0xFFFF,
        }
    }

    /// Unpacks `bytes` into `samples`, scaled to 10 bit; stops at the end of the shorter one.
    pub fn unpack(self, bytes: &[u8], samples: &mut [u16]) {
        match self {
            Self::Mono8 => {
                for (sample, &byte) in samples.iter_mut().zip(bytes) {
                    // The top bits are repeated below, so that full scale stays full scale: saturation is
                    // detected by it.
                    *sample = u16::from(byte) << 2 | u16::from(byte) >> 6;
                }
            }
            Self::Mono10 => unpack_words(bytes, samples, 0),
            Self::Mono12 => unpack_words(bytes, samples, 2),
            Self::Mono16 => unpack_words(bytes, samples, 6),
            Self::Mono10p => unpack_10p(bytes, samples),
            Self::Mono12p => unpack_12p(bytes, samples),
        }
    }
}

impl std::fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

impl std::str::FromStr for PixelFormat {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|format| format.name() == name).ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|format| format.name()).collect();
            format!("this pixel format cannot be read: choose from {}", names.join(", "))
        })
    }
}

fn unpack_words(bytes: &[u8], samples: &mut [u16], shift: u32) {
    for (sample, &word) in samples.iter_mut().zip(bytes.as_chunks::<2>().0) {
        *sample = (u16::from_le_bytes(word) >> shift) & 0x3FF;
    }
}

fn unpack_10p(bytes: &[u8], samples: &mut [u16]) {
    for (four, &[a, b, c, d, e]) in samples.as_chunks_mut::<4>().0.iter_mut().zip(bytes.as_chunks::<5>().0) {
        let low = u32::from_le_bytes([a, b, c, d]);
        let part = |shift: u32| (low >> shift & 0x3FF) as u16;
        *four = [part(0), part(10), part(20), part(30) | u16::from(e) << 2];
    }
}

/// Two samples in three bytes: the second byte holds the high bits of the first sample below the low ones of the next.
fn unpack_12p(bytes: &[u8], samples: &mut [u16]) {
    for (two, &[a, b, c]) in samples.as_chunks_mut::<2>().0.iter_mut().zip(bytes.as_chunks::<3>().0) {
        let first = u16::from(b & 0xF) << 8 | u16::from(a);
        let second = u16::from(c) << 4 | u16::from(b) >> 4;
        *two = [first >> 2, second >> 2];
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn unpacked<const N: usize>(format: PixelFormat, bytes: &[u8]) -> [u16; N] {
        let mut samples = [0; N];
        format.unpack(bytes, &mut samples);
        samples
    }

    #[test]
    fn every_format_comes_out_as_ten_bits() {
        assert_eq!(unpacked(PixelFormat::Mono8, &[0, 1, 255]), [0, 4, 1023]);
        assert_eq!(unpacked(PixelFormat::Mono10, &[0xFF, 0x03, 0x01, 0x00]), [1023, 1]);
        assert_eq!(unpacked(PixelFormat::Mono12, &[0xFF, 0x0F, 0x04, 0x00]), [1023, 1]);
        assert_eq!(unpacked(PixelFormat::Mono16, &[0xFF, 0xFF, 0x40, 0x00]), [1023, 1]);
        // 1, 2, 3, 4 lowest bits first: 0000000001 0000000010 0000000011 0000000100 from the right.
        assert_eq!(unpacked(PixelFormat::Mono10p, &[0x01, 0x08, 0x30, 0x00, 0x01]), [1, 2, 3, 4]);
        // 0xABC and 0x123, lowest bits first: the nibbles C B A 3 2 1, two in a byte, the first one low.
        assert_eq!(unpacked(PixelFormat::Mono12p, &[0xBC, 0x3A, 0x12]), [0xABC >> 2, 0x123 >> 2]);
    }

    proptest! {
        #[test]
        fn packed_samples_are_a_bit_stream(values in prop::array::uniform8(0_u16..1024)) {
            let stream = values.iter().rev().fold(0_u128, |bits, &value| bits << 10 | u128::from(value));
            let bytes = stream.to_le_bytes();
            let length = PixelFormat::Mono10p.bytes(8);
            prop_assert_eq!(length, 10);
            prop_assert_eq!(unpacked::<8>(PixelFormat::Mono10p, &bytes[..length]), values);
        }

        #[test]
        fn packed_samples_of_twelve_bit_are_a_bit_stream(values in prop::array::uniform8(0_u16..4096)) {
            let stream = values.iter().rev().fold(0_u128, |bits, &value| bits << 12 | u128::from(value));
            let bytes = stream.to_le_bytes();
            let length = PixelFormat::Mono12p.bytes(8);
            prop_assert_eq!(length, 12);
            prop_assert_eq!(unpacked::<8>(PixelFormat::Mono12p, &bytes[..length]), values.map(|value| value >> 2));
        }

        #[test]
        fn short_data_leave_the_rest_alone(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
            for format in PixelFormat::ALL {
                let samples: [u16; 16] = unpacked(format, &bytes);
                prop_assert!(samples.iter().all(|&sample| sample < 1024));
            }
        }
    }
}
