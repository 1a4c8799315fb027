//! White balance by references per pixel, in whole numbers: [`DARK`] for dark, [`WHITE`] for white.

use crate::calibration::Calibration;
use crate::frame::{CELL, MosaicFrame};
use crate::white_balance::WhiteBalance;

/// The value of a sample as dark as the dark reference; above 0, so that noise below dark is kept.
pub(crate) const DARK: f32 = 2048.0;
/// The value of a sample as bright as the white reference; leaves room for highlights three times as
/// bright.
pub(crate) const WHITE: f32 = DARK + 16_384.0;

/// 2^23: added to a small number it leaves that number, rounded, in the lowest bits, which is cheaper
/// than a cast.
pub(crate) const LOW_BITS: f32 = 8_388_608.0;

/// Gain and offset of every pixel of the sensor, so that dark becomes [`DARK`] and white [`WHITE`].
#[derive(Debug, Clone)]
pub(crate) struct PixelBalance {
    width: usize,
    height: usize,
    gains: Vec<f32>,
    offsets: Vec<f32>,
}

impl PixelBalance {
    /// The balance by the references of `calibration`. `None` if none of them is per pixel, or if their sizes differ.
    pub(super) fn new(calibration: &Calibration) -> Option<Self> {
        let (width, height) = calibration.size()?;
        if !calibration.fits(width, height) {
            return None;
        }

        let balance = WhiteBalance::new(calibration, width);
        let (gains, offsets) = (0..width * height)
            .map(|place| {
                let (dark, span) = balance.at(place);
                let gain = (WHITE - DARK) / span;
                (gain, DARK - dark * gain)
            })
            .unzip();

        Some(Self { width, height, gains, offsets })
    }

    /// Whether `mosaic` has the size of the references.
    pub(super) fn fits(&self, mosaic: &MosaicFrame) -> bool {
        (mosaic.width(), mosaic.height()) == (self.width, self.height)
    }

    /// Gains and offsets of the sensor's row `y`.
    pub(crate) fn row(&self, y: usize) -> (&[f32], &[f32]) {
        let places = y * self.width..(y + 1) * self.width;
        (&self.gains[places.clone()], &self.offsets[places])
    }

    /// White-balances the samples of the row of cells `y`, from column `x` on, into `balanced`: four rows one after
    /// another.
    #[inline(always)]
    pub(super) fn apply(&self, rows: [&[u16]; CELL], x: usize, y: usize, balanced: &mut [u16]) {
        let length = rows[0].len();

        for (row, (samples, balanced)) in rows.into_iter().zip(balanced.chunks_exact_mut(length)).enumerate() {
            let start = (CELL * y + row) * self.width + x;
            let places = start..start + length;
            let correction = self.gains[places.clone()].iter().zip(&self.offsets[places]);

            for ((balanced, &sample), (gain, offset)) in balanced.iter_mut().zip(samples).zip(correction) {
                *balanced = ((f32::from(sample) * gain + offset).clamp(0.0, 65_535.0) + LOW_BITS).to_bits() as u16;
            }
        }
    }
}
