//! Makes pictures of frames at one size, reusing the same memory.

use super::{EncodedFrame, Insight, Picture};
use crate::control::ControlledFrame;
use parfocal_devices::camera::FrameImage;
use parfocal_imaging::{Developed, Developer, GrayImage, JpegEncoder, JpegError, Size, rgb_to_gray};

/// A developer and an encoder, and the pictures that pass between them.
pub(super) struct FrameEncoder {
    size: Size,
    developer: Developer,
    encoder: JpegEncoder,
    picture: Developed,
    gray: GrayImage,
}

impl FrameEncoder {
    /// A studio for pictures of `size`.
    ///
    /// # Errors
    /// If there is no memory for an encoder.
    pub(super) fn new(developer: Developer, size: Size) -> Result<Self, JpegError> {
        let encoder = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY)?;
        Ok(Self { size, developer, encoder, picture: Developed::default(), gray: GrayImage::default() })
    }

    /// The size of its pictures.
    pub(super) const fn size(&self) -> Size {
        self.size
    }

    /// Develops a mosaic into a colour and a gray picture; does nothing with a colour picture.
    pub(super) fn develop(&mut self, image: &FrameImage) {
        if let FrameImage::Mosaic(mosaic) = image {
            self.developer.develop_for_jpeg(mosaic, self.size, &mut self.picture, &mut self.gray);
        }
    }

    /// Encodes `controlled` for viewers. Its picture must be the one developed last.
    ///
    /// # Errors
    /// If the picture cannot be encoded.
    pub(super) fn encode(&mut self, controlled: &ControlledFrame) -> Result<EncodedFrame, JpegError> {
        let ControlledFrame { frame, patch, content_area, aim, record, belief, left_by_session, .. } = controlled;

        let (width, height, jpeg) = match (&frame.image, &self.picture) {
            (FrameImage::Rgb(rgb), _) => (rgb.width, rgb.height, self.encoder.encode(rgb)?),
            (FrameImage::Mosaic(_), Developed::Rgb(rgb)) => (rgb.width, rgb.height, self.encoder.encode(rgb)?),
            (FrameImage::Mosaic(_), Developed::Ycc(ycc)) => (ycc.width, ycc.height, self.encoder.encode_ycc(ycc)?),
        };
        let developed = matches!(frame.image, FrameImage::Mosaic(_));

        Ok(EncodedFrame {
            picture: Picture {
                number: frame.number,
                exposed_at: frame.exposed_at,
                width,
                height,
                per_cell: if developed { self.size.per_cell() } else { 1 },
                jpeg,
                estimated: developed,
                patch: *patch,
                content_area: *content_area,
                aim: *aim,
            },
            insight: Insight {
                asked: record.asked,
                measured: record.measured,
                metric: record.metric,
                held: record.held,
                belief: belief.clone(),
                left_by_session: *left_by_session,
            },
        })
    }

    /// Gray picture of `image`, one value per cell. `image` must be the one developed last.
    pub(super) fn gray(&mut self, image: &FrameImage) -> &GrayImage {
        if let FrameImage::Rgb(rgb) = image {
            rgb_to_gray(rgb, &mut self.gray);
        }
        &self.gray
    }
}
