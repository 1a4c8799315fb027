//! The eye: makes what policies see of a frame, from a mosaic or a colour picture.

use super::pilot::HoldReason;
use parfocal_autofocus::FieldOfView;
use parfocal_base::PatchPlace;
use parfocal_base::step::Hold;
use parfocal_devices::camera::FrameImage;
use parfocal_imaging::{ContentArea, Patch, PatchArea, Reconstructor, View, rgb_patch, rgb_view};

/// Finds the patch, and reconstructs only the part of the picture that a policy uses.
pub struct Eye {
    reconstructor: Reconstructor,
}

impl Eye {
    /// An eye for colour pictures, and for mosaics of the camera for which `reconstructor` is calibrated.
    pub const fn new(reconstructor: Reconstructor) -> Self {
        Self { reconstructor }
    }

    /// Where the patch at `place` lies in `image`. Without a content area the picture's centre is that of the circle.
    ///
    /// # Errors
    /// If the picture is smaller than a patch.
    pub fn find(
        &self,
        image: &FrameImage,
        place: PatchPlace,
        content: Option<&ContentArea>,
    ) -> Result<PatchArea, HoldReason> {
        let (width, height) = cells(image);
        PatchArea::at(place, width, height, content).map_err(|error| {
            HoldReason::new(Hold::CameraFailed, &format!("the camera's picture cannot be used: {error}"))
        })
    }

    /// Reconstructs the patch of `image` at `area`.
    pub fn patch(&self, image: &FrameImage, area: PatchArea) -> Patch {
        match image {
            FrameImage::Mosaic(mosaic) => self.reconstructor.gray_patch(mosaic, area),
            FrameImage::Rgb(rgb) => rgb_patch(rgb, area),
        }
    }

    /// Reconstructs what a policy with the field of view `field` sees of `image`, whose patch is at `area`.
    pub fn look(&self, image: &FrameImage, area: PatchArea, field: FieldOfView) -> View {
        match (field, image) {
            (FieldOfView::Patch, _) => View::from(self.patch(image, area)),
            (FieldOfView::Wide | FieldOfView::Surroundings, FrameImage::Mosaic(mosaic)) => {
                self.reconstructor.gray_view(mosaic, area)
            }
            (FieldOfView::Wide | FieldOfView::Surroundings, FrameImage::Rgb(rgb)) => rgb_view(rgb, area),
        }
    }
}

/// Width and height of `image` in mosaic cells; in pixels, for a colour picture.
pub fn cells(image: &FrameImage) -> (usize, usize) {
    match image {
        FrameImage::Mosaic(mosaic) => (mosaic.band_width(), mosaic.band_height()),
        FrameImage::Rgb(rgb) => (rgb.width, rgb.height),
    }
}
