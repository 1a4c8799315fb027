//! Pictures and mosaics as files that lose nothing: PNG and TIFF.

use std::io::Cursor;

use image::error::{ParameterError, ParameterErrorKind};
use image::{EncodableLayout, ImageBuffer, ImageError, ImageFormat, ImageResult, Luma, PixelWithColorType, Rgb};

use super::frame::{MosaicFrame, RgbImage};

/// `picture` as a PNG file.
///
/// # Errors
/// If it has no pixels, or its data do not match its size.
pub fn encode_png(picture: &RgbImage) -> Result<Vec<u8>, ImageError> {
    let &RgbImage { width, height, ref data } = picture;
    encoded::<Rgb<u8>>(width, height, data, ImageFormat::Png)
}

/// The counts of `mosaic` as a TIFF file of 16 bit.
///
/// # Errors
/// If they are more than a TIFF file can hold.
pub fn encode_tiff(mosaic: &MosaicFrame) -> Result<Vec<u8>, ImageError> {
    encoded::<Luma<u16>>(mosaic.width(), mosaic.height(), mosaic.samples(), ImageFormat::Tiff)
}

fn encoded<P>(width: usize, height: usize, samples: &[P::Subpixel], format: ImageFormat) -> ImageResult<Vec<u8>>
where
    P: PixelWithColorType,
    [P::Subpixel]: EncodableLayout,
{
    let mismatch = || ImageError::Parameter(ParameterError::from_kind(ParameterErrorKind::DimensionMismatch));
    let size = u32::try_from(width).ok().zip(u32::try_from(height).ok());
    let image = size.and_then(|(width, height)| ImageBuffer::<P, _>::from_raw(width, height, samples));

    let mut bytes = Cursor::new(Vec::new());
    image.ok_or_else(mismatch)?.write_to(&mut bytes, format)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_and_a_tiff_have_the_pixels_that_they_were_made_from() {
        let data: Vec<u8> = (0..5 * 3 * 3).map(|value| (value * 7 % 251) as u8).collect();
        let picture = RgbImage { width: 5, height: 3, data: data.clone() };
        let read = image::load_from_memory_with_format(&encode_png(&picture).unwrap(), ImageFormat::Png).unwrap();
        assert_eq!((read.width(), read.height()), (5, 3));
        assert_eq!(read.into_rgb8().into_raw(), data);

        let counts: Vec<u16> = (0..64 * 32).map(|value| value * 31 % 1023).collect();
        let mosaic = MosaicFrame::new(64, 32, counts.clone()).unwrap();
        let read = image::load_from_memory_with_format(&encode_tiff(&mosaic).unwrap(), ImageFormat::Tiff).unwrap();
        assert_eq!(read.into_luma16().into_raw(), counts);
    }

    #[test]
    fn a_picture_whose_data_do_not_match_its_size_is_refused() {
        assert!(encode_png(&RgbImage { width: 5, height: 3, data: vec![0; 44] }).is_err());
        assert!(encode_png(&RgbImage::default()).is_err());
    }
}
