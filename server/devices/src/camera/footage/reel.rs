//! The pictures of a footage camera over time: a video, or stills one after another.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::clip::Clip;
use super::files::{is_picture, is_raw, picture_head, pictures_in, tell_unread};
use super::video::{FootageError, HEIGHT, WIDTH, large_enough};
use super::wide::sample_bits;
use parfocal_imaging::{PictureFile, RgbImage, is_mosaic};

/// Why a mosaic is no footage: its colours would have to be marked as estimated, which footage's are not.
const MOSAIC: &str = "it is a sensor's mosaic: look at it with `parfocal inspect`, or import it as part of a scan";
/// Time for which a still is shown.
const STILL: Duration = Duration::from_secs(5);

/// The source of the pictures.
pub(super) enum Reel {
    /// A video.
    Video(Clip),
    /// Stills.
    Stills(Stills),
}

impl Reel {
    /// Opens a video, an image, or a folder of images.
    pub(super) fn open(path: &Path) -> Result<Self, FootageError> {
        let metadata = std::fs::metadata(path).map_err(|error| FootageError::unreadable(path, error))?;
        if metadata.is_dir() {
            return Stills::open(path, pictures_in(path)?).map(Self::Stills);
        }
        if is_raw(path) {
            return Err(FootageError::unreadable(path, MOSAIC));
        }
        if is_picture(path) {
            return Stills::open(path, vec![path.to_owned()]).map(Self::Stills);
        }
        Clip::open(path).map(Self::Video)
    }

    /// The picture at `time` after the start; times must be asked for in rising order.
    pub(super) fn at(&mut self, time: Duration) -> Result<&RgbImage, FootageError> {
        match self {
            Self::Video(video) => Ok(video.at(time)),
            Self::Stills(stills) => stills.at(time),
        }
    }
}

/// Stills, each shown for a while, over and over.
pub(super) struct Stills {
    files: Vec<PathBuf>,
    /// Bits of samples that fill 16.
    bits: u8,
    shown: usize,
    picture: RgbImage,
}

impl Stills {
    /// The pictures in `files`, all of `folder`.
    fn open(folder: &Path, files: Vec<PathBuf>) -> Result<Self, FootageError> {
        for file in &files {
            let head = picture_head(file).map_err(|error| FootageError::unreadable(file, error))?;
            let opened = PictureFile::open(&head).and_then(|opened| Ok((opened.size(0)?, opened.pages())));
            let ((width, height), pages) = opened.map_err(|error| FootageError::unreadable(file, error))?;
            large_enough(file, width, height)?;
            tell_unread(file, pages);
        }

        let bits = sample_bits(folder, &files, None)?;
        let picture = still(&files[0], bits)?;
        Ok(Self { files, bits, shown: 0, picture })
    }

    fn at(&mut self, time: Duration) -> Result<&RgbImage, FootageError> {
        let turn = (time.as_nanos() / STILL.as_nanos() % self.files.len() as u128) as usize;
        if turn != self.shown {
            self.picture = still(&self.files[turn], self.bits)?;
            self.shown = turn;
        }
        Ok(&self.picture)
    }
}

/// Reads a picture, scaled down to at most [`WIDTH`] x [`HEIGHT`]. Samples that fill 16 bit are numbers of `bits` bits.
fn still(file: &Path, bits: u8) -> Result<RgbImage, FootageError> {
    let bytes = std::fs::read(file).map_err(|error| FootageError::unreadable(file, error))?;
    let picture = PictureFile::open(&bytes).and_then(|opened| opened.with_bits(bits).read_any(0));
    let picture = picture.map_err(|error| FootageError::unreadable(file, error))?;

    if is_mosaic(&picture) {
        return Err(FootageError::unreadable(file, MOSAIC));
    }

    let fits = picture.width() as usize <= WIDTH && picture.height() as usize <= HEIGHT;
    let scaled =
        if fits { picture } else { picture.resize(WIDTH as u32, HEIGHT as u32, image::imageops::FilterType::Triangle) };
    let rgb = scaled.to_rgb8();

    let width = rgb.width() as usize;
    let height = rgb.height() as usize;
    large_enough(file, width, height)?;
    RgbImage::new(width, height, rgb.into_raw()).map_err(|error| FootageError::unreadable(file, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raw_mosaic_is_no_footage() {
        let folder = tempfile::tempdir().unwrap();
        let raw = folder.path().join("frame.RAW");
        std::fs::write(&raw, [0; 100]).unwrap();
        let error = Reel::open(&raw).err().unwrap().to_string();
        assert!(error.contains("frame.RAW: it is a sensor's mosaic: look at it with `parfocal inspect`"), "{error}");
    }

    #[test]
    fn samples_of_twelve_bit_in_files_of_sixteen_keep_their_levels() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        image::ImageBuffer::from_pixel(64, 64, image::Luma([4095_u16])).save(inside("a.png")).unwrap();
        image::ImageBuffer::from_pixel(64, 64, image::Rgb([819_u16, 1638, 4095])).save(inside("b.tiff")).unwrap();
        // So large that it is made smaller.
        image::ImageBuffer::from_pixel(2000, 500, image::Luma([819_u16])).save(inside("c.png")).unwrap();
        image::GrayImage::from_pixel(64, 64, image::Luma([100])).save(inside("d.png")).unwrap();

        let mut reel = Reel::open(folder.path()).unwrap();
        for (turn, expected) in (0..).zip([[255; 3], [51, 102, 255], [51; 3], [100; 3]]) {
            let picture = reel.at(turn * STILL).unwrap();
            assert_eq!(picture.data[..3], expected, "picture {turn}");
        }
    }

    #[test]
    fn a_still_that_cannot_be_read_is_an_error_as_long_as_its_turn_lasts() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "b.png"] {
            image::RgbImage::new(64, 64).save(folder.path().join(name)).unwrap();
        }
        let mut reel = Reel::open(folder.path()).unwrap();
        let gone = folder.path().join("b.png");
        std::fs::remove_file(&gone).unwrap();

        assert!(reel.at(Duration::ZERO).is_ok());
        for moment in [STILL, STILL.mul_f64(1.5), STILL.mul_f64(1.9)] {
            assert!(reel.at(moment).unwrap_err().to_string().contains("b.png"), "{moment:?}");
        }
        assert!(reel.at(2 * STILL).is_ok());
    }

    #[test]
    fn a_computers_own_files_are_no_pictures() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.png", "a.jpg", "._a.jpg", ".DS_Store", "Thumbs.db"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = pictures_in(folder.path()).unwrap();
        assert_eq!(found, ["a.jpg", "b.png"].map(|name| folder.path().join(name)));
    }
}
