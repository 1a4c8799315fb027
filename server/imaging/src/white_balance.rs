//! Dark and white of each sample, from a calibration's references.

use super::calibration::{BANDS, Calibration, Reference};
use super::frame::CELL;

/// If a sample's span from dark to white is below this share of its band's mean span, it gets the band's: its own would
/// amplify noise.
const LEAST_SPAN: f32 = 0.1;

/// Dark and white of each sample of a sensor.
pub(crate) struct WhiteBalance<'a> {
    calibration: &'a Calibration,
    width: usize,
    dark: [f32; BANDS],
    white: [f32; BANDS],
}

impl<'a> WhiteBalance<'a> {
    /// The balance by the references of `calibration`, for a sensor that is `width` samples wide.
    pub(crate) fn new(calibration: &'a Calibration, width: usize) -> Self {
        Self { calibration, width, dark: calibration.dark.band_means(), white: calibration.white.band_means() }
    }

    /// Counts of the dark reference at the sample `place`, and from there to the white one.
    pub(crate) fn at(&self, place: usize) -> (f32, f32) {
        let band = CELL * (place / self.width % CELL) + place % self.width % CELL;
        let counts = |reference: &Reference, means: &[f32; BANDS]| match reference {
            Reference::PerPixel(frame) => f32::from(frame.samples()[place]),
            Reference::PerBand(_) => means[band],
        };
        let dark = counts(&self.calibration.dark, &self.dark);
        let white = counts(&self.calibration.white, &self.white);

        // A dead pixel, or one outside the content area, sees almost no white.
        let of_band = self.white[band] - self.dark[band];
        let span = if white - dark > LEAST_SPAN * of_band { white - dark } else { of_band };
        (dark, span)
    }
}
