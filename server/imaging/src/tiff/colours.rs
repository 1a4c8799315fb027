//! What the samples of a TIFF page mean, and the picture that they make.

use image::{DynamicImage, ImageBuffer};
use tiff_reader::Ifd;

use super::super::picture::DecodeError;

/// The compression JPEG, as it has been stored since 1995.
pub(super) const JPEG: u16 = 7;

/// What a page's samples mean.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Colours {
    WhiteIsZero,
    Gray,
    Rgb,
    Palette,
    Cmyk,
}

impl Colours {
    /// Those of a page with `channels` samples a pixel.
    pub(super) fn of(page: &Ifd, channels: usize) -> Result<Self, DecodeError> {
        let photometric = page.photometric_interpretation().unwrap_or(1);
        // What follows gray or colour is transparency.
        match (photometric, channels) {
            (0, 1 | 2) => Ok(Self::WhiteIsZero),
            (1, 1 | 2) => Ok(Self::Gray),
            (2, 3 | 4) => Ok(Self::Rgb),
            (3, 1 | 2) => Ok(Self::Palette),
            (5, 4) => Ok(Self::Cmyk),
            // The decoder of JPEG makes RGB of it.
            (6, 3) if page.compression() == JPEG => Ok(Self::Rgb),
            (0..=3 | 5, _) => Err(DecodeError::OtherPixels(format!("{channels} samples per pixel"))),
            (6, _) => Err(DecodeError::OtherPixels("YCbCr".to_owned())),
            (8..=10, _) => Err(DecodeError::OtherPixels("CIELab".to_owned())),
            (32_803, _) => Err(DecodeError::OtherPixels("a mosaic that is not marked as gray".to_owned())),
            _ => Err(DecodeError::OtherPixels(format!("photometric interpretation {photometric}"))),
        }
    }

    /// The picture that samples of `channels` a pixel make.
    pub(super) fn picture(
        self,
        (width, height): (usize, usize),
        samples: &[u16],
        channels: usize,
        bits: usize,
        map: &[u16],
    ) -> Result<DynamicImage, DecodeError> {
        let pixels = samples.chunks_exact(channels);
        let most = u16::MAX >> (16 - bits);
        let size = (width as u32, height as u32);

        let picture = match self {
            Self::WhiteIsZero | Self::Gray => {
                let value = |pixel: &[u16]| if self == Self::Gray { pixel[0] } else { most - pixel[0] };
                if bits > 8 {
                    // A camera's samples keep their values: a mosaic's are counts.
                    let gray = pixels.map(value).collect();
                    ImageBuffer::from_raw(size.0, size.1, gray).map(DynamicImage::ImageLuma16)
                } else {
                    let gray = pixels.map(|pixel| byte(value(pixel), most)).collect();
                    ImageBuffer::from_raw(size.0, size.1, gray).map(DynamicImage::ImageLuma8)
                }
            }
            Self::Rgb if bits <= 8 => {
                let rgb = pixels.flat_map(|pixel| [0, 1, 2].map(|channel| byte(pixel[channel], most))).collect();
                ImageBuffer::from_raw(size.0, size.1, rgb).map(DynamicImage::ImageRgb8)
            }
            Self::Rgb => {
                let wide = |value: u16| (u32::from(value) * 0xFFFF / u32::from(most)) as u16;
                let rgb = pixels.flat_map(|pixel| [0, 1, 2].map(|channel| wide(pixel[channel]))).collect();
                ImageBuffer::from_raw(size.0, size.1, rgb).map(DynamicImage::ImageRgb16)
            }
            Self::Palette => {
                let colours = usize::from(most) + 1;
                if map.len() < 3 * colours {
                    return Err(DecodeError::Damaged("its palette is cut short".to_owned()));
                }
                let colour = |pixel: &[u16]| [0, 1, 2].map(|channel| map[channel * colours + usize::from(pixel[0])]);
                let rgb = pixels.flat_map(colour).collect();
                ImageBuffer::from_raw(size.0, size.1, rgb).map(DynamicImage::ImageRgb16)
            }
            Self::Cmyk => {
                let light = |pixel: &[u16], ink: usize| 255 - u32::from(byte(pixel[ink], most));
                let mixed = |pixel: &[u16]| [0, 1, 2].map(|ink| (light(pixel, ink) * light(pixel, 3) / 255) as u8);
                ImageBuffer::from_raw(size.0, size.1, pixels.flat_map(mixed).collect()).map(DynamicImage::ImageRgb8)
            }
        };
        picture.ok_or(DecodeError::TooLarge)
    }
}

/// A sample of `0..=most` on the scale of 8 bit.
fn byte(value: u16, most: u16) -> u8 {
    (u32::from(value) * 255 / u32::from(most)) as u8
}
