//! Pictures in files of 16 bit that hold samples of fewer bits, as scientific cameras save them. White is then the
//! greatest number of so many bits, and without that a picture of 12 bit would be sixteen times too dark.

use std::path::{Path, PathBuf};

use super::files::picture_head;
use super::video::FootageError;
use parfocal_base::notices::tell;
use parfocal_imaging::{DecodeError, PictureFile};

/// The largest sample of all pictures of one stack, scan or folder that fill 16 bit, and the file that holds it. It
/// decides on white in all of them.
#[derive(Debug, Default)]
pub struct WideSamples {
    largest: Option<(u16, PathBuf)>,
}

impl WideSamples {
    /// Takes in a picture, from 0, of the `file` at `path`.
    ///
    /// # Errors
    /// If the picture is damaged.
    pub fn see(&mut self, path: &Path, file: &PictureFile<'_>, page: usize) -> Result<(), DecodeError> {
        if !file.is_wide() {
            return Ok(());
        }

        let sample = file.largest_sample(page)?;
        if self.largest.as_ref().is_none_or(|(largest, _)| sample > *largest) {
            self.largest = Some((sample, path.to_owned()));
        }
        Ok(())
    }

    /// Refuses `bits` that do not hold every sample.
    ///
    /// # Errors
    /// If a sample needs more bits.
    pub fn check(&self, bits: u8) -> Result<(), FootageError> {
        let needed = self.needed();
        match &self.largest {
            Some((largest, path)) if bits < needed => Err(FootageError(format!(
                "{} holds a sample of {largest}, which is more than {bits} bit; give --bits {needed} or more",
                path.display()
            ))),
            _ => Ok(()),
        }
    }

    /// The fewest bits that hold every sample, for [`PictureFile::with_bits`]. If they are fewer than 16, a note for
    /// people says so.
    pub fn guess(&self) -> (u8, Option<String>) {
        let bits = self.needed();
        let Some((largest, _)) = self.largest.as_ref().filter(|_| bits < 16) else { return (16, None) };

        let white = u16::MAX >> (16 - bits);
        let note = format!(
            "the samples of the 16-bit pictures reach {largest}, so they are read as {bits} bit: {white} is white"
        );
        (bits, Some(note))
    }

    /// The bits that are `given`; if it is `None`, those of [`WideSamples::guess`] for the pictures of `folder`. The
    /// note goes to standard error.
    ///
    /// # Errors
    /// If a sample needs more bits than are given.
    pub fn settle(&self, folder: &Path, given: Option<u8>) -> Result<u8, FootageError> {
        if let Some(bits) = given {
            self.check(bits)?;
            return Ok(bits);
        }

        let (bits, note) = self.guess();
        if let Some(note) = note {
            tell(format_args!("note: {}: {note}", folder.display()));
        }
        Ok(bits)
    }

    fn needed(&self) -> u8 {
        self.largest.as_ref().map_or(16, |(largest, _)| (16 - largest.leading_zeros() as u8).max(8))
    }
}

/// Bits of the samples of the first pictures of `files`, all of `folder`, as [`WideSamples::settle`] finds them.
/// Whoever reads a picture that is damaged, or none, says so.
///
/// # Errors
/// If a file cannot be read, or a sample needs more bits than are `given`.
pub fn sample_bits(folder: &Path, files: &[PathBuf], given: Option<u8>) -> Result<u8, FootageError> {
    let mut wide = WideSamples::default();
    for path in files {
        let unreadable = |error| FootageError::unreadable(path, error);
        let head = picture_head(path).map_err(unreadable)?;
        if !PictureFile::open(&head).is_ok_and(|file| file.is_wide()) {
            continue;
        }

        let bytes = std::fs::read(path).map_err(unreadable)?;
        let _ = PictureFile::open(&bytes).and_then(|file| wide.see(path, &file, 0));
    }
    wide.settle(folder, given)
}
