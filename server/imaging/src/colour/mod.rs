//! Colour: the matrix from 16 white-balanced bands to linear sRGB.
//!
//! Nothing above 600 nm is sensed, so the reds shown are inferred: they are those of the reflectances of the fit
//! (smooth ones and perfused tissue) that agree best with what is sensed from 460 to 600 nm. Colours are shown as under
//! D65, whatever the light in use, because the white reference removes that light.

mod cie;
mod reflectances;
mod srgb;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::calibration::{BANDS, Band, Calibration};
use cie::Reflectance;
pub(super) use srgb::Encoder;

/// Standard deviation of a band's noise that the fit assumes, as a share of white. It keeps the matrix from telling
/// neighbouring bands apart by their noise: with less, noise in the shown red grows (3.2 times a band's at 0.012, 2.3
/// times at 0.02); with more, colours of tissue differ more from what the eye sees.
const BAND_NOISE: f64 = 0.02;

type BandMatrix = SMatrix<f64, BANDS, BANDS>;

impl Calibration {
    /// Weights of the white-balanced bands in linear sRGB red, green and blue, with the spectral correction in them.
    pub fn linear_srgb(&self) -> [[f32; BANDS]; 3] {
        linear_srgb_from_bands(&self.bands).map(|colour| {
            std::array::from_fn(|band| {
                self.correction.iter().zip(colour).map(|(from, weight)| weight * from[band]).sum()
            })
        })
    }
}

/// Three rows that make linear sRGB red, green and blue from white-balanced bands: least squares over
/// [`reflectances::reflectances`] of band responses (Gaussians) against XYZ under D65,
/// ridge-regularised by [`BAND_NOISE`], then scaled so that white bands give white.
fn linear_srgb_from_bands(bands: &[Band; BANDS]) -> [[f32; BANDS]; 3] {
    let xyz = xyz_from_bands(bands);
    let to_rgb = Matrix3::from_fn(|row, column| srgb::FROM_XYZ[row][column]);
    let rgb = to_rgb * xyz;

    // The standard's matrix has four decimals, so its white is off by 1e-4.
    std::array::from_fn(|row| {
        let white = rgb.row(row).sum();
        std::array::from_fn(|band| (rgb[(row, band)] / white) as f32)
    })
}

fn xyz_from_bands(bands: &[Band; BANDS]) -> SMatrix<f64, 3, BANDS> {
    let mut products = SMatrix::<f64, 3, BANDS>::zeros();
    let mut squares = BandMatrix::zeros();

    let set = reflectances::reflectances();
    for spectrum in &set {
        let seen = responses(bands, spectrum);
        squares += seen * seen.transpose() + BandMatrix::identity() * BAND_NOISE.powi(2);
        products += Vector3::from(spectrum.xyz()) * seen.transpose();
    }

    // Symmetric and, with the noise on its diagonal, positive definite: the inverse exists.
    let inverse = squares.cholesky().map_or_else(BandMatrix::identity, |decomposed| decomposed.inverse());
    let mut fitted = products * inverse;

    let white = Reflectance::from_fn(|_| 1.0).xyz();
    for (mut row, white) in fitted.row_iter_mut().zip(white) {
        row *= white / row.sum();
    }

    fitted
}

/// The white-balanced bands' responses to a reflectance.
fn responses(bands: &[Band; BANDS], spectrum: &Reflectance) -> SVector<f64, BANDS> {
    SVector::from_fn(|index, _| {
        let Band { centre_nm, fwhm_nm } = bands[index];
        // Half the maximum at half the width: exp(-4 ln 2 (d / FWHM)^2).
        spectrum.weighted_mean(|nm| (-4.0 * std::f64::consts::LN_2 * ((nm - centre_nm) / fwhm_nm).powi(2)).exp())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Calibration;

    /// Linear sRGB of a reflectance: through the default sensor's bands, and through the eye's colour-matching
    /// functions.
    fn both_ways(spectrum: &Reflectance) -> ([f64; 3], [f64; 3]) {
        let bands = Calibration::default().bands;
        let seen = responses(&bands, spectrum);
        let sensed = linear_srgb_from_bands(&bands)
            .map(|row| row.iter().zip(&seen).map(|(&weight, value)| f64::from(weight) * value).sum());
        let eye = Matrix3::from_fn(|row, column| srgb::FROM_XYZ[row][column]) * Vector3::from(spectrum.xyz());
        (sensed, eye.into())
    }

    #[test]
    fn white_and_grays_come_out_neutral() {
        for level in [0.1, 0.5, 1.0] {
            for component in both_ways(&Reflectance::from_fn(|_| level)).0 {
                assert!((component - level).abs() < 1e-5, "{component} {level}");
            }
        }
    }

    #[test]
    fn hues_are_where_they_belong() {
        let of = |low: f64, high: f64| {
            both_ways(&Reflectance::from_fn(|nm| if (low..high).contains(&nm) { 0.8 } else { 0.05 })).0
        };
        let [red, green, blue] = of(380.0, 490.0);
        assert!(blue > 2.0 * green && blue > 2.0 * red, "short waves are blue: {red} {green} {blue}");
        let [red, green, blue] = of(500.0, 570.0);
        assert!(green > 2.0 * red && green > 2.0 * blue, "middle waves are green: {red} {green} {blue}");
        let [red, green, blue] = of(585.0, 780.0);
        assert!(red > 2.0 * green && red > 2.0 * blue, "long waves are red: {red} {green} {blue}");
        let [red, green, blue] = of(500.0, 780.0);
        assert!(red > 3.0 * blue && green > 3.0 * blue, "without short waves, yellow: {red} {green} {blue}");
    }

    #[test]
    fn tissue_looks_as_to_the_eye() {
        // Parameters between those of the fit.
        for (blood, saturation) in [(0.015, 0.7), (0.08, 0.9), (0.3, 0.5)] {
            let (sensed, eye) = both_ways(&reflectances::tissue(blood, saturation, 15.0));
            for (sensed, eye) in sensed.iter().zip(eye) {
                assert!((sensed - eye).abs() < 0.09, "{sensed} {eye}");
            }
            assert!(sensed[0] > sensed[1] && sensed[0] > sensed[2], "perfused tissue is reddish");
        }
    }

    #[test]
    fn noise_is_not_blown_up() {
        // Independent noise of a band reaches a component times the row's length; a component made of one band has 1.
        for row in linear_srgb_from_bands(&Calibration::default().bands) {
            let gain = row.iter().map(|weight| weight * weight).sum::<f32>().sqrt();
            assert!(gain < 2.4, "{gain}");
        }
    }
}
