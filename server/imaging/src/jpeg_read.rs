//! Reading JPEG pictures, by libjpeg-turbo. It warns of all damage that it notices; other decoders fill the hole in
//! silence.

use std::io::Cursor;

use image::codecs::jpeg::JpegDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, ImageDecoder};
use turbojpeg::{Colorspace, DecompressHeader, Decompressor, Image, PixelFormat, ScalingFactor};

use super::picture::{DecodeError, check_size};

/// Most scans of a progressive picture. More are a trick to keep the decoder busy.
const MOST_SCANS: u32 = 500;

/// Width and height, before the picture is turned.
pub(super) fn size(bytes: &[u8]) -> Result<(usize, usize), DecodeError> {
    let header = header(&mut decompressor()?, bytes)?;
    Ok((header.width, header.height))
}

/// How the picture must be turned, from its EXIF data.
pub(super) fn orientation(bytes: &[u8]) -> Orientation {
    let decoder = JpegDecoder::new(Cursor::new(bytes));
    decoder.and_then(|mut decoder| decoder.orientation()).unwrap_or(Orientation::NoTransforms)
}

/// Reads the picture, before it is turned. A picture with any damage is an error.
pub(super) fn read(bytes: &[u8]) -> Result<DynamicImage, DecodeError> {
    let mut decompressor = decompressor()?;
    let header = header(&mut decompressor, bytes)?;
    let format = match header.colorspace {
        Colorspace::Gray => PixelFormat::GRAY,
        Colorspace::CMYK | Colorspace::YCCK => PixelFormat::CMYK,
        Colorspace::RGB | Colorspace::YCbCr => PixelFormat::RGB,
    };

    let DecompressHeader { width, height, .. } = header;
    let pitch = width * format.size();
    let mut pixels = vec![0; pitch * height];
    let image = Image { pixels: pixels.as_mut_slice(), width, pitch, height, format };
    decompressor.decompress(bytes, image).map_err(damaged)?;
    // Arithmetic coding has no bits that pixels need or not: its data may end early.
    if !header.is_arithmetic && has_spare_data(&mut decompressor, bytes, (width, height)) {
        return Err(DecodeError::Damaged("it holds more data than its pixels need".to_owned()));
    }

    let size = (width as u32, height as u32);
    let picture = match format {
        PixelFormat::GRAY => ImageBuffer::from_raw(size.0, size.1, pixels).map(DynamicImage::ImageLuma8),
        PixelFormat::CMYK => ImageBuffer::from_raw(size.0, size.1, printed(&pixels)).map(DynamicImage::ImageRgb8),
        _ => ImageBuffer::from_raw(size.0, size.1, pixels).map(DynamicImage::ImageRgb8),
    };
    picture.ok_or(DecodeError::TooLarge)
}

/// Checks a strip or tile of a TIFF, whose `tables` all of its parts share. One with any damage is an error.
pub(super) fn check_part(tables: &[u8], stored: &[u8]) -> Result<(), DecodeError> {
    // Both begin with a mark of the beginning, and the tables end with one of the end.
    let tables = tables.get(2..tables.len().saturating_sub(2)).unwrap_or_default();
    let whole = [&b"\xFF\xD8"[..], tables, stored.get(2..).unwrap_or_default()].concat();
    read(&whole).map(|_| ())
}

/// Whether the last scan holds more data than its pixels need. After a hole, what is left may be read as too few pixels;
/// libjpeg says nothing of a rest of up to 8 bytes. Without its last byte, a scan without damage is too short.
fn has_spare_data(decompressor: &mut Decompressor, bytes: &[u8], (width, height): (usize, usize)) -> bool {
    let Some(end) = last_scan_end(bytes) else { return false };
    let shorter = bytes[..end].strip_suffix(b"\xFF\0").unwrap_or(&bytes[..end - 1]);
    let shorter = [shorter, b"\xFF\xD9"].concat();

    // The pixels do not matter: few are computed.
    let factor = ScalingFactor::ONE_EIGHTH;
    if decompressor.set_scaling_factor(factor).is_err() {
        return false;
    }
    let (width, height) = (factor.scale(width), factor.scale(height));
    let mut pixels = vec![0; width * height];
    let image = Image { pixels: pixels.as_mut_slice(), width, pitch: width, height, format: PixelFormat::GRAY };
    decompressor.decompress(&shorter, image).is_ok()
}

