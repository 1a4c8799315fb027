//! Pictures in files of 16 bit that hold samples of fewer bits, as scientific cameras save them. White is then the
//! greatest number of so many bits, and without that a picture of 12 bit would be sixteen times too dark.

use std::path::{Path, PathBuf};

use crate::LearningError;
use parfocal_base::notices::tell;
use parfocal_imaging::{DecodeError, GrayImage, PictureFile};

/// The largest sample of all pictures of one stack or scan that fill 16 bit, and the file that holds it. It decides on
/// white in all of them.
#[derive(Debug, Default)]
pub struct WideSamples {
    largest: Option<(u16, PathBuf)>,
}

impl WideSamples {
    /// Takes in a picture, from 0, of the `file` at `path`. Returns whether its gray levels need the factor of
    /// [`WideSamples::scale`].
    ///
    /// # Errors
    /// If the picture is damaged.
    pub fn see(&mut self, path: &Path, file: &PictureFile<'_>, page: usize) -> Result<bool, DecodeError> {
        if !file.is_wide() {
            return Ok(false);
        }

        let sample = file.largest_sample(page)?;
        if self.largest.as_ref().is_none_or(|(largest, _)| sample > *largest) {
            self.largest = Some((sample, path.to_owned()));
        }
        Ok(true)
    }

    /// The factor for the gray levels of these pictures, whose white is 65535 until then. Their samples are numbers of
    /// so many bits as are `given`; if it is `None`, of the fewest that hold the largest sample. If these are fewer
    /// than 16, a note for people says so.
    ///
    /// # Errors
    /// If a sample needs more bits than are `given`.
    pub fn scale(&self, given: Option<u8>) -> Result<(f32, Option<String>), LearningError> {
        let Some((largest, path)) = &self.largest else { return Ok((1.0, None)) };
        let needed = (16 - largest.leading_zeros() as u8).max(8);
        let bits = given.unwrap_or(needed);
        if bits < needed {
            let file = path.display();
            bail!("{file} holds a sample of {largest}, which is more than {bits} bit; give --bits {needed} or more");
        }

        let white = u16::MAX >> (16 - bits.min(16));
        let note = format!(
            "the samples of the 16-bit pictures reach {largest}, so they are read as {bits} bit: {white} is white"
        );
        let is_guessed = given.is_none() && bits < 16;
        Ok((f32::from(u16::MAX) / f32::from(white), is_guessed.then_some(note)))
    }

    /// Multiplies the gray levels of those `pictures` of `folder` that need it by the factor of [`WideSamples::scale`].
    /// A note for people says what is white.
    ///
    /// # Errors
    /// None in practice: 16 bit hold every sample.
    pub fn correct<'a>(
        &self,
        folder: &Path,
        pictures: impl Iterator<Item = (&'a mut GrayImage, bool)>,
    ) -> Result<(), LearningError> {
        let (scale, note) = self.scale(None)?;
        if let Some(note) = note {
            tell(format_args!("note: {}: {note}", folder.display()));
        }

        for (picture, _) in pictures.filter(|(_, is_wide)| *is_wide) {
            picture.data.iter_mut().for_each(|level| *level *= scale);
        }
        Ok(())
    }
}
