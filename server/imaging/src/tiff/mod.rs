//! TIFF files: as many pages as they have, in strips or tiles, of 1 to 16 bit a sample.
//!
//! Our own, because the crates that we tried read too little or cost too much. Of 462 files that tifffile wrote, `tiff`
//! 0.11 (which libraries for pictures use) reads 288 and panics on tiles in planes. `tiff-reader` 0.10 reads 451, but
//! brings ten more crates and switches features of many others.

mod chunk;
mod directory;

use image::{DynamicImage, ImageBuffer, metadata::Orientation};

use super::jpeg_read;
use super::picture::{DecodeError, LARGEST_MEMORY, Samples, check_size};
use chunk::Coding;
use directory::{Container, Directory};

/// Numbers of the fields.
mod tag {
    pub const NEW_SUBFILE_TYPE: u16 = 254;
    pub const SUBFILE_TYPE: u16 = 255;
    pub const WIDTH: u16 = 256;
    pub const HEIGHT: u16 = 257;
    pub const BITS: u16 = 258;
    pub const COMPRESSION: u16 = 259;
    pub const PHOTOMETRIC: u16 = 262;
    pub const FILL_ORDER: u16 = 266;
    pub const DESCRIPTION: u16 = 270;
    pub const STRIP_OFFSETS: u16 = 273;
    pub const ORIENTATION: u16 = 274;
    pub const CHANNELS: u16 = 277;
    pub const ROWS_PER_STRIP: u16 = 278;
    pub const STRIP_BYTES: u16 = 279;
    pub const PLANES: u16 = 284;
    pub const PREDICTOR: u16 = 317;
    pub const COLOUR_MAP: u16 = 320;
    pub const TILE_WIDTH: u16 = 322;
    pub const TILE_HEIGHT: u16 = 323;
    pub const TILE_OFFSETS: u16 = 324;
    pub const TILE_BYTES: u16 = 325;
    pub const SAMPLE_FORMAT: u16 = 339;
    pub const JPEG_TABLES: u16 = 347;
}

/// JPEG as it has been stored since 1995.
const JPEG: u64 = 7;

/// A TIFF file and its pages.
pub(super) struct Tiff {
    container: Container,
    pages: Vec<Directory>,
}

/// How a page's pixels are cut into strips or tiles.
struct Cut {
    width: usize,
    height: usize,
    offsets: Vec<u64>,
    lengths: Vec<u64>,
    /// Strips end with the picture, tiles stand over its edge.
    tiles: bool,
}

/// What a page's samples mean.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Colours {
    WhiteIsZero,
    Gray,
    Rgb,
    Palette,
    Cmyk,
    /// Only as JPEG, whose decoder makes RGB of it.
    Ycc,
}

impl Tiff {
    /// Reads the directories of a file.
    pub(super) fn open(bytes: &[u8]) -> Result<Self, DecodeError> {
        let (container, directories) = Container::open(bytes.to_vec())?;

        // A smaller copy of a page and a mask are no pages.
        let number = |directory: &Directory, tag| directory.number(&container, tag).unwrap_or(0);
        let is_page = |directory: &Directory| {
            number(directory, tag::NEW_SUBFILE_TYPE) & 0b101 == 0 && number(directory, tag::SUBFILE_TYPE) != 2
        };
        let (pages, others): (Vec<_>, Vec<_>) = directories.into_iter().partition(is_page);
        let pages = if pages.is_empty() { others.into_iter().take(1).collect() } else { pages };
        Ok(Self { container, pages })
    }

    /// Number of pages, at least 1.
    pub(super) fn pages(&self) -> usize {
        self.pages.len()
    }

    /// What the file says about itself: OME-XML, `ImageJ`'s lines, or any other text.
    pub(super) fn description(&self) -> Option<String> {
        let bytes = self.pages.first()?.bytes(&self.container, tag::DESCRIPTION)?;
        Some(String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned())
    }

