//! Reading JPEG pictures, by libjpeg-turbo. It warns of all damage that it notices; other decoders fill the hole in
//! silence.

use std::io::Cursor;

use image::codecs::jpeg::JpegDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, ImageDecoder};
use turbojpeg::{Colorspace, DecompressHeader, Decompressor, Image, PixelFormat};

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

    let size = (width as u32, height as u32);
    let picture = match format {
        PixelFormat::GRAY => ImageBuffer::from_raw(size.0, size.1, pixels).map(DynamicImage::ImageLuma8),
        PixelFormat::CMYK => ImageBuffer::from_raw(size.0, size.1, printed(&pixels)).map(DynamicImage::ImageRgb8),
        _ => ImageBuffer::from_raw(size.0, size.1, pixels).map(DynamicImage::ImageRgb8),
    };
    picture.ok_or(DecodeError::TooLarge)
}

/// The samples of a strip or tile of a TIFF, whose `tables` all of its chunks share. It may be larger than `width` x
/// `height` pixels of `channels` samples. With `rgb` its colours are RGB although nothing in it says so.
pub(super) fn chunk(
    tables: &[u8],
    stored: &[u8],
    (width, height): (usize, usize),
    channels: usize,
    rgb: bool,
) -> Result<Vec<u16>, DecodeError> {
    /// Adobe's mark: what follows is not YCbCr.
    const PLAIN: &[u8] = b"\xFF\xEE\0\x0EAdobe\0\x64\0\0\0\0\0";
    // Both begin with a mark of the beginning, and the tables end with one of the end.
    let tables = tables.get(2..tables.len().saturating_sub(2)).unwrap_or_default();
    let mark = if rgb { PLAIN } else { &[] };
    let whole = [&b"\xFF\xD8"[..], mark, tables, stored.get(2..).unwrap_or_default()].concat();

    let picture = read(&whole)?;
    let size = (picture.width() as usize, picture.height() as usize);
    let found = match &picture {
        DynamicImage::ImageLuma8(gray) if channels == 1 => gray.as_raw(),
        DynamicImage::ImageRgb8(rgb) if channels == 3 => rgb.as_raw(),
        _ => return Err(DecodeError::OtherPixels(format!("JPEG with {channels} samples per pixel"))),
    };
    if size.0 != width || size.1 < height {
        return Err(DecodeError::Damaged(format!("a part of {width}x{height} pixels has {}x{}", size.0, size.1)));
    }
    Ok(found[..width * height * channels].iter().copied().map(u16::from).collect())
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
