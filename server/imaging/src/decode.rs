//! Reading pictures and mosaics from the bytes of a file: PNG, JPEG, TIFF and raw mosaics.

use std::io::Cursor;

use image::{DynamicImage, ImageError, ImageFormat, ImageReader, Limits};

use super::frame::{FrameError, GrayImage, MosaicFrame, RgbImage};
use super::luma::luma;
use super::reconstruct::Reconstructor;

/// Width and height of the full sensor (IMEC CMV2K) in samples. Raw mosaics have this size.
pub const SENSOR_SIZE: (usize, usize) = (2048, 1088);

/// Longest side of a picture that is read, in pixels.
const LARGEST_SIDE: u32 = 16_384;

/// Most memory that decoding one picture may take, in bytes.
const LARGEST_MEMORY: u64 = 512 << 20;

/// A decoded picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Picture {
    /// A colour picture, and its gray made from all of its bits.
    Rgb(RgbImage, GrayImage),
    /// A gray picture on the 0..255 scale.
    Gray(GrayImage),
    /// A sensor's mosaic, in counts.
    Mosaic(MosaicFrame),
}

impl Picture {
    /// The picture in gray; `reconstructor` makes it from a mosaic.
    #[must_use]
    pub fn into_gray(self, reconstructor: &mut Reconstructor) -> GrayImage {
        match self {
            Self::Rgb(_, gray) | Self::Gray(gray) => gray,
            Self::Mosaic(mosaic) => {
                let mut gray = GrayImage::default();
                reconstructor.reconstruct(&mosaic, &mut RgbImage::default(), &mut gray);
                gray
            }
        }
    }
}

/// Why bytes are not a picture. The message is meant to follow "FILE: ".
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// There are no bytes.
    #[error("the file is empty")]
    Empty,
    /// The bytes do not begin like any picture.
    #[error("not a PNG, JPEG or TIFF picture (a raw mosaic's name ends in .raw or .bin)")]
    NotAPicture,
    /// A picture of an unsupported format.
    #[error("cannot read {0} pictures; convert it to PNG, JPEG or TIFF")]
    OtherFormat(&'static str),
    /// The format is right, but the contents are damaged.
    #[error("damaged or cut short: {0}")]
    Damaged(String),
    /// An unsupported kind of pixel.
    #[error("cannot read pixels of this kind ({0}); convert it to 8 or 16 bit gray or RGB")]
    OtherPixels(String),
    /// The picture exceeds the limits on pixels or memory.
    #[error("too large: the limit is {LARGEST_SIDE} pixels per side and {} MiB", LARGEST_MEMORY >> 20)]
    TooLarge,
    /// A mosaic was asked for, but the picture is colour or 8 bit.
    #[error("a mosaic is a 16-bit gray picture, not {0}")]
    NotAMosaic(&'static str),
    /// A mosaic whose sides are not multiples of 4.
    #[error(transparent)]
    MosaicSize(#[from] FrameError),
    /// A raw mosaic of another length than the sensor's.
    #[error(
        "a raw mosaic is {}x{} samples of 2 bytes, {expected} bytes, but this file has {found}",
        SENSOR_SIZE.0,
        SENSOR_SIZE.1
    )]
    RawLength {
        /// Bytes of a full mosaic.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
}

/// Reads a PNG, JPEG or TIFF picture of 8 or 16 bit, gray or RGB; alpha is left out.
///
/// A 16-bit gray picture of the sensor's full size is a mosaic. With `mosaic`, every 16-bit gray picture is read as
/// one, and its sides must be multiples of 4.
///
/// # Errors
/// If the bytes are not such a picture, or are cut short.
pub fn decode(bytes: &[u8], mosaic: bool) -> Result<Picture, DecodeError> {
    let picture = decode_any(bytes)?;
    let width = picture.width() as usize;
    let height = picture.height() as usize;
    let mosaic_by_size = is_mosaic(&picture);

    match picture {
        DynamicImage::ImageLuma16(samples) if mosaic || mosaic_by_size => {
            Ok(Picture::Mosaic(MosaicFrame::new(width, height, samples.into_raw())?))
        }
        DynamicImage::ImageLuma8(_) | DynamicImage::ImageLumaA8(_) if mosaic => {
            Err(DecodeError::NotAMosaic("an 8-bit one"))
        }
        DynamicImage::ImageLumaA16(_) if mosaic => Err(DecodeError::NotAMosaic("one with transparency")),
        _ if mosaic => Err(DecodeError::NotAMosaic("a colour one")),
        DynamicImage::ImageLuma8(_) | DynamicImage::ImageLumaA8(_) => {
            let data = picture.into_luma8().into_raw().into_iter().map(f32::from).collect();
            Ok(Picture::Gray(GrayImage { width, height, data }))
        }
        DynamicImage::ImageLuma16(_) | DynamicImage::ImageLumaA16(_) => {
            let data = picture.into_luma16().into_raw().into_iter().map(from_16_bit).collect();
            Ok(Picture::Gray(GrayImage { width, height, data }))
        }
        DynamicImage::ImageRgb8(_) | DynamicImage::ImageRgba8(_) => {
            let data = picture.into_rgb8().into_raw();
            let gray = data.as_chunks::<3>().0.iter().map(|pixel| luma(pixel.map(f32::from))).collect();
            Ok(Picture::Rgb(RgbImage { width, height, data }, GrayImage { width, height, data: gray }))
        }
        DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
            let wide = picture.to_rgb16().into_raw();
            let gray = wide.as_chunks::<3>().0.iter().map(|pixel| luma(pixel.map(from_16_bit))).collect();
            let data = picture.into_rgb8().into_raw();
            Ok(Picture::Rgb(RgbImage { width, height, data }, GrayImage { width, height, data: gray }))
        }
        other => Err(DecodeError::OtherPixels(format!("{:?}", other.color()))),
    }
}