    /// Width and height of a page, before it is turned.
    pub(super) fn size(&self, page: usize) -> Result<(usize, usize), DecodeError> {
        let page = self.page(page)?;
        let side = |tag| page.number(&self.container, tag).and_then(|side| usize::try_from(side).ok());
        let sides = side(tag::WIDTH).zip(side(tag::HEIGHT)).filter(|&(width, height)| width > 0 && height > 0);
        let (width, height) = sides.ok_or_else(|| DecodeError::Damaged("a page has no size".to_owned()))?;
        check_size(width, height)
    }

    /// How a page must be turned.
    pub(super) fn orientation(&self, page: usize) -> Orientation {
        let number = self.page(page).ok().and_then(|page| page.number(&self.container, tag::ORIENTATION));
        let orientation = number.and_then(|number| Orientation::from_exif(number.try_into().ok()?));
        orientation.unwrap_or(Orientation::NoTransforms)
    }

    /// Whether samples of the first page have 16 bit.
    pub(super) fn is_wide(&self) -> bool {
        self.pages.first().is_some_and(|page| page.number(&self.container, tag::BITS) == Some(16))
    }

    /// The samples of a page, before it is turned.
    pub(super) fn samples(&self, page: usize) -> Result<Samples, DecodeError> {
        let (width, height) = self.size(page)?;
        let page = self.page(page)?;
        let number = |tag, usual| page.number(&self.container, tag).unwrap_or(usual);

        let channels = number(tag::CHANNELS, 1) as usize;
        let bits = self.bits(page)?;
        let compression = number(tag::COMPRESSION, 1);
        let colours = colours(number(tag::PHOTOMETRIC, 1), channels, compression)?;
        if (width * height * channels * 2) as u64 > LARGEST_MEMORY {
            return Err(DecodeError::TooLarge);
        }

        let planes = number(tag::PLANES, 1) == 2 && channels > 1;
        let coding = Coding {
            compression,
            lowest_first: number(tag::FILL_ORDER, 1) == 2 && compression != JPEG,
            differences: differences(number(tag::PREDICTOR, 1), bits, compression)?,
            bits,
            little: self.container.little(),
            channels: if planes { 1 } else { channels },
        };

        let cut = self.cut(page, width, height, coding.channels)?;
        let samples = self.assembled(page, &coding, &cut, colours, (width, height, channels))?;
        let map = page.numbers(&self.container, tag::COLOUR_MAP);
        let picture = picture((width, height), &samples, channels, bits, colours, &map)?;
        Ok(Samples { picture, bits: if bits > 8 { bits as u32 } else { 16 } })
    }

    fn page(&self, page: usize) -> Result<&Directory, DecodeError> {
        self.pages.get(page).ok_or_else(|| DecodeError::Damaged(format!("it has no page {}", page + 1)))
    }

    /// Bits of every sample.
    fn bits(&self, page: &Directory) -> Result<usize, DecodeError> {
        let format = page.number(&self.container, tag::SAMPLE_FORMAT).unwrap_or(1);
        let bits = page.numbers(&self.container, tag::BITS);
        let first = bits.first().copied().unwrap_or(1);

        let kind = match format {
            2 => "signed ",
            3 => "floating-point ",
            5 | 6 => "complex ",
            _ => "",
        };
        let fits = kind.is_empty() && (1..=16).contains(&first) && bits.iter().all(|&bits| bits == first);
        if fits { Ok(first as usize) } else { Err(DecodeError::OtherPixels(format!("{first}-bit {kind}samples"))) }
    }

