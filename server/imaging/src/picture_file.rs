//! A file with one picture or several: what it holds, and each picture as it is meant to be seen.

use std::cell::Cell;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::jpeg_read;
use super::picture::{DecodeError, LARGEST_MEMORY, LARGEST_SIDE, Picture, SENSOR_SIZE, Samples, check_size};
use super::tiff::Tiff;

/// A PNG, JPEG or TIFF file.
pub struct PictureFile<'a> {
    contents: Contents<'a>,
    /// Bits of samples that fill 16, as far as the file does not say it.
    wide_bits: u8,
}

enum Contents<'a> {
    Png(&'a [u8]),
    Jpeg(&'a [u8]),
    Tiff(Box<Tiff>),
}

impl<'a> PictureFile<'a> {
    /// Looks into the bytes of a file. They decide on the format, because a name may be wrong.
    ///
    /// # Errors
    /// If they do not begin like a picture, or a TIFF's directories are damaged.
    pub fn open(bytes: &'a [u8]) -> Result<Self, DecodeError> {
        if bytes.is_empty() {
            return Err(DecodeError::Empty);
        }

        let big_tiff = bytes.starts_with(b"II\x2B\0") || bytes.starts_with(b"MM\0\x2B");
        let guessed = if big_tiff { Ok(ImageFormat::Tiff) } else { image::guess_format(bytes) };

        let contents = match guessed.map_err(|_| DecodeError::NotAPicture)? {
            ImageFormat::Png => Contents::Png(bytes),
            ImageFormat::Jpeg => Contents::Jpeg(bytes),
            ImageFormat::Tiff => Contents::Tiff(Box::new(guarded(|| Tiff::open(bytes))?)),
            other => {
                let name = other.extensions_str().first().copied().unwrap_or("these");
                return Err(DecodeError::OtherFormat(name));
            }
        };
        Ok(Self { contents, wide_bits: 16 })
    }

    /// The same file, but samples that [fill 16 bit](Self::is_wide) are read as numbers of `bits` bits: white is the
    /// greatest of these.
    #[must_use]
    pub fn with_bits(self, bits: u8) -> Self {
        Self { wide_bits: bits, ..self }
    }

    /// Number of pictures: pages of a TIFF, frames of an animated PNG, else 1.
    pub fn pages(&self) -> usize {
        match &self.contents {
            Contents::Png(bytes) => frames(bytes),
            Contents::Jpeg(_) => 1,
            Contents::Tiff(tiff) => tiff.pages(),
        }
    }

    /// The file itself, if it holds one picture.
    ///
    /// # Errors
    /// If it holds several.
    pub fn single(self) -> Result<Self, DecodeError> {
        match self.pages() {
            1 => Ok(self),
            pages => Err(DecodeError::Pages(pages)),
        }
    }

    /// What a TIFF says about its pages: OME-XML, ImageJ's lines, or any other text.
    pub fn description(&self) -> Option<String> {
        match &self.contents {
            Contents::Tiff(tiff) => tiff.description(),
            _ => None,
        }
    }

    /// Width and height of a picture, from 0, as it is meant to be seen. Its pixels are not decoded.
    ///
    /// # Errors
    /// If there is no such picture, or its header is damaged.
    pub fn size(&self, page: usize) -> Result<(usize, usize), DecodeError> {
        let (width, height) = guarded(|| match &self.contents {
            Contents::Png(bytes) => {
                let (width, height) = png(bytes)?.dimensions();
                check_size(width as usize, height as usize)
            }
            Contents::Jpeg(bytes) => jpeg_read::size(bytes),
            Contents::Tiff(tiff) => tiff.size(page),
        })?;

        let sideways = matches!(
            self.orientation(page),
            Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH
        );
        Ok(if sideways { (height, width) } else { (width, height) })
    }

    /// Reads a picture, from 0: 8 or 16 bit, gray or RGB; transparency is left out. EXIF's orientation is applied.
    ///
    /// A gray picture of the sensor's full size is a mosaic. With `mosaic`, one of any size is read
    /// as one, and its sides must be multiples of 4.
    ///
    /// # Errors
    /// If there is no such picture, or it is damaged, too large, or of another kind.
    pub fn read(&self, page: usize, mosaic: bool) -> Result<Picture, DecodeError> {
        let samples = self.samples(page)?;
        let turn = self.orientation(page);
        samples.into_picture(mosaic, turn)
    }

    /// Reads a picture as [`Self::read`] does, but leaves mosaics as they are.
    ///
    /// # Errors
    /// If there is no such picture, or it is damaged, too large, or of another kind.
    pub fn read_any(&self, page: usize) -> Result<DynamicImage, DecodeError> {
        let mut picture = self.samples(page)?.scaled();
        picture.apply_orientation(self.orientation(page));
        Ok(picture)
    }

    /// Whether the samples of the first picture fill 16 bit, and nothing says how many bits they were taken with. Of a
    /// mosaic its calibration says it.
    pub fn is_wide(&self) -> bool {
        let wide = guarded(|| {
            Ok(match &self.contents {
                Contents::Png(bytes) => {
                    let png = png(bytes)?;
                    let colour = png.color_type();
                    let (width, height) = png.dimensions();
                    let is_mosaic = colour == ColorType::L16 && (width as usize, height as usize) == SENSOR_SIZE;
                    colour.bytes_per_pixel() == 2 * colour.channel_count() && !is_mosaic
                }
                Contents::Jpeg(_) => false,
                Contents::Tiff(tiff) => tiff.is_wide(),
            })
        });
        wide.unwrap_or(false)
    }

    /// The largest sample of a picture, from 0, on the scale on which it is stored.
    ///
    /// # Errors
    /// If there is no such picture, or it is damaged.
    pub fn largest_sample(&self, page: usize) -> Result<u16, DecodeError> {
        let picture = self.samples(page)?.picture;
        Ok(match picture {
            DynamicImage::ImageLuma16(samples) => samples.iter().copied().max(),
            DynamicImage::ImageRgb16(samples) => samples.iter().copied().max(),
            other => other.into_rgb16().iter().copied().max(),
        }
        .unwrap_or(0))
    }

    fn orientation(&self, page: usize) -> Orientation {
        let orientation = guarded(|| {
            Ok(match &self.contents {
                Contents::Png(bytes) => png(bytes)?.orientation().unwrap_or(Orientation::NoTransforms),
                Contents::Jpeg(bytes) => jpeg_read::orientation(bytes),
                Contents::Tiff(tiff) => tiff.orientation(page),
            })
        });
        orientation.unwrap_or(Orientation::NoTransforms)
    }

    fn samples(&self, page: usize) -> Result<Samples, DecodeError> {
        let whole = |picture| Ok(Samples { picture, bits: 16 });
        let mut samples = guarded(|| match &self.contents {
            Contents::Png(bytes) => whole(DynamicImage::from_decoder(png(bytes)?).map_err(refused)?),
            Contents::Jpeg(bytes) => whole(jpeg_read::read(bytes)?),
            Contents::Tiff(tiff) => tiff.samples(page),
        })?;

        if self.wide_bits < 16 && self.is_wide() {
            samples.bits = self.wide_bits.into();
        }
        Ok(samples)
    }
}

/// A decoder of a PNG.
fn png(bytes: &[u8]) -> Result<impl ImageDecoder, DecodeError> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(LARGEST_MEMORY);

    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    reader.limits(limits);
    reader.into_decoder().map_err(refused)
}

