//! TIFF files: as many pages as they have, in strips or tiles, of 1 to 16 bit a sample.
//!
//! The crate `tiff-reader` reads them. Of 990 files that tifffile wrote, it read all as tifffile does but 9, which are of
//! other compressions or no whole numbers of 8 or 16 bit. 80,000 files with random damage made it neither panic nor take
//! more memory than it was given. (`read_image` of the crate `tiff`, which libraries for pictures use, read 688.)

mod colours;

use image::DynamicImage;
use image::metadata::Orientation;
use tiff_reader::{Ifd, OpenOptions, ParseBudgets, TagValue, TiffError, TiffFile};

use super::jpeg_read;
use super::picture::{DecodeError, LARGEST_MEMORY, SENSOR_SIZE, Samples, check_size};
use colours::{Colours, JPEG};

/// Numbers of the fields that `tiff-reader` does not name.
mod tag {
    pub const NEW_SUBFILE_TYPE: u16 = 254;
    pub const SUBFILE_TYPE: u16 = 255;
    pub const DESCRIPTION: u16 = 270;
    pub const ORIENTATION: u16 = 274;
    pub const COLOUR_MAP: u16 = 320;
    pub const JPEG_TABLES: u16 = 347;
}

/// What the directories of a file may hold. More is taken for damaged.
const BUDGETS: ParseBudgets = ParseBudgets {
    max_ifds: 65_536,
    max_ifd_entries: 4096,
    max_tag_value_bytes: 64 << 20,
    max_metadata_value_bytes: 256 << 20,
};

/// A TIFF file and its pages.
pub(super) struct Tiff {
    file: TiffFile,
    /// Places of the pages among the file's directories.
    pages: Vec<usize>,
}

impl Tiff {
    /// Reads the directories of a file.
    pub(super) fn open(bytes: &[u8]) -> Result<Self, DecodeError> {
        let options = OpenOptions {
            // A page is read once.
            block_cache_bytes: 0,
            block_cache_slots: 0,
            parse_budgets: BUDGETS,
            decode_output_bytes: LARGEST_MEMORY as usize,
        };
        let file = TiffFile::from_bytes_with_options(bytes.to_vec(), options).map_err(refused)?;
        if file.ifd_count() == 0 {
            return Err(DecodeError::Damaged("it holds no picture".to_owned()));
        }

        // A smaller copy of a page and a mask are no pages.
        let is_page = |ifd: &Ifd| {
            number(ifd, tag::NEW_SUBFILE_TYPE).unwrap_or(0) & 0b101 == 0 && number(ifd, tag::SUBFILE_TYPE) != Some(2)
        };
        let mut pages: Vec<usize> = (0..file.ifd_count()).filter(|&index| is_page(&file.ifds()[index])).collect();
        if pages.is_empty() {
            pages.push(0);
        }
        Ok(Self { file, pages })
    }

    /// Number of pages, at least 1.
    pub(super) fn pages(&self) -> usize {
        self.pages.len()
    }

    /// What the file says about itself: OME-XML, ImageJ's lines, or any other text.
    pub(super) fn description(&self) -> Option<String> {
        match &self.page(0).ok()?.tag(tag::DESCRIPTION)?.value {
            TagValue::Ascii(text) => Some(text.clone()),
            TagValue::Byte(bytes) | TagValue::Undefined(bytes) => {
                Some(String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned())
            }
            _ => None,
        }
    }

    /// Width and height of a page, before it is turned.
    pub(super) fn size(&self, page: usize) -> Result<(usize, usize), DecodeError> {
        let page = self.page(page)?;
        if page.width() == 0 || page.height() == 0 {
            return Err(DecodeError::Damaged("a page has no size".to_owned()));
        }
        check_size(page.width() as usize, page.height() as usize)
    }

    /// How a page must be turned.
    pub(super) fn orientation(&self, page: usize) -> Orientation {
        let number = self.page(page).ok().and_then(|page| number(page, tag::ORIENTATION));
        let orientation = number.and_then(|number| Orientation::from_exif(number.try_into().ok()?));
        orientation.unwrap_or(Orientation::NoTransforms)
    }

    /// Whether samples of the first page have 16 bit and are no mosaic's.
    pub(super) fn is_wide(&self) -> bool {
        let Ok(page) = self.page(0) else { return false };
        let bits = page.bits_per_sample().unwrap_or_default();
        let colours = Colours::of(page, usize::from(page.samples_per_pixel()));
        let is_gray = matches!(colours, Ok(Colours::Gray | Colours::WhiteIsZero));
        let is_mosaic = is_gray && (page.width() as usize, page.height() as usize) == SENSOR_SIZE;
        bits.first() == Some(&16) && !is_mosaic
    }