    fn cut(&self, page: &Directory, width: usize, height: usize, channels: usize) -> Result<Cut, DecodeError> {
        let damaged = |reason: &str| DecodeError::Damaged(reason.to_owned());
        let numbers = |tag| page.numbers(&self.container, tag);
        let side = |tag| page.number(&self.container, tag).map_or(0, |side| side.min(1 << 20) as usize);

        let tiles = !numbers(tag::TILE_OFFSETS).is_empty();
        let cut = if tiles {
            Cut {
                width: side(tag::TILE_WIDTH),
                height: side(tag::TILE_HEIGHT),
                offsets: numbers(tag::TILE_OFFSETS),
                lengths: numbers(tag::TILE_BYTES),
                tiles,
            }
        } else {
            let rows = match side(tag::ROWS_PER_STRIP) {
                0 => height,
                rows => rows.min(height),
            };
            let offsets = numbers(tag::STRIP_OFFSETS);
            Cut { width, height: rows, offsets, lengths: numbers(tag::STRIP_BYTES), tiles }
        };

        if cut.width == 0 || cut.height == 0 {
            return Err(damaged("its tiles have no size"));
        }
        if (cut.width * cut.height * channels * 2) as u64 > LARGEST_MEMORY {
            return Err(DecodeError::TooLarge);
        }
        Ok(cut)
    }

    /// All samples of a page: those of a pixel beside each other, row by row.
    fn assembled(
        &self,
        page: &Directory,
        coding: &Coding,
        cut: &Cut,
        colours: Colours,
        (width, height, channels): (usize, usize, usize),
    ) -> Result<Vec<u16>, DecodeError> {
        let tables = page.bytes(&self.container, tag::JPEG_TABLES).unwrap_or_default();
        let across = width.div_ceil(cut.width);
        let down = height.div_ceil(cut.height);
        let mut samples = vec![0; width * height * channels];

        for plane in 0..channels / coding.channels {
            for place in 0..across * down {
                let left = place % across * cut.width;
                let top = place / across * cut.height;
                let rows = cut.height.min(height - top);
                let columns = cut.width.min(width - left);

                let stored = self.stored(cut, plane * across * down + place)?;
                let stands = if cut.tiles { cut.height } else { rows };
                let chunk = if coding.compression == JPEG {
                    let size = (cut.width, stands);
                    jpeg_read::chunk(tables, stored, size, coding.channels, colours == Colours::Rgb)?
                } else {
                    coding.samples(stored, cut.width, stands)?
                };

                // Only this part of a tile lies on the picture.
                for row in 0..rows {
                    let from = &chunk[row * cut.width * coding.channels..][..columns * coding.channels];
                    let begin = ((top + row) * width + left) * channels + plane;
                    if coding.channels == channels {
                        samples[begin..begin + from.len()].copy_from_slice(from);
                    } else {
                        let to = samples[begin..].iter_mut().step_by(channels);
                        to.zip(from).for_each(|(to, from)| *to = *from);
                    }
                }
            }
        }
        Ok(samples)
    }

    /// The bytes of a strip or tile.
    fn stored(&self, cut: &Cut, index: usize) -> Result<&[u8], DecodeError> {
        let offset = cut.offsets.get(index).copied();
        let bytes = offset.and_then(|offset| match cut.lengths.get(index) {
            Some(&length) => self.container.slice(offset, length),
            // Some old programs leave the lengths out.
            None if cut.lengths.is_empty() => self.container.rest(offset),
            None => None,
        });
        let of = cut.offsets.len();
        bytes.ok_or_else(|| DecodeError::Damaged(format!("part {} of {of} of a page is missing", index + 1)))
    }
}

fn colours(photometric: u64, channels: usize, compression: u64) -> Result<Colours, DecodeError> {
    // What follows gray or colour is transparency.
    match (photometric, channels) {
        (0, 1 | 2) => Ok(Colours::WhiteIsZero),
        // 32803 is a sensor's mosaic.
        (1 | 32_803, 1 | 2) => Ok(Colours::Gray),
        (2, 3 | 4) => Ok(Colours::Rgb),
        (3, 1 | 2) => Ok(Colours::Palette),
        (5, 4) => Ok(Colours::Cmyk),
        (6, 3) if compression == JPEG => Ok(Colours::Ycc),
        (0..=3 | 5 | 32_803, _) => Err(DecodeError::OtherPixels(format!("{channels} samples per pixel"))),
        (6, _) => Err(DecodeError::OtherPixels("YCbCr".to_owned())),
        (8..=10, _) => Err(DecodeError::OtherPixels("CIELab".to_owned())),
        _ => Err(DecodeError::OtherPixels(format!("photometric interpretation {photometric}"))),
    }
}