fn refused(error: ImageError) -> DecodeError {
    match error {
        ImageError::Limits(_) => DecodeError::TooLarge,
        ImageError::Unsupported(error) => DecodeError::OtherPixels(error.to_string()),
        error => DecodeError::Damaged(error.to_string()),
    }
}

/// Frames of a PNG: those of an animation, which stand in its `acTL` chunk before the picture, else 1.
fn frames(bytes: &[u8]) -> usize {
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        let length = u32::from_be_bytes(*length) as usize;
        match after {
            [b'a', b'c', b'T', b'L', a, b, c, d, ..] => return (u32::from_be_bytes([*a, *b, *c, *d]) as usize).max(1),
            [b'I', b'D', b'A', b'T', ..] => return 1,
            // The chunk's name, its data and a checksum.
            _ => rest = after.get(length.saturating_add(8)..).unwrap_or_default(),
        }
    }
    1
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder that is not ours. If it panics, the file is refused and nothing is printed.
fn guarded<T>(decode: impl FnOnce() -> Result<T, DecodeError>) -> Result<T, DecodeError> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                usual(panic);
            }
        }));
    });

    let outer = GUARDED.replace(true);
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(outer);
    decoded.unwrap_or(Err(DecodeError::Panicked))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decoder_that_panics_is_an_error() {
        let refused = guarded(|| -> Result<(), DecodeError> { panic!("a fault of a decoder") });
        assert_eq!(refused.unwrap_err().to_string(), "damaged or not supported: its decoder failed");
    }

    #[test]
    fn frames_of_an_animated_png_are_counted() {
        let plain = b"\x89PNG\r\n\x1a\n\0\0\0\x01IHDR!crc!\0\0\0\0IDATcrc!";
        assert_eq!(frames(plain), 1);
        let animated = b"\x89PNG\r\n\x1a\n\0\0\0\x01IHDR!crc!\0\0\0\x08acTL\0\0\0\x07\0\0\0\0crc!\0\0\0\0IDATcrc!";
        assert_eq!(frames(animated), 7);
        assert_eq!(frames(b"\x89PNG\r\n\x1a\n\xFF\xFF\xFF\xFFIHDR"), 1);
    }
}
