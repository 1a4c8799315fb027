//! Makes frames' pictures at one size, reusing its memory for each.

use bytes::Bytes;

use super::{EncodedFrame, Insight, Picture};
use crate::camera::FrameImage;
use crate::control::ControlledFrame;
use crate::imaging::{Developer, GrayImage, JpegEncoder, JpegError, RgbImage, Size, rgb_to_gray};

/// A developer and an encoder, and the pictures that pass between them.
pub(super) struct Studio {
    size: Size,
    developer: Developer,
    encoder: JpegEncoder,
    rgb: RgbImage,
    gray: GrayImage,
}

impl Studio {
    /// A studio for pictures of `size`.
    ///
    /// # Errors
    /// When there is no memory for an encoder.
    pub(super) fn new(developer: Developer, size: Size) -> Result<Self, JpegError> {
        let encoder = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY)?;
        Ok(Self { size, developer, encoder, rgb: RgbImage::default(), gray: GrayImage::default() })
    }

    /// The size of its pictures.
    pub(super) const fn size(&self) -> Size {
        self.size
    }

    /// Makes colour and gray from a mosaic; leaves a colour picture as it is.
    pub(super) fn develop(&mut self, image: &FrameImage) {
        if let FrameImage::Mosaic(mosaic) = image {
            self.developer.develop(mosaic, self.size, &mut self.rgb, &mut self.gray);
        }
    }

    /// What viewers get of `controlled`, whose picture must be the one developed last.
    ///
    /// # Errors
    /// When the picture cannot be encoded.
    pub(super) fn encode(&mut self, controlled: ControlledFrame) -> Result<EncodedFrame, JpegError> {
        let ControlledFrame { frame, patch, content_area, record, belief } = controlled;

        let (rgb, per_cell, estimated) = match &frame.image {
            FrameImage::Mosaic(_) => (&self.rgb, self.size.per_cell(), true),
            FrameImage::Rgb(rgb) => (rgb.as_ref(), 1, false),
        };
        let jpeg: Bytes = self.encoder.encode(rgb)?;

        Ok(EncodedFrame {
            picture: Picture {
                number: frame.number,
                exposed_at: frame.exposed_at,
                width: rgb.width,
                height: rgb.height,
                per_cell,
                jpeg,
                estimated,
                patch,
                content_area,
            },
            insight: Insight {
                asked: record.asked,
                measured: record.measured,
                metric: record.metric,
                held: record.held,
                belief,
            },
        })
    }

    /// Gray picture of `image`, which must be the one developed last: one value a cell.
    pub(super) fn gray(&mut self, image: &FrameImage) -> &GrayImage {
        if let FrameImage::Rgb(rgb) = image {
            rgb_to_gray(rgb, &mut self.gray);
        }
        &self.gray
    }
}