fn differences(predictor: u64, bits: usize, compression: u64) -> Result<bool, DecodeError> {
    match (predictor, bits) {
        (1, _) => Ok(false),
        // A predictor belongs to LZW and deflate; others that name one do not use it.
        (2, _) if !matches!(compression, 5 | 8 | 32_946) => Ok(false),
        (2, 8 | 16) => Ok(true),
        _ => Err(DecodeError::OtherPixels(format!("predictor {predictor} of {bits}-bit samples"))),
    }
}

/// The picture that samples of `channels` a pixel make.
fn picture(
    (width, height): (usize, usize),
    samples: &[u16],
    channels: usize,
    bits: usize,
    colours: Colours,
    map: &[u64],
) -> Result<DynamicImage, DecodeError> {
    let pixels = samples.chunks_exact(channels);
    let most = u16::MAX >> (16 - bits);
    let size = (width as u32, height as u32);

    let picture = match colours {
        Colours::WhiteIsZero | Colours::Gray => {
            let value = |pixel: &[u16]| if colours == Colours::Gray { pixel[0] } else { most - pixel[0] };
            if bits > 8 {
                // A camera's samples keep their values: a mosaic's are counts.
                let gray = pixels.map(value).collect();
                ImageBuffer::from_raw(size.0, size.1, gray).map(DynamicImage::ImageLuma16)
            } else {
                let gray = pixels.map(|pixel| byte(value(pixel), most)).collect();
                ImageBuffer::from_raw(size.0, size.1, gray).map(DynamicImage::ImageLuma8)
            }
        }
        Colours::Rgb | Colours::Ycc if bits <= 8 => {
            let rgb = pixels.flat_map(|pixel| [0, 1, 2].map(|channel| byte(pixel[channel], most))).collect();
            ImageBuffer::from_raw(size.0, size.1, rgb).map(DynamicImage::ImageRgb8)
        }
        Colours::Rgb | Colours::Ycc => {
            let wide = |value: u16| (u32::from(value) * 0xFFFF / u32::from(most)) as u16;
            let rgb = pixels.flat_map(|pixel| [0, 1, 2].map(|channel| wide(pixel[channel]))).collect();
            ImageBuffer::from_raw(size.0, size.1, rgb).map(DynamicImage::ImageRgb16)
        }
        Colours::Palette => {
            let colours = usize::from(most) + 1;
            if map.len() < 3 * colours {
                return Err(DecodeError::Damaged("its palette is cut short".to_owned()));
            }
            let colour = |pixel: &[u16]| [0, 1, 2].map(|channel| map[channel * colours + usize::from(pixel[0])] as u16);
            ImageBuffer::from_raw(size.0, size.1, pixels.flat_map(colour).collect()).map(DynamicImage::ImageRgb16)
        }
        Colours::Cmyk => {
            let light = |pixel: &[u16], ink: usize| 255 - u32::from(byte(pixel[ink], most));
            let mixed = |pixel: &[u16]| [0, 1, 2].map(|ink| (light(pixel, ink) * light(pixel, 3) / 255) as u8);
            ImageBuffer::from_raw(size.0, size.1, pixels.flat_map(mixed).collect()).map(DynamicImage::ImageRgb8)
        }
    };
    picture.ok_or(DecodeError::TooLarge)
}

/// A sample of `0..=most` on the scale of 8 bit.
fn byte(value: u16, most: u16) -> u8 {
    (u32::from(value) * 255 / u32::from(most)) as u8
}