/// The place after the data of the last scan before the picture's end.
fn last_scan_end(bytes: &[u8]) -> Option<usize> {
    const SCAN: u8 = 0xDA;
    const END: u8 = 0xD9;
    let mut end = None;
    let mut at = 2;
    while let [first, marker, rest @ ..] = bytes.get(at..)? {
        match (first, *marker) {
            (0xFF, END) => break,
            // Bytes that fill up, and markers without content.
            (0xFF, 0xFF) => at += 1,
            (0xFF, 0 | 1 | 0xD0..=0xD8) => at += 2,
            (0xFF, marker) => {
                let &[high, low, ..] = rest else { return end };
                at += 2 + usize::from(u16::from_be_bytes([high, low]));
                if marker == SCAN {
                    // Data go on to a marker that is no restart of them.
                    let goes_on = |pair: &[u8]| pair[0] != 0xFF || matches!(pair[1], 0 | 0xD0..=0xD7);
                    at += bytes.get(at..)?.windows(2).take_while(|pair| goes_on(pair)).count();
                    end = Some(at);
                }
            }
            _ => at += 1,
        }
    }
    end
}

/// Printing colours as RGB. Files hold them inverted: 255 is no ink.
fn printed(pixels: &[u8]) -> Vec<u8> {
    let mixed = |&[c, m, y, k]: &[u8; 4]| [c, m, y].map(|ink| (u16::from(ink) * u16::from(k) / 255) as u8);
    pixels.as_chunks::<4>().0.iter().flat_map(mixed).collect()
}

fn decompressor() -> Result<Decompressor, DecodeError> {
    let mut decompressor = Decompressor::new().map_err(damaged)?;
    decompressor.set_scan_limit(MOST_SCANS).map_err(damaged)?;
    Ok(decompressor)
}

fn header(decompressor: &mut Decompressor, bytes: &[u8]) -> Result<DecompressHeader, DecodeError> {
    let header = decompressor.read_header(bytes).map_err(damaged)?;
    check_size(header.width, header.height)?;
    Ok(header)
}

fn damaged(error: turbojpeg::Error) -> DecodeError {
    let reason = match error {
        turbojpeg::Error::TurboJpegError(reason) => reason,
        error => error.to_string(),
    };
    DecodeError::Damaged(reason)
}

#[cfg(test)]
mod tests {
    use turbojpeg::Compressor;

    use super::*;

    /// A picture without damage, in the coding that `choose` sets.
    fn coded(choose: impl FnOnce(&mut Compressor) -> turbojpeg::Result<()>) -> Vec<u8> {
        let (width, height) = (64, 48);
        let pixels: Vec<u8> = (0..width * height).map(|index| (index * index / 7 % 251) as u8).collect();
        let mut compressor = Compressor::new().unwrap();
        compressor.set_subsamp(turbojpeg::Subsamp::Gray).unwrap();
        choose(&mut compressor).unwrap();
        let image = Image { pixels: pixels.as_slice(), width, pitch: width, height, format: PixelFormat::GRAY };
        compressor.compress_to_vec(image).unwrap()
    }

    #[test]
    fn a_picture_without_damage_is_read_in_each_coding() {
        let expected = read(&coded(|_| Ok(()))).unwrap();
        for (name, bytes) in [
            ("optimised", coded(|compressor| compressor.set_optimize(true))),
            ("progressive", coded(|compressor| compressor.set_progressive(true))),
            ("arithmetic", coded(|compressor| compressor.set_arithmetic(true))),
        ] {
            let found = read(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(found == expected, "{name}");
        }
    }
}
