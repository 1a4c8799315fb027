//! Focal stacks named on the command line, and their pictures at the scales at which they are used.

use std::path::PathBuf;
use std::sync::Arc;

use super::check::check;
use super::optics::StackOptics;
use super::{FocalStack, Plane};
use crate::LearningError;
use crate::scans::planes::PlaneStack;
use parfocal_base::BlurRate;
use parfocal_imaging::{GrayImage, PixelFormat, in_blocks, reduced};

/// The two scales: names, and the width in pixels to which a stack's pictures are reduced as nearly as possible. It is
/// unknown how soft a lens's best picture is on the sensor, so each stack is used at both.
const SCALES: [(&str, usize); 2] = [("s", 500), ("l", 1000)];
/// Least number of planes in a range, if the number is not given.
const LEAST_PLANES: usize = 6;
/// Least side in pixels of pictures made smaller: room for a patch and what surrounds it.
const LEAST_SIDE: usize = 200;

/// A focal stack's folder or file, and how many of its pictures make the range 0..=1 of a scan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StackSource {
    /// The folder with the pictures; sorted by name, numbers by value, they are in order of focus. Or a TIFF with
    /// several pages.
    pub folder: PathBuf,
    /// Planes of the range; if it is `None`, two fifths of the stack's, but at least 6.
    pub planes: Option<usize>,
    /// The format of raw mosaics; if it is `None`, the one of their length.
    pub raw: Option<PixelFormat>,
}

/// A stack's pictures at one scale.
#[derive(Debug, Clone)]
pub struct ScaledStack {
    /// `s` or `l`: about 500 or 1000 pixels wide.
    pub scale: &'static str,
    /// Planes that make the range 0..=1.
    pub planes: usize,
    /// The pictures; their positions count the planes from 0.
    pub pictures: Arc<PlaneStack>,
    /// The same pictures, to measure the blur rate.
    stack: FocalStack,
}

impl ScaledStack {
    /// The same pictures, smaller by `factor`; `None` if there would be no room for a patch to move.
    pub fn smaller(&self, factor: f64) -> Option<PlaneStack> {
        let (width, height) = self.stack.size();
        let [width, height] = [width, height].map(|side| (side as f64 * factor).round() as usize);
        if width.min(height) < LEAST_SIDE {
            return None;
        }

        let pictures = self.stack.planes().iter().map(|plane| reduced(&plane.picture, width, height));
        PlaneStack::new(&numbered(pictures)).ok()
    }

    /// How fast blur grows over the range; `None` if the pictures do not show it. Measuring takes seconds.
    pub fn blur_rate(&self) -> Option<BlurRate> {
        let rate = StackOptics::of_focus(&self.stack).blur_per_unit?;
        BlurRate::new(rate * (self.planes - 1) as f64)
    }
}

impl StackSource {
    /// The source that `DIR` or `DIR:PLANES` names, with raw mosaics in the format `raw` if there are any.
    pub fn parse(text: &str, raw: Option<PixelFormat>) -> Self {
        let split = text.rsplit_once(':').and_then(|(folder, planes)| Some((folder, planes.parse().ok()?)));
        match split {
            Some((folder, planes)) => Self { folder: folder.into(), planes: Some(planes), raw },
            None => Self { folder: text.into(), planes: None, raw },
        }
    }

    /// The error that it has fewer planes than a range of `planes` needs, or its pictures are too small.
    pub(crate) fn too_small(&self, planes: usize) -> LearningError {
        LearningError::new(format!(
            "{folder} cannot be scanned: a range of {planes} planes needs 3 or more, as many pictures, and at least \
             128x128 pixels; {folder}:K makes K planes the range",
            folder = self.folder.display()
        ))
    }

    /// Reads the stack and reduces it to each of the scales. Also returns warnings about its pictures, as text for
    /// people. A scan is possible despite them.
    ///
    /// # Errors
    /// If the stack cannot be read, or its pictures are not a stack.
    pub fn at_scales(&self) -> Result<(Vec<ScaledStack>, Vec<String>), LearningError> {
        let stack = FocalStack::load(&self.folder, None, 1, self.raw, None)?;
        let mut doubts = check(&stack).unwrap_or_else(|error| vec![error.to_string()]);
        let stack = match stack.even() {
            Ok((even, note)) => {
                doubts.extend(note);
                even
            }
            // Numbers in names need not be positions.
            Err(error) => {
                doubts.push(format!("{error}; they are taken as if they stood at even distances"));
                stack
            }
        };

        let planes = self.planes.unwrap_or((2 * stack.planes().len() / 5).max(LEAST_PLANES)).max(1);
        let (width, _) = stack.size();

        let scaled = |(scale, wide): (&'static str, usize)| {
            let side = ((width as f64 / wide as f64).round() as usize).max(1);
            let numbered = numbered(stack.planes().iter().map(|plane| in_blocks(&plane.picture, side)));

            let unfit = |error| LearningError::new(format!("{} is not a focal stack: {error}", self.folder.display()));
            let pictures = Arc::new(PlaneStack::new(&numbered).map_err(unfit)?);

            let plane = |(at, picture): (f32, GrayImage)| Plane { name: at.to_string(), position: at.into(), picture };
            let stack = FocalStack::new(numbered.into_iter().map(plane).collect())?;
            Ok(ScaledStack { scale, planes, pictures, stack })
        };
        let scaled = SCALES.into_iter().map(scaled).collect::<Result<_, LearningError>>()?;
        let named = |doubt: String| format!("{}: {doubt}", self.folder.display());
        Ok((scaled, doubts.into_iter().map(named).collect()))
    }
}

/// Each picture with its number, from 0, as its position.
fn numbered(pictures: impl Iterator<Item = GrayImage>) -> Vec<(f32, GrayImage)> {
    pictures.enumerate().map(|(at, picture)| (at as f32, picture)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_may_say_how_many_planes_make_the_range() {
        let parsed = |text: &str| {
            let source = StackSource::parse(text, None);
            (source.folder, source.planes)
        };
        assert_eq!(parsed("a/b:21"), ("a/b".into(), Some(21)));
        assert_eq!(parsed("a:b/c"), ("a:b/c".into(), None));
    }
}
