//! The few OpenIGTLink messages that the server speaks (openigtlink.org, header versions 1 and 2, which belong to
//! protocol versions 2 and 3). All numbers are big-endian, except in pictures.

use bytes::Bytes;
use crc::{CRC_64_ECMA_182, Crc};

use parfocal_imaging::RgbImage;

/// Bytes of a header.
pub const HEADER_BYTES: usize = 58;
/// Longest body that a client may send. Nothing that a client has to say here is longer.
const LONGEST_BODY: u64 = 1 << 20;

const SUM: Crc<u64> = Crc::<u64>::new(&CRC_64_ECMA_182);

/// Version of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// Without metadata.
    Two,
    /// With an extended header and metadata.
    Three,
}

/// What all parts of a message share.
#[derive(Debug, Clone, Copy)]
pub struct Envelope<'a> {
    /// Kind of the message, such as `IMAGE`.
    pub kind: &'a str,
    /// Name of the device, which tells a client's messages apart.
    pub device: &'a str,
    /// Time since 1970: seconds in the upper half, fractions of a second in the lower.
    pub stamp: u64,
    /// Number of the message, in version 3.
    pub id: u32,
}

impl Envelope<'_> {
    /// The message with `content`. `metadata`, names and values, is left out in version 2.
    pub fn seal(&self, version: Version, content: &[u8], metadata: &[(&str, String)]) -> Bytes {
        let mut body = Vec::with_capacity(content.len() + 256);
        match version {
            Version::Two => body.extend(content),
            Version::Three => {
                let (index, values) = packed(metadata);
                body.extend(12u16.to_be_bytes());
                body.extend((index.len() as u16).to_be_bytes());
                body.extend((values.len() as u32).to_be_bytes());
                body.extend(self.id.to_be_bytes());
                body.extend(content);
                body.extend(index);
                body.extend(values);
            }
        }

        let mut message = Vec::with_capacity(HEADER_BYTES + body.len());
        message.extend(version.number().to_be_bytes());
        message.extend(padded::<12>(self.kind));
        message.extend(padded::<20>(self.device));
        message.extend(self.stamp.to_be_bytes());
        message.extend((body.len() as u64).to_be_bytes());
        message.extend(SUM.checksum(&body).to_be_bytes());
        message.append(&mut body);
        message.into()
    }
}

impl Version {
    /// The number that the header has.
    const fn number(self) -> u16 {
        match self {
            Self::Two => 1,
            Self::Three => 2,
        }
    }
}

/// The index and the values of `metadata`, all in UTF-8.
fn packed(metadata: &[(&str, String)]) -> (Vec<u8>, Vec<u8>) {
    /// Its number in IANA's list.
    const UTF_8: u16 = 106;

    let mut index = (metadata.len() as u16).to_be_bytes().to_vec();
    let mut values = Vec::new();
    for (key, value) in metadata {
        index.extend((key.len() as u16).to_be_bytes());
        index.extend(UTF_8.to_be_bytes());
        index.extend((value.len() as u32).to_be_bytes());
        values.extend(key.as_bytes());
        values.extend(value.as_bytes());
    }
    (index, values)
}

fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    for (byte, letter) in bytes.iter_mut().zip(text.bytes()) {
        *byte = letter;
    }
    bytes
}