/// Whether `picture` is a sensor's mosaic: 16-bit gray of the sensor's full size.
#[must_use]
pub fn is_mosaic(picture: &DynamicImage) -> bool {
    matches!(picture, DynamicImage::ImageLuma16(_))
        && (picture.width() as usize, picture.height() as usize) == SENSOR_SIZE
}

/// Reads a raw mosaic: 2048x1088 samples, row by row, each two bytes with the low one first.
///
/// # Errors
/// If `bytes` has another length.
pub fn decode_raw(bytes: &[u8]) -> Result<MosaicFrame, DecodeError> {
    let (width, height) = SENSOR_SIZE;
    let expected = 2 * width * height;
    if bytes.len() != expected {
        return Err(DecodeError::RawLength { expected, found: bytes.len() });
    }

    let samples = bytes.as_chunks::<2>().0.iter().map(|&pair| u16::from_le_bytes(pair)).collect();
    Ok(MosaicFrame::new(width, height, samples)?)
}

/// Reads a PNG, JPEG or TIFF picture with any pixels except floating-point ones. Nothing says which value of those is
/// white. The `image` crate assumes 1, so most such pictures would become white.
///
/// # Errors
/// If the bytes are not such a picture or are cut short, or if the picture is too large.
pub fn decode_any(bytes: &[u8]) -> Result<DynamicImage, DecodeError> {
    if bytes.is_empty() {
        return Err(DecodeError::Empty);
    }

    let format = image::guess_format(bytes).map_err(|_| DecodeError::NotAPicture)?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Tiff) {
        return Err(DecodeError::OtherFormat(format.extensions_str().first().copied().unwrap_or("these")));
    }

    if format == ImageFormat::Jpeg && !jpeg_ends(bytes) {
        return Err(DecodeError::Damaged("the end of the JPEG data is missing".to_owned()));
    }

    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(LARGEST_MEMORY);

    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let picture = reader.decode().map_err(|error| match error {
        ImageError::Limits(_) => DecodeError::TooLarge,
        ImageError::Unsupported(error) => DecodeError::OtherPixels(error.to_string()),
        error => DecodeError::Damaged(error.to_string()),
    })?;

    match picture {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            Err(DecodeError::OtherPixels(format!("{:?}", picture.color())))
        }
        picture => Ok(picture),
    }
}

/// Whether an end marker follows the last scan. Checked here because the decoder silently fills up pictures that are
/// cut short.
fn jpeg_ends(bytes: &[u8]) -> bool {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xFF, marker]);
    last(0xD9) > last(0xDA)
}

