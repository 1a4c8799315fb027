//! JPEG for viewers, by libjpeg-turbo.

use bytes::Bytes;
use turbojpeg::{Compressor, Image, OutputBuf, PixelFormat, Subsamp, YuvImage};

use super::frame::RgbImage;
use super::ycc::YccImage;

/// Encodes pictures as JPEG with 4:2:0 chroma. Keep one and reuse it: it keeps its compressor and
/// memory.
#[derive(Debug)]
pub struct JpegEncoder {
    compressor: Compressor,
    buffer: Vec<u8>,
}

/// A picture could not be encoded.
#[derive(Debug, thiserror::Error)]
pub enum JpegError {
    /// The picture has no pixels, or its data do not match its size.
    #[error("cannot encode a {width}x{height} picture of {bytes} bytes as JPEG")]
    BadPicture {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Bytes of pixel data.
        bytes: usize,
    },
    /// libjpeg-turbo refused.
    #[error("libjpeg-turbo could not encode the picture: {0}")]
    Library(#[from] turbojpeg::Error),
}

impl JpegEncoder {
    /// Quality that suits a live view.
    pub const DEFAULT_QUALITY: u8 = 80;

    /// An encoder at `quality`, 1..=100.
    ///
    /// # Errors
    /// If libjpeg-turbo refuses the quality or has no memory.
    pub fn new(quality: u8) -> Result<Self, JpegError> {
        let mut compressor = Compressor::new()?;
        compressor.set_quality(i32::from(quality))?;
        compressor.set_subsamp(Subsamp::Sub2x2)?;
        Ok(Self { compressor, buffer: Vec::new() })
    }

    /// Encodes `rgb`.
    ///
    /// # Errors
    /// If the picture is empty or inconsistent, or libjpeg-turbo refuses it (a side over 65 500
    /// pixels).
    pub fn encode(&mut self, rgb: &RgbImage) -> Result<Bytes, JpegError> {
        let &RgbImage { width, height, ref data } = rgb;
        if width == 0 || height == 0 || data.len() != 3 * width * height {
            return Err(JpegError::BadPicture { width, height, bytes: data.len() });
        }

        self.buffer.resize(self.compressor.buf_len(width, height)?, 0);
        let image = Image { pixels: data.as_slice(), width, pitch: 3 * width, height, format: PixelFormat::RGB };
        let mut output = OutputBuf::borrowed(&mut self.buffer);
        self.compressor.compress(image, &mut output)?;

        Ok(Bytes::copy_from_slice(&output))
    }

    /// Encodes `ycc`, whose colours need no conversion.
    ///
    /// # Errors
    /// If the picture is empty, or libjpeg-turbo refuses it (a side over 65 500 pixels).
    pub fn encode_ycc(&mut self, ycc: &YccImage) -> Result<Bytes, JpegError> {
        let &YccImage { width, height, ref data } = ycc;
        if data.is_empty() {
            return Err(JpegError::BadPicture { width, height, bytes: 0 });
        }

        self.buffer.resize(self.compressor.buf_len(width, height)?, 0);
        let image = YuvImage { pixels: data.as_slice(), width, align: 1, height, subsamp: Subsamp::Sub2x2 };
        let mut output = OutputBuf::borrowed(&mut self.buffer);
        self.compressor.compress_yuv(image, &mut output)?;

        Ok(Bytes::copy_from_slice(&output))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_decoder_gets_the_picture_back() {
        let mut encoder = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY).unwrap();
        for (width, height) in [(64, 48), (33, 17)] {
            let data = (0..width * height).flat_map(|i| [u8::try_from(i % width * 3).unwrap(), 90, 40]).collect();
            let rgb = RgbImage::new(width, height, data).unwrap();
            let jpeg = encoder.encode(&rgb).unwrap();
            let read = image::load_from_memory_with_format(&jpeg, image::ImageFormat::Jpeg).unwrap().to_rgb8();
            assert_eq!(read.dimensions(), (u32::try_from(width).unwrap(), u32::try_from(height).unwrap()));
            let worst = read.iter().zip(&rgb.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
            assert!(worst <= 12, "worst difference {worst}");
        }
    }

    #[test]
    fn another_decoder_gets_luma_and_chroma_back() {
        let mut ycc = YccImage::default();
        ycc.resize(64, 48);
        let [luma, blue, red] = ycc.split_mut();
        luma.fill(81);
        blue.fill(90);
        red.fill(240);

        let jpeg = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY).unwrap().encode_ycc(&ycc).unwrap();
        let decoded = image::load_from_memory_with_format(&jpeg, image::ImageFormat::Jpeg).unwrap().to_rgb8();
        assert_eq!(decoded.dimensions(), (64, 48));
        // By JFIF 1.02's equations each pixel is 238, 14, 14.
        for pixel in decoded.pixels() {
            assert!(pixel.0.iter().zip([238, 14, 14]).all(|(one, other)| one.abs_diff(other) <= 6), "{pixel:?}");
        }
    }

    #[test]
    fn an_invalid_picture_is_an_error() {
        let mut encoder = JpegEncoder::new(80).unwrap();
        assert!(matches!(encoder.encode_ycc(&YccImage::default()), Err(JpegError::BadPicture { .. })));
        assert!(matches!(encoder.encode(&RgbImage::default()), Err(JpegError::BadPicture { .. })));
        let short = RgbImage { width: 10, height: 10, data: vec![0; 7] };
        assert!(matches!(encoder.encode(&short), Err(JpegError::BadPicture { bytes: 7, .. })));
        assert!(JpegEncoder::new(0).is_err());
    }
}