/// The content of an IMAGE: RGB, 8 bits each, in the plane z = 0 around the origin. A pixel is `spacing` wide.
pub fn image(picture: &RgbImage, spacing: f32) -> Vec<u8> {
    const UINT8: u8 = 3;
    const LITTLE_ENDIAN: u8 = 2;
    const LPS: u8 = 2;

    let mut content = Vec::with_capacity(72 + picture.data.len());
    content.extend(1u16.to_be_bytes());
    content.extend([3, UINT8, LITTLE_ENDIAN, LPS]);

    let size = [picture.width as u16, picture.height as u16, 1];
    content.extend(size.iter().flat_map(|length| length.to_be_bytes()));
    let matrix = [[spacing, 0.0, 0.0], [0.0, spacing, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];
    content.extend(matrix.as_flattened().iter().flat_map(|value| value.to_be_bytes()));

    // The whole picture is sent.
    content.extend([0; 6]);
    content.extend(size.iter().flat_map(|length| length.to_be_bytes()));
    content.extend(&picture.data);
    content
}

/// The content of an NDARRAY of one number.
pub fn number(value: f64) -> Vec<u8> {
    const FLOAT64: u8 = 11;

    let mut content = vec![FLOAT64, 1];
    content.extend(1u16.to_be_bytes());
    content.extend(value.to_be_bytes());
    content
}

/// The content of a STATUS.
pub fn status(code: u16, name: &str, words: &str) -> Vec<u8> {
    let mut content = code.to_be_bytes().to_vec();
    content.extend(0i64.to_be_bytes());
    content.extend(padded::<20>(name));
    content.extend(words.bytes());
    content.push(0);
    content
}

/// What a client's header says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// Version that the client speaks.
    pub version: Version,
    /// Kind of the message.
    pub kind: String,
    /// Bytes of the body.
    pub body: usize,
    sum: u64,
}

impl Header {
    /// Reads a header.
    ///
    /// # Errors
    /// If it is not one; says what is wrong.
    pub fn parse(bytes: &[u8; HEADER_BYTES]) -> Result<Self, &'static str> {
        let version = match u16::from_be_bytes([bytes[0], bytes[1]]) {
            1 => Version::Two,
            2 | 3 => Version::Three,
            _ => return Err("its header has no version that is known"),
        };

        let kind = bytes[2..14].split(|&byte| byte == 0).next().unwrap_or_default();
        if kind.is_empty() || !kind.iter().all(u8::is_ascii_graphic) {
            return Err("its header names no kind of message");
        }

        let long = |at: usize| bytes[at..].first_chunk().map_or(0, |eight| u64::from_be_bytes(*eight));
        let body = long(42);
        if body > LONGEST_BODY {
            return Err("it announces a message of more than a megabyte");
        }

        let kind = String::from_utf8_lossy(kind).into_owned();
        Ok(Self { version, kind, body: body as usize, sum: long(50) })
    }

    /// Whether `body` is the one that the header belongs to.
    pub fn fits(&self, body: &[u8]) -> bool {
        SUM.checksum(body) == self.sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATUS: Envelope<'_> = Envelope { kind: "STATUS", device: "Exoscope", stamp: 3 << 32, id: 7 };

    #[test]
    fn the_checksum_is_that_of_the_protocol() {
        // The check value of CRC-64/ECMA-182, which the protocol names.
        assert_eq!(SUM.checksum(b"123456789"), 0x6c40_df5f_0b49_7347);
    }

    #[test]
    fn a_message_is_read_back_and_a_damaged_one_noticed() {
        for version in [Version::Two, Version::Three] {
            let message = STATUS.seal(version, &status(1, "OK", "well"), &[("FocalPower", "0.5".to_owned())]);
            let (header, body) = message.split_first_chunk::<HEADER_BYTES>().unwrap();
            let header = Header::parse(header).unwrap();
            assert_eq!((header.version, &*header.kind, header.body), (version, "STATUS", body.len()));
            assert!(header.fits(body));
            let mut damaged = body.to_vec();
            damaged[5] ^= 1;
            assert!(!header.fits(&damaged));
        }
    }

    #[test]
    fn what_a_port_scanner_sends_is_not_a_header() {
        let mut bytes = [b' '; HEADER_BYTES];
        bytes[..16].copy_from_slice(b"GET / HTTP/1.1\r\n");
        assert!(Header::parse(&bytes).unwrap_err().contains("version"));
        assert!(Header::parse(&[0; HEADER_BYTES]).is_err());

        let mut endless = [0; HEADER_BYTES];
        endless[1] = 1;
        assert!(Header::parse(&endless).unwrap_err().contains("kind"));
        endless[2..8].copy_from_slice(b"STATUS");
        endless[42] = 1;
        assert!(Header::parse(&endless).unwrap_err().contains("megabyte"));
    }
}
