//! The eye: the patch of a frame, whichever kind of picture it carries.

use super::Hold;
use super::pilot::HoldReason;
use crate::camera::FrameImage;
use crate::imaging::{ContentArea, Patch, PatchArea, Reconstructor, rgb_patch};

/// Finds and reconstructs the patch, and nothing else of the picture.
pub struct Eye {
    reconstructor: Reconstructor,
}

impl Eye {
    /// An eye for mosaics that `reconstructor` is calibrated for, and for colour pictures.
    #[must_use]
    pub const fn new(reconstructor: Reconstructor) -> Self {
        Self { reconstructor }
    }

    /// The patch at the centre of `content`, or of the picture without one, and where it was.
    ///
    /// # Errors
    /// When the picture is smaller than a patch.
    pub fn look(&self, image: &FrameImage, content: Option<&ContentArea>) -> Result<(PatchArea, Patch), HoldReason> {
        let (width, height) = match image {
            FrameImage::Mosaic(mosaic) => (mosaic.band_width(), mosaic.band_height()),
            FrameImage::Rgb(rgb) => (rgb.width, rgb.height),
        };
        let area = PatchArea::central(width, height, content).map_err(|error| {
            HoldReason::new(Hold::CameraFailed, &format!("the camera's picture is no use: {error}"))
        })?;
        let patch = match image {
            FrameImage::Mosaic(mosaic) => self.reconstructor.gray_patch(mosaic, area),
            FrameImage::Rgb(rgb) => rgb_patch(rgb, area),
        };
        Ok((area, patch))
    }
}