/// Scales 0..=65535 to 0..=255.
fn from_16_bit(value: u16) -> f32 {
    f32::from(value) / 257.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn gray16(width: u32, height: u32, value: u16) -> DynamicImage {
        DynamicImage::ImageLuma16(image::ImageBuffer::from_pixel(width, height, image::Luma([value])))
    }

    #[test]
    fn sixteen_bits_come_onto_the_scale_of_eight() {
        for format in [ImageFormat::Png, ImageFormat::Tiff] {
            let Picture::Gray(gray) = decode(&encoded(&gray16(5, 3, 0x8080), format), false).unwrap() else {
                panic!("gray expected")
            };
            assert_eq!((gray.width, gray.height), (5, 3));
            assert!(gray.data.iter().all(|value| (value - 128.0).abs() < 1e-3));
        }
    }

    #[test]
    fn gray_of_a_wide_colour_picture_keeps_its_low_bits() {
        let wide = image::ImageBuffer::from_pixel(4, 4, image::Rgb([1000_u16, 2000, 3000]));
        let bytes = encoded(&DynamicImage::ImageRgb16(wide), ImageFormat::Tiff);
        let Picture::Rgb(rgb, gray) = decode(&bytes, false).unwrap() else { panic!("colour expected") };
        assert_eq!(&rgb.data[..3], [4, 8, 12]);
        let expected = (0.2126 * 1000.0 + 0.7152 * 2000.0 + 0.0722 * 3000.0) / 257.0;
        assert!((gray.data[0] - expected).abs() < 1e-3);
    }

    #[test]
    fn mosaics_are_known_by_their_size_or_by_word() {
        let full = encoded(&gray16(2048, 1088, 700), ImageFormat::Png);
        assert!(matches!(decode(&full, false), Ok(Picture::Mosaic(frame)) if frame.samples()[5] == 700));

        let small = encoded(&gray16(64, 48, 700), ImageFormat::Tiff);
        assert!(matches!(decode(&small, false), Ok(Picture::Gray(_))));
        assert!(matches!(decode(&small, true), Ok(Picture::Mosaic(frame)) if frame.band_width() == 16));

        let odd = encoded(&gray16(63, 48, 700), ImageFormat::Png);
        assert!(decode(&odd, true).unwrap_err().to_string().contains("multiple of 4"));

        let colour = encoded(&DynamicImage::new_rgb8(64, 48), ImageFormat::Png);
        assert!(matches!(decode(&colour, true), Err(DecodeError::NotAMosaic(_))));
    }

    #[test]
    fn raw_mosaics_have_one_length() {
        let mut bytes = vec![0; 2 * 2048 * 1088];
        bytes[2..4].copy_from_slice(&[0xFF, 0x03]);
        assert_eq!(decode_raw(&bytes).unwrap().samples()[1], 1023);

        bytes.pop();
        let message = decode_raw(&bytes).unwrap_err().to_string();
        assert!(message.contains("4456448 bytes") && message.ends_with("has 4456447"), "{message}");
    }

    #[test]
    fn a_picture_cut_short_at_any_length_is_an_error() {
        let picture = DynamicImage::ImageRgb8(image::ImageBuffer::from_fn(64, 48, |x, y| {
            image::Rgb([x, y, x ^ y].map(|value| u8::try_from(value % 256).unwrap()))
        }));
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tiff] {
            let bytes = encoded(&picture, format);
            assert!(decode(&bytes, false).is_ok());

            for length in (0..bytes.len() - 12).step_by(7) {
                assert!(decode(&bytes[..length], false).is_err(), "{format:?} cut to {length} of {}", bytes.len());
            }
        }
    }

    #[test]
    fn errors_say_what_other_files_are() {
        assert!(matches!(decode(b"", false), Err(DecodeError::Empty)));
        assert!(matches!(decode(b"a text, not a picture", false), Err(DecodeError::NotAPicture)));
        let message = decode(b"GIF89a and so on", false).unwrap_err().to_string();
        assert!(message.starts_with("cannot read gif pictures"), "{message}");

        let floats = DynamicImage::ImageRgb32F(image::ImageBuffer::new(4, 4));
        // Both functions refuse them: an 8-bit picture made of them would be white.
        let floats = encoded(&floats, ImageFormat::Tiff);
        assert!(matches!(decode(&floats, false), Err(DecodeError::OtherPixels(_))));
        assert!(matches!(decode_any(&floats), Err(DecodeError::OtherPixels(_))));
    }
}
