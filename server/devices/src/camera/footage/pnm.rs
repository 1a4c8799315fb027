//! The pictures that ffmpeg writes to a pipe, one after another, as PNM.

use std::io::{BufRead, Error};

use image::codecs::pnm::PnmDecoder;
use image::{DynamicImage, ImageDecoder, ImageResult};

/// Most bytes of a picture. One that claims more is implausible: the stream is damaged.
const MOST_BYTES: u64 = 1 << 28;

/// Reads the next picture of `stream` and not a byte more; `None` at the stream's end.
///
/// # Errors
/// If the stream fails, or what follows is not a whole picture.
pub fn next_pnm(stream: &mut impl BufRead) -> ImageResult<Option<DynamicImage>> {
    if stream.fill_buf()?.is_empty() {
        return Ok(None);
    }

    let decoder = PnmDecoder::new(stream)?;
    let bytes = decoder.total_bytes();
    if bytes > MOST_BYTES {
        return Err(Error::other(format!("a picture of {bytes} bytes is too large")).into());
    }

    Ok(Some(DynamicImage::from_decoder(decoder)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_read_one_after_another() {
        let mut stream: &[u8] = b"P6\n2 1\n255\n\x01\x02\x03\x04\x05\x06P5 1 2 255 \x07\x08";
        let mut next = || next_pnm(&mut stream).unwrap();

        let colour = next().unwrap().into_rgb8();
        assert_eq!((colour.dimensions(), colour.into_raw()), ((2, 1), vec![1, 2, 3, 4, 5, 6]));
        let gray = next().unwrap().into_luma8();
        assert_eq!((gray.dimensions(), gray.into_raw()), ((1, 2), vec![7, 8]));
        assert!(next().is_none());
    }

    #[test]
    fn damaged_streams_are_errors() {
        for mut stream in [&b"P6\n2 1\n255\n\x01\x02"[..], b"P6\n9999999 9999999\n255\n", b"P6\nx", b"P", b"text"] {
            assert!(next_pnm(&mut stream).is_err());
        }
    }
}
