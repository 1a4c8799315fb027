//! Reading pictures and mosaics from the bytes of a file: PNG, JPEG, TIFF and raw mosaics.

use image::DynamicImage;

use super::frame::MosaicFrame;
use super::picture::{DecodeError, Picture, SENSOR_SIZE};
use super::picture_file::PictureFile;
use super::pixels::PixelFormat;

/// Reads a PNG, JPEG or TIFF file of one picture, as [`PictureFile::read`] does.
///
/// # Errors
/// If the bytes are not such a picture or are damaged, or if they hold several pictures.
pub fn decode(bytes: &[u8], mosaic: bool) -> Result<Picture, DecodeError> {
    PictureFile::open(bytes)?.single()?.read(0, mosaic)
}

/// Whether `picture` is a sensor's mosaic: 16-bit gray of the sensor's full size.
pub fn is_mosaic(picture: &DynamicImage) -> bool {
    matches!(picture, DynamicImage::ImageLuma16(_))
        && (picture.width() as usize, picture.height() as usize) == SENSOR_SIZE
}

/// Formats of raw mosaics whose files differ in length. Two bytes a sample are counts as they are.
const BY_LENGTH: [PixelFormat; 4] =
    [PixelFormat::Mono10, PixelFormat::Mono8, PixelFormat::Mono10p, PixelFormat::Mono12p];

/// Reads a raw mosaic: 2048x1088 samples, row by row, in `format`; if it is `None`, in the one of this length. Returns
/// the format, too. Counts come onto the scale of 10 bit, except that two bytes a sample are taken as they are where
/// no other format is given.
///
/// # Errors
/// If `bytes` has another length.
pub fn decode_raw(bytes: &[u8], format: Option<PixelFormat>) -> Result<(MosaicFrame, PixelFormat), DecodeError> {
    let (width, height) = SENSOR_SIZE;
    let found = raw_format(bytes.len(), format)?;
    if let Some(given) = format {
        check_counts(bytes, given)?;
    }

    let mut samples = vec![0; width * height];
    if found == PixelFormat::Mono10 {
        samples.iter_mut().zip(words(bytes)).for_each(|(sample, word)| *sample = word);
    } else {
        found.unpack(bytes, &mut samples);
    }
    Ok((MosaicFrame::new(width, height, samples)?, found))
}

/// The format of a raw mosaic of `length` bytes: `format`, or if it is `None`, the one of this length.
///
/// # Errors
/// If a mosaic has another length.
pub fn raw_format(length: usize, format: Option<PixelFormat>) -> Result<PixelFormat, DecodeError> {
    let count = SENSOR_SIZE.0 * SENSOR_SIZE.1;
    let known = format.map_or_else(|| BY_LENGTH.to_vec(), |format| vec![format]);
    known.iter().copied().find(|format| format.bytes(count) == length).ok_or_else(|| {
        let sized = |format: &PixelFormat| format!("{format} {} bytes", format.bytes(count));
        let expected = known.iter().map(sized).collect::<Vec<_>>().join(", ");
        let (width, height) = SENSOR_SIZE;
        DecodeError::Raw(format!(
            "a raw mosaic is {width}x{height} samples, in {expected}, but this file has {length} bytes"
        ))
    })
}

/// Refuses counts that do not fit `format`, if it has two bytes for each.
fn check_counts(bytes: &[u8], format: PixelFormat) -> Result<(), DecodeError> {
    let wide = [PixelFormat::Mono10, PixelFormat::Mono12, PixelFormat::Mono16];
    if !wide.contains(&format) {
        return Ok(());
    }

    let largest = words(bytes).max().unwrap_or(0);
    if largest <= format.white() {
        return Ok(());
    }
    let fit = wide.iter().filter(|other| largest <= other.white()).map(|other| other.name());
    let fit = fit.collect::<Vec<_>>().join(" or ");
    let white = format.white();
    Err(DecodeError::Raw(format!("holds a count of {largest}, but {format} ends at {white}; give --raw {fit}")))
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u16> {
    bytes.as_chunks::<2>().0.iter().map(|&pair| u16::from_le_bytes(pair))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use image::ImageFormat;

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
        let (frame, format) = decode_raw(&bytes, None).unwrap();
        assert_eq!((frame.samples()[1], format), (1023, PixelFormat::Mono10));

        bytes.pop();
        let message = decode_raw(&bytes, None).unwrap_err().to_string();
        assert!(message.contains("4456448 bytes") && message.ends_with("has 4456447 bytes"), "{message}");
        assert!(decode_raw(&bytes, Some(PixelFormat::Mono8)).is_err());
    }

    #[test]
    fn packed_raw_mosaics_are_told_by_their_length() {
        // Counts 0, 1, 2 .. of so many bits, lowest bits first, without gaps.
        let packed = |bits: usize| {
            let mut bytes = vec![0_u8; 2048 * 1088 * bits / 8];
            for index in 0..2048 * 1088 {
                for bit in 0..bits {
                    let place = index * bits + bit;
                    bytes[place / 8] |= ((index >> bit & 1) as u8) << (place % 8);
                }
            }
            bytes
        };

        for (bits, expected) in [(8, PixelFormat::Mono8), (10, PixelFormat::Mono10p), (12, PixelFormat::Mono12p)] {
            let (frame, format) = decode_raw(&packed(bits), None).unwrap();
            assert_eq!(format, expected);
            for index in [0, 1, 255, 256, 1023, 5000, 2048 * 1088 - 1] {
                let count = index & ((1 << bits) - 1);
                let ten = if bits == 8 { count << 2 | count >> 6 } else { count >> (bits - 10) };
                assert_eq!(usize::from(frame.samples()[index]), ten, "{bits} bit, sample {index}");
            }
        }
    }

    #[test]
    fn gray_pictures_of_eight_bit_may_be_mosaics() {
        let picture = |width, height| {
            let gray = image::ImageBuffer::from_pixel(width, height, image::Luma([255_u8]));
            encoded(&DynamicImage::ImageLuma8(gray), ImageFormat::Png)
        };
        let Picture::Mosaic(frame) = decode(&picture(2048, 1088), false).unwrap() else { panic!("a mosaic expected") };
        assert_eq!(frame.samples()[7], 1023);
        assert!(matches!(decode(&picture(64, 48), true), Ok(Picture::Mosaic(_))));
        assert!(matches!(decode(&picture(64, 48), false), Ok(Picture::Gray(_))));
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
        // An 8-bit picture made of them would be white.
        let floats = encoded(&floats, ImageFormat::Tiff);
        assert!(matches!(decode(&floats, false), Err(DecodeError::OtherPixels(_))));
    }
}
