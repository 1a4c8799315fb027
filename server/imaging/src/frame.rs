//! Pictures in memory: the sensor's mosaic, and the RGB and gray pictures made from it.

/// Rows and columns of one mosaic cell; a cell holds one sample of each of the 16 bands.
pub const CELL: usize = 4;

/// One exposure of a snapshot mosaic sensor: `width * height` samples, row by row, 10 bit in u16.
/// Band of a sample = 4 * (row % 4) + column % 4.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MosaicFrame {
    width: usize,
    height: usize,
    samples: Vec<u16>,
}

/// A picture whose data do not match its size.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct FrameError(String);

impl MosaicFrame {
    /// A frame of `samples`, row by row.
    ///
    /// # Errors
    /// If a side is not a positive multiple of 4, or the number of samples does not fit.
    pub fn new(width: usize, height: usize, samples: Vec<u16>) -> Result<Self, FrameError> {
        if width == 0 || height == 0 || !width.is_multiple_of(CELL) || !height.is_multiple_of(CELL) {
            return Err(FrameError(format!(
                "a mosaic frame must be a positive multiple of {CELL} wide and high, not {width}x{height}"
            )));
        }

        check_length(width, height, 1, samples.len())?;
        Ok(Self { width, height, samples })
    }

    /// Width in sensor pixels.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Height in sensor pixels.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Width in mosaic cells, which is the width of one band.
    pub const fn band_width(&self) -> usize {
        self.width / CELL
    }

    /// Height in mosaic cells, which is the height of one band.
    pub const fn band_height(&self) -> usize {
        self.height / CELL
    }

    /// All samples, row by row.
    pub fn samples(&self) -> &[u16] {
        &self.samples
    }

    /// Takes the samples back out, to reuse their memory.
    pub fn into_samples(self) -> Vec<u16> {
        self.samples
    }
}

/// An 8-bit sRGB picture, `[r, g, b]` pixels interleaved, row by row.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RgbImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// `3 * width * height` bytes.
    pub data: Vec<u8>,
}

impl RgbImage {
    /// A picture of `data`.
    ///
    /// # Errors
    /// If the number of bytes does not fit the size.
    pub fn new(width: usize, height: usize, data: Vec<u8>) -> Result<Self, FrameError> {
        check_length(width, height, 3, data.len())?;
        Ok(Self { width, height, data })
    }

    /// Makes room for `width` x `height` pixels; keeps its memory if that is large enough.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        self.width = width;
        self.height = height;
        self.data.resize(3 * width * height, 0);
    }
}

/// A gray picture on the 0..255 scale, row by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GrayImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// `width * height` values, 0..=255, not rounded.
    pub data: Vec<f32>,
}

impl GrayImage {
    /// A picture of `data`.
    ///
    /// # Errors
    /// If the number of values does not fit the size.
    pub fn new(width: usize, height: usize, data: Vec<f32>) -> Result<Self, FrameError> {
        check_length(width, height, 1, data.len())?;
        Ok(Self { width, height, data })
    }

    /// Makes room for `width` x `height` pixels; keeps its memory if that is large enough.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        self.width = width;
        self.height = height;
        self.data.resize(width * height, 0.0);
    }
}

fn check_length(width: usize, height: usize, channels: usize, found: usize) -> Result<(), FrameError> {
    let expected = width * height * channels;
    if found == expected {
        return Ok(());
    }
    Err(FrameError(format!("a {width}x{height} picture needs {expected} values, but {found} were given")))
}
