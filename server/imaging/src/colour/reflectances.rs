//! The reflectances over which bands are fitted to colours: smooth edges and hills, and perfused tissue.

use super::cie::Reflectance;

/// Molar extinction of oxygenated and of deoxygenated haemoglobin in 1/(cm M), from 400 to 700 nm in
/// steps of 10 nm: S. Prahl, "Tabulated molar extinction coefficient for hemoglobin in water", Oregon
/// Medical Laser Center, 1998.
#[rustfmt::skip]
const HAEMOGLOBIN: [[f64; 2]; 31] = [
    [266_232.0, 223_296.0], [466_840.0, 303_956.0], [480_360.0, 407_560.0], [246_072.0, 528_600.0],
    [102_580.0, 413_280.0], [62_816.0, 103_292.0], [44_480.0, 23_388.8], [33_209.2, 16_156.4], [26_629.2, 14_550.0],
    [23_684.4, 16_684.0], [20_932.8, 20_862.0], [20_035.2, 25_773.6], [24_202.4, 31_589.6], [39_956.8, 39_036.4],
    [53_236.0, 46_592.0], [43_016.0, 53_412.0], [32_613.2, 53_788.0], [44_496.0, 45_072.0], [50_104.0, 37_020.0],
    [14_400.8, 28_324.4], [3_200.0, 14_677.2], [1_506.0, 9_443.6], [942.0, 6_509.6], [610.0, 5_148.8],
    [442.0, 4_345.2], [368.0, 3_750.1], [319.6, 3_226.6], [294.0, 2_795.1], [277.6, 2_407.9], [276.0, 2_052.0],
    [290.0, 1_794.3],
];

/// Haemoglobin in whole blood in mol/l: 150 g/l at 64 500 g/mol (as in the source of [`HAEMOGLOBIN`]).
const BLOOD_MOLAR: f64 = 150.0 / 64_500.0;

/// All reflectances that the fit uses.
pub(super) fn reflectances() -> Vec<Reflectance> {
    let mut set = vec![Reflectance::from_fn(|_| 1.0)];

    for centre in (420..=680).step_by(20).map(f64::from) {
        for width in [8.0, 20.0] {
            set.push(edge(centre, width));
            set.push(edge(centre, -width));
        }
        for width in [12.0, 25.0, 50.0, 100.0] {
            set.push(Reflectance::from_fn(|nm| 0.1 + 0.8 * hill(nm, centre, width)));
            set.push(Reflectance::from_fn(|nm| 0.9 - 0.8 * hill(nm, centre, width)));
        }
    }

    for blood_fraction in [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0] {
        for saturation in [0.3, 0.6, 0.8, 1.0] {
            for scattering in [10.0, 20.0, 40.0] {
                set.push(tissue(blood_fraction, saturation, scattering));
            }
        }
    }

    set
}

/// A logistic edge at `centre`, rising towards longer wavelengths for a positive `width` (both in nm).
fn edge(centre: f64, width: f64) -> Reflectance {
    Reflectance::from_fn(|nm| 0.05 + 0.85 / (1.0 + ((centre - nm) / width).exp()))
}

fn hill(nm: f64, centre: f64, width: f64) -> f64 {
    (-0.5 * ((nm - centre) / width).powi(2)).exp()
}

/// Diffuse reflectance of thick tissue with blood of `saturation` filling `blood_fraction` of it, and
/// reduced scattering `scattering` (1/cm) at 500 nm that falls with wavelength to the power 1.6, as
/// in brain (S. Jacques, "Optical properties of biological tissues: a review", Phys. Med. Biol. 58,
/// R37, 2013). Kubelka-Munk with K = 2 absorption and S = 3/4 reduced scattering.
pub(super) fn tissue(blood_fraction: f64, saturation: f64, scattering: f64) -> Reflectance {
    Reflectance::from_fn(|nm| {
        let [oxygenated, deoxygenated] = extinction(nm);
        let extinction = saturation * oxygenated + (1.0 - saturation) * deoxygenated;
        let absorption = std::f64::consts::LN_10 * extinction * BLOOD_MOLAR * blood_fraction;
        let ratio = 2.0 * absorption / (0.75 * scattering * (nm / 500.0).powf(-1.6));
        1.0 + ratio - (ratio * ratio + 2.0 * ratio).sqrt()
    })
}

fn extinction(nm: f64) -> [f64; 2] {
    let place = ((nm - 400.0) / 10.0).clamp(0.0, 29.999_999);
    let index = place as usize;
    let part = place.fract();
    std::array::from_fn(|form| (1.0 - part) * HAEMOGLOBIN[index][form] + part * HAEMOGLOBIN[index + 1][form])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reflectance_is_between_nothing_and_all() {
        for spectrum in reflectances() {
            let [x, y, z] = spectrum.xyz();
            assert!(x > 0.0 && z > 0.0 && y > 0.0 && y <= 1.0 + 1e-9, "{y}");
        }
    }

    #[test]
    fn oxygenated_tissue_has_haemoglobins_two_dips() {
        let at = |nm: f64| tissue(0.05, 1.0, 20.0).weighted_mean(|x| f64::from(u8::from((x - nm).abs() < 0.5)));
        assert!(at(540.0) < at(560.0) && at(580.0) < at(560.0), "dips near 542 and 577 nm, a hill near 560 nm");
        assert!(at(620.0) > 2.0 * at(580.0), "far more red than yellow");
    }
}
