//! The spectrum at a place as people and programs read it: the bands in order of wavelength.

use serde::Serialize;
use utoipa::ToSchema;

use parfocal_imaging::{Calibration, Spectrum};
use parfocal_recording::by_wavelength;

/// The spectrum at a place.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PlaceSpectrum {
    /// Number of mosaic cells within the circle.
    pub cells: usize,
    /// Samples at full scale, whose true values are higher.
    pub saturated: usize,
    /// The bands in order of wavelength.
    pub bands: Vec<BandLevel>,
}

/// What a band shows at a place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct BandLevel {
    /// Wavelength at which the band is most sensitive, nm.
    pub wavelength_nm: f64,
    /// Full width of the band at half of its maximum, nm.
    pub fwhm_nm: f64,
    /// Mean of the raw counts.
    pub counts: f64,
    /// Standard deviation of the raw counts.
    pub counts_spread: f64,
    /// Mean reflectance: 0 as dark as the dark reference, 1 as bright as the white one. Null without a white reference.
    pub reflectance: Option<f64>,
    /// Standard deviation of the reflectance. Null without a white reference.
    pub reflectance_spread: Option<f64>,
}

impl PlaceSpectrum {
    /// The table of `spectrum`, which was taken by a sensor with `calibration`.
    pub fn new(calibration: &Calibration, spectrum: &Spectrum) -> Self {
        let level = |band: usize| {
            let reflectance = spectrum.reflectance.map(|levels| levels[band]);
            BandLevel {
                wavelength_nm: calibration.bands[band].centre_nm,
                fwhm_nm: calibration.bands[band].fwhm_nm,
                counts: spectrum.counts[band].mean,
                counts_spread: spectrum.counts[band].spread,
                reflectance: reflectance.map(|level| level.mean),
                reflectance_spread: reflectance.map(|level| level.spread),
            }
        };
        let bands = by_wavelength(calibration).into_iter().map(level).collect();
        Self { cells: spectrum.cells, saturated: spectrum.saturated, bands }
    }
}
