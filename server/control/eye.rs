//! The eye: what policies see of a frame, whichever kind of picture it carries.

use super::Hold;
use super::pilot::HoldReason;
use crate::camera::FrameImage;
use crate::imaging::{ContentArea, PatchArea, Reconstructor, View, rgb_view};

/// Finds and reconstructs the patch and what is around it, and nothing else of the picture.
pub struct Eye {
    reconstructor: Reconstructor,
}

impl Eye {
    /// An eye for mosaics that `reconstructor` is calibrated for, and for colour pictures.
    #[must_use]
    pub const fn new(reconstructor: Reconstructor) -> Self {
        Self { reconstructor }
    }

    /// The view at the centre of `content`, or of the picture without one, and where its patch was.
    ///
    /// # Errors
    /// When the picture is smaller than a patch.
    pub fn look(&self, image: &FrameImage, content: Option<&ContentArea>) -> Result<(PatchArea, View), HoldReason> {
        let (width, height) = match image {
            FrameImage::Mosaic(mosaic) => (mosaic.band_width(), mosaic.band_height()),
            FrameImage::Rgb(rgb) => (rgb.width, rgb.height),
        };

        let area = PatchArea::central(width, height, content).map_err(|error| {
            HoldReason::new(Hold::CameraFailed, &format!("the camera's picture is no use: {error}"))
        })?;

        let view = match image {
            FrameImage::Mosaic(mosaic) => self.reconstructor.gray_view(mosaic, area),
            FrameImage::Rgb(rgb) => rgb_view(rgb, area),
        };

        Ok((area, view))
    }
}