    /// The samples of a page, before it is turned.
    pub(super) fn samples(&self, page: usize) -> Result<Samples, DecodeError> {
        let (width, height) = self.size(page)?;
        let page = self.page(page)?;

        let bits = bits(page)?;
        let channels = usize::from(page.samples_per_pixel());
        let compression = page.compression();
        let colours = Colours::of(page, channels)?;
        check_coding(page, bits)?;
        if (width * height * channels * 2) as u64 > LARGEST_MEMORY {
            return Err(DecodeError::TooLarge);
        }
        self.check_parts(page, compression == JPEG)?;

        let bytes = self.file.read_image_bytes_from_ifd(page).map_err(refused)?;
        let samples = if bits > 8 {
            bytes.as_chunks().0.iter().map(|&pair| u16::from_ne_bytes(pair)).collect()
        } else {
            bytes.into_iter().map(u16::from).collect::<Vec<_>>()
        };

        let map = match page.tag(tag::COLOUR_MAP).map(|tag| &tag.value) {
            Some(TagValue::Short(map)) => map.as_slice(),
            _ => &[],
        };
        let picture = colours.picture((width, height), &samples, channels, bits, map)?;
        // Colours fill 16 bit already.
        let bits = if matches!(picture, DynamicImage::ImageLuma16(_)) { bits as u32 } else { 16 };
        Ok(Samples { picture, bits })
    }

    fn page(&self, page: usize) -> Result<&Ifd, DecodeError> {
        let missing = || DecodeError::Damaged(format!("it has no page {}", page + 1));
        let &index = self.pages.get(page).ok_or_else(missing)?;
        self.file.ifd(index).map_err(refused)
    }

    /// Refuses a page with a strip or tile that the file does not have: `tiff-reader` would fill it with zeros. And a
    /// damaged JPEG: its decoder would fill the hole, but libjpeg notices.
    fn check_parts(&self, page: &Ifd, jpeg: bool) -> Result<(), DecodeError> {
        let (offsets, lengths) = if page.is_tiled() {
            (page.tile_offsets(), page.tile_byte_counts())
        } else {
            (page.strip_offsets(), page.strip_byte_counts())
        };
        let offsets = offsets.unwrap_or_default();
        let lengths = lengths.unwrap_or_default();
        let tables = match page.tag(tag::JPEG_TABLES).map(|tag| &tag.value) {
            Some(TagValue::Undefined(tables) | TagValue::Byte(tables)) => tables.as_slice(),
            _ => &[],
        };

        let file = self.file.raw_bytes().unwrap_or_default();
        for (index, (&offset, &length)) in offsets.iter().zip(&lengths).enumerate() {
            let end = offset.saturating_add(length);
            let stored = usize::try_from(offset).ok().zip(usize::try_from(end).ok());
            let stored = stored.filter(|_| offset > 0 && length > 0).and_then(|(begin, end)| file.get(begin..end));

            let of = offsets.len();
            let missing = || DecodeError::Damaged(format!("part {} of {of} of a page is missing", index + 1));
            let stored = stored.ok_or_else(missing)?;
            if jpeg {
                jpeg_read::check_part(tables, stored)?;
            }
        }
        Ok(())
    }
}

/// The first whole number of a field.
fn number(page: &Ifd, tag: u16) -> Option<u64> {
    page.tag(tag)?.value.as_u64_vec()?.first().copied()
}

/// Bits of every sample.
fn bits(page: &Ifd) -> Result<usize, DecodeError> {
    let format = page.sample_format().map_err(refused)?.first().copied().unwrap_or(1);
    let bits = page.bits_per_sample().map_err(refused)?;
    let first = bits.first().copied().unwrap_or(1);

    let kind = match format {
        2 => "signed ",
        3 => "floating-point ",
        5 | 6 => "complex ",
        _ => "",
    };
    let fits = kind.is_empty() && (1..=16).contains(&first) && bits.iter().all(|&bits| bits == first);
    if fits { Ok(usize::from(first)) } else { Err(DecodeError::OtherPixels(format!("{first}-bit {kind}samples"))) }
}

/// Refuses compressions and predictors that are not read, by their names.
fn check_coding(page: &Ifd, bits: usize) -> Result<(), DecodeError> {
    const PLAIN: u16 = 1;
    const LZW: u16 = 5;
    const DEFLATE: [u16; 2] = [8, 32_946];
    const PACK_BITS: u16 = 32_773;
    let compression = page.compression();
    let predictor = page.predictor();

    let other = match compression {
        PLAIN | LZW | JPEG | PACK_BITS => None,
        deflate if DEFLATE.contains(&deflate) => None,
        2..=4 => Some("CCITT (fax)".to_owned()),
        6 => Some("JPEG of before 1995".to_owned()),
        34_712 | 33_003..=33_005 => Some("JPEG 2000".to_owned()),
        34_887 => Some("LERC".to_owned()),
        34_925 => Some("LZMA".to_owned()),
        50_000 | 34_926 => Some("Zstandard".to_owned()),
        50_001 | 34_927 => Some("WebP".to_owned()),
        number => Some(format!("number {number}")),
    };
    if let Some(name) = other {
        return Err(DecodeError::OtherPixels(format!("compression {name}")));
    }

    // A predictor belongs to LZW and deflate. Elsewhere some readers apply it and others do not.
    let read = match predictor {
        1 => true,
        2 => matches!(bits, 8 | 16) && (compression == LZW || DEFLATE.contains(&compression)),
        _ => false,
    };
    if read { Ok(()) } else { Err(DecodeError::OtherPixels(format!("predictor {predictor} of {bits}-bit samples"))) }
}

fn refused(error: TiffError) -> DecodeError {
    match error {
        TiffError::DecodeOutputTooLarge { .. } | TiffError::DecodeOutputAllocationFailed { .. } => {
            DecodeError::TooLarge
        }
        error => DecodeError::Damaged(error.to_string()),
    }
}
