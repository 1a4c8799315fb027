//! A picture out of a file: its kinds, what may be wrong with it, and its samples on our scales.

use image::DynamicImage;
use image::metadata::Orientation;

use super::frame::{FrameError, GrayImage, MosaicFrame, RgbImage};
use super::luma::luma;
use super::pixels::PixelFormat;
use super::reconstruct::Reconstructor;

/// Width and height of the full sensor (IMEC CMV2K) in samples. Raw mosaics have this size.
pub const SENSOR_SIZE: (usize, usize) = (2048, 1088);

/// Longest side of a picture that is read, in pixels.
pub(super) const LARGEST_SIDE: u32 = 16_384;

/// Most memory that decoding one picture may take, in bytes.
pub(super) const LARGEST_MEMORY: u64 = 512 << 20;

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
    /// The decoder gave up in a way that it should not.
    #[error("damaged or not supported: its decoder failed")]
    Panicked,
    /// The file holds several pictures, and one is needed.
    #[error("holds {0} pictures, and a file of one is needed; save each as a file of its own")]
    Pages(usize),
    /// A mosaic with an EXIF orientation.
    #[error("a mosaic cannot be turned, but its EXIF orientation says so; save it without")]
    TurnedMosaic,
    /// An unsupported kind of pixel.
    #[error("cannot read pixels of this kind ({0}); convert it to 8 or 16 bit gray or RGB")]
    OtherPixels(String),
    /// The picture exceeds the limits on pixels or memory.
    #[error("too large: the limit is {LARGEST_SIDE} pixels per side and {} MiB", LARGEST_MEMORY >> 20)]
    TooLarge,
    /// A mosaic was asked for, but the picture is colour or has transparency.
    #[error("a mosaic is a gray picture, not {0}")]
    NotAMosaic(&'static str),
    /// A mosaic whose sides are not multiples of 4.
    #[error(transparent)]
    MosaicSize(#[from] FrameError),
    /// A raw mosaic of another length than the sensor's, or with counts that its format cannot have.
    #[error("{0}")]
    Raw(String),
}

/// Width and height that may be decoded.
pub(super) fn check_size(width: usize, height: usize) -> Result<(usize, usize), DecodeError> {
    let side = LARGEST_SIDE as usize;
    // No format takes more than four samples of two bytes for a pixel.
    let fits = width <= side && height <= side && (8 * width * height) as u64 <= 2 * LARGEST_MEMORY;
    if fits { Ok((width, height)) } else { Err(DecodeError::TooLarge) }
}

/// A picture as its file holds it.
pub(super) struct Samples {
    pub(super) picture: DynamicImage,
    /// Bits of the samples of a 16-bit picture. White is the greatest number of so many bits.
    pub(super) bits: u32,
}

impl Samples {
    /// The picture turned and on our scales.
    pub(super) fn into_picture(self, mosaic: bool, turn: Orientation) -> Result<Picture, DecodeError> {
        let size = (self.picture.width() as usize, self.picture.height() as usize);
        let gray = matches!(self.picture, DynamicImage::ImageLuma8(_) | DynamicImage::ImageLuma16(_));
        let mosaic_by_size = gray && size == SENSOR_SIZE;
        // White in 16 bit, for each level of the 0..255 scale.
        let per_level = f32::from(self.white()) / 255.0;
        let mut picture = self.picture;

        if mosaic || mosaic_by_size {
            let counts = match picture {
                DynamicImage::ImageLuma16(samples) => {
                    samples.into_raw().into_iter().map(|count| ten_bit(count, self.bits)).collect()
                }
                DynamicImage::ImageLuma8(samples) => {
                    let mut counts = vec![0; samples.len()];
                    PixelFormat::Mono8.unpack(samples.as_raw(), &mut counts);
                    counts
                }
                DynamicImage::ImageLumaA8(_) | DynamicImage::ImageLumaA16(_) => {
                    return Err(DecodeError::NotAMosaic("one with transparency"));
                }
                _ => return Err(DecodeError::NotAMosaic("a colour one")),
            };
            if turn != Orientation::NoTransforms {
                return Err(DecodeError::TurnedMosaic);
            }
            return Ok(Picture::Mosaic(MosaicFrame::new(size.0, size.1, counts)?));
        }

        picture.apply_orientation(turn);
        let width = picture.width() as usize;
        let height = picture.height() as usize;
        match picture {
            DynamicImage::ImageLuma8(_) | DynamicImage::ImageLumaA8(_) => {
                let data = picture.into_luma8().into_raw().into_iter().map(f32::from).collect();
                Ok(Picture::Gray(GrayImage { width, height, data }))
            }
            DynamicImage::ImageLuma16(_) | DynamicImage::ImageLumaA16(_) => {
                let levels = picture.into_luma16().into_raw().into_iter().map(|value| f32::from(value) / per_level);
                let data = levels.collect();
                Ok(Picture::Gray(GrayImage { width, height, data }))
            }
            DynamicImage::ImageRgb8(_) | DynamicImage::ImageRgba8(_) => {
                let data = picture.into_rgb8().into_raw();
                let gray = data.as_chunks::<3>().0.iter().map(|pixel| luma(pixel.map(f32::from))).collect();
                Ok(Picture::Rgb(RgbImage { width, height, data }, GrayImage { width, height, data: gray }))
            }
            DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
                let wide = picture.to_rgb16().into_raw();
                let level = |value: u16| f32::from(value) / per_level;
                let gray = wide.as_chunks::<3>().0.iter().map(|pixel| luma(pixel.map(level))).collect();
                let data = Self { picture, bits: self.bits }.scaled().into_rgb8().into_raw();
                Ok(Picture::Rgb(RgbImage { width, height, data }, GrayImage { width, height, data: gray }))
            }
            other => Err(DecodeError::OtherPixels(format!("{:?}", other.color()))),
        }
    }

    /// The picture with white at the greatest value that its type has.
    pub(super) fn scaled(self) -> DynamicImage {
        let white = u32::from(self.white());
        let mut picture = self.picture;
        if white == 0xFFFF {
            return picture;
        }

        let scale = |sample: &mut u16| {
            *sample = ((u32::from(*sample) * 0xFFFF + white / 2) / white).min(0xFFFF) as u16;
        };
        match &mut picture {
            DynamicImage::ImageLuma16(samples) => samples.iter_mut().for_each(scale),
            DynamicImage::ImageLumaA16(samples) => samples.iter_mut().for_each(scale),
            DynamicImage::ImageRgb16(samples) => samples.iter_mut().for_each(scale),
            DynamicImage::ImageRgba16(samples) => samples.iter_mut().for_each(scale),
            _ => {}
        }
        picture
    }

    fn white(&self) -> u16 {
        u16::MAX >> 16_u32.saturating_sub(self.bits).min(15)
    }
}

/// A count on the scale of 10 bit, if its file says how many bits it has. What fills 16 bit is taken as it is.
fn ten_bit(count: u16, bits: u32) -> u16 {
    match bits {
        9 => count << 1 | count >> 8,
        11..=15 => count >> (bits - 10),
        _ => count,
    }
}
