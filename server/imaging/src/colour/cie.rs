//! Colorimetry: the CIE 1931 standard observer and illuminant D65, and the XYZ of a reflectance under it.

/// Shortest wavelength of a [`Reflectance`] in nm.
const FIRST_NM: u32 = 380;

/// Number of values in a [`Reflectance`].
const SAMPLES: usize = 401;

/// Step of the tables below in nm.
const STEP_NM: usize = 10;

/// CIE 1931 2-degree colour-matching functions x, y, z from 380 to 780 nm in steps of 10 nm (ISO/CIE 11664-1).
#[rustfmt::skip]
const OBSERVER: [[f64; 3]; 41] = [
    [0.0014, 0.0000, 0.0065], [0.0042, 0.0001, 0.0201], [0.0143, 0.0004, 0.0679], [0.0435, 0.0012, 0.2074],
    [0.1344, 0.0040, 0.6456], [0.2839, 0.0116, 1.3856], [0.3483, 0.0230, 1.7471], [0.3362, 0.0380, 1.7721],
    [0.2908, 0.0600, 1.6692], [0.1954, 0.0910, 1.2876], [0.0956, 0.1390, 0.8130], [0.0320, 0.2080, 0.4652],
    [0.0049, 0.3230, 0.2720], [0.0093, 0.5030, 0.1582], [0.0633, 0.7100, 0.0782], [0.1655, 0.8620, 0.0422],
    [0.2904, 0.9540, 0.0203], [0.4334, 0.9950, 0.0087], [0.5945, 0.9950, 0.0039], [0.7621, 0.9520, 0.0021],
    [0.9163, 0.8700, 0.0017], [1.0263, 0.7570, 0.0011], [1.0622, 0.6310, 0.0008], [1.0026, 0.5030, 0.0003],
    [0.8544, 0.3810, 0.0002], [0.6424, 0.2650, 0.0000], [0.4479, 0.1750, 0.0000], [0.2835, 0.1070, 0.0000],
    [0.1649, 0.0610, 0.0000], [0.0874, 0.0320, 0.0000], [0.0468, 0.0170, 0.0000], [0.0227, 0.0082, 0.0000],
    [0.0114, 0.0041, 0.0000], [0.0058, 0.0021, 0.0000], [0.0029, 0.0010, 0.0000], [0.0014, 0.0005, 0.0000],
    [0.0007, 0.0002, 0.0000], [0.0003, 0.0001, 0.0000], [0.0002, 0.0001, 0.0000], [0.0001, 0.0000, 0.0000],
    [0.0000, 0.0000, 0.0000],
];

/// Relative power of CIE standard illuminant D65 at the same wavelengths (ISO/CIE 11664-2).
#[rustfmt::skip]
const D65: [f64; 41] = [
    49.9755, 54.6482, 82.7549, 91.4860, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923, 108.811,
    109.354, 107.802, 104.790, 107.689, 104.405, 104.046, 100.000, 96.3342, 95.7880, 88.6856, 90.0062, 89.5991,
    87.6987, 83.2886, 83.6992, 80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.3490, 61.6040, 69.8856,
    75.0870, 63.5927, 46.4182, 66.8054, 63.3828,
];

/// A reflectance from 380 to 780 nm in steps of 1 nm.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reflectance(Vec<f64>);

impl Reflectance {
    /// The reflectance that `at` gives for each wavelength in nm.
    pub(super) fn from_fn(at: impl FnMut(f64) -> f64) -> Self {
        Self((FIRST_NM..).take(SAMPLES).map(f64::from).map(at).collect())
    }

    /// Mean over all wavelengths, weighted by `weight` of the wavelength in nm.
    pub(super) fn weighted_mean(&self, weight: impl Fn(f64) -> f64) -> f64 {
        let mut sums = (0.0, 0.0);
        for (nm, value) in (FIRST_NM..).zip(&self.0) {
            let weight = weight(f64::from(nm));
            sums = (sums.0 + weight * value, sums.1 + weight);
        }
        sums.0 / sums.1
    }

    /// CIE XYZ under D65, so that the perfect reflector has Y = 1.
    pub(super) fn xyz(&self) -> [f64; 3] {
        let mut sums = [0.0; 3];
        let mut white = 0.0;

        for ((observer, power), value) in OBSERVER.iter().zip(D65).zip(self.0.iter().step_by(STEP_NM)) {
            for (sum, sensitivity) in sums.iter_mut().zip(observer) {
                *sum += sensitivity * power * value;
            }
            white += observer[1] * power;
        }

        sums.map(|sum| sum / white)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_perfect_reflector_has_the_white_point_of_d65() {
        // CIE 015 with the 2-degree observer, summed in steps of 5 nm.
        for (found, expected) in Reflectance::from_fn(|_| 1.0).xyz().iter().zip([0.950_47, 1.0, 1.088_83]) {
            assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        }
    }

    #[test]
    fn a_narrow_line_has_the_chromaticity_of_the_spectral_locus() {
        // CIE 1931: 520 nm lies at x = 0.0743, y = 0.8338.
        let [x, y, z] = Reflectance::from_fn(|nm| f64::from(u8::from((nm - 520.0).abs() < 2.0))).xyz();
        assert!((x / (x + y + z) - 0.0743).abs() < 1e-3);
        assert!((y / (x + y + z) - 0.8338).abs() < 1e-3);
    }

    #[test]
    fn weighted_mean_of_a_ramp_is_the_middle_of_the_weight() {
        let ramp = Reflectance::from_fn(|nm| nm);
        assert!((ramp.weighted_mean(|nm| (-0.5 * ((nm - 520.5) / 8.0).powi(2)).exp()) - 520.5).abs() < 1e-6);
    }
}
