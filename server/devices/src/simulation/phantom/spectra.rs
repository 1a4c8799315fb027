//! Spectra of the phantom's materials: tissue as scatterer and haemoglobin, seen through the sensor's bands.
//!
//! Extinction: S. Prahl's compilation, "Tabulated molar extinction coefficient for hemoglobin in
//! water", Oregon Medical Laser Center. Scattering and the blood fraction's meaning: S. L. Jacques,
//! "Optical properties of biological tissues: a review", Phys. Med. Biol. 58 (2013) R37, doi
//! 10.1088/0031-9155/58/11/R37. Diffuse reflectance: S. T. Flock et al., "Monte Carlo modeling of
//! light propagation in highly scattering tissues", IEEE Trans. Biomed. Eng. 36 (1989) 1162.

/// Number of endmembers that are mixed into the phantom's surface.
pub const ENDMEMBERS: usize = 4;

/// Endmember: tissue with hardly any blood, such as dura.
pub const PALE: usize = 0;
/// Endmember: tissue full of oxygenated blood; alone, an artery.
pub const ARTERIAL: usize = 1;
/// Endmember: tissue full of partly deoxygenated blood; alone, a vein.
pub const VENOUS: usize = 2;
/// Endmember: the lamp mirrored by the wet surface.
pub const LAMP: usize = 3;

/// First wavelength of [`EXTINCTION`], nm.
const FIRST_NM: f64 = 440.0;
/// Step of [`EXTINCTION`], nm.
const STEP_NM: f64 = 4.0;
/// Molar extinction of oxygenated and deoxygenated haemoglobin, 1/(cm mol/l), from 440 nm in steps of
/// 4 nm (Prahl).
const EXTINCTION: [[f64; 2]; 46] = [
    [102_580.0, 413_280.0],
    [81_444.0, 282_724.0],
    [67_044.0, 173_320.0],
    [58_864.0, 62_640.0],
    [49_496.0, 30_698.8],
    [44_480.0, 23_388.8],
    [39_807.2, 19_260.8],
    [34_870.8, 17_025.6],
    [31_620.0, 15_310.0],
    [28_850.8, 14_792.8],
    [26_629.2, 14_550.0],
    [25_180.4, 15_212.4],
    [24_174.8, 15_898.0],
    [23_086.8, 17_469.6],
    [21_850.4, 19_041.2],
    [20_932.8, 20_862.0],
    [20_418.0, 22_803.6],
    [19_996.0, 24_745.2],
    [20_150.4, 26_936.8],
    [21_001.6, 29_263.2],
    [24_202.4, 31_589.6],
    [29_269.2, 34_397.6],
    [35_990.0, 37_490.0],
    [43_876.0, 40_584.0],
    [49_752.0, 43_592.0],
    [53_236.0, 46_592.0],
    [52_096.0, 49_708.0],
    [46_660.0, 52_496.0],
    [39_675.2, 54_080.0],
    [34_476.8, 54_540.0],
    [32_613.2, 53_788.0],
    [33_915.6, 50_572.0],
    [40_172.0, 46_948.0],
    [49_172.0, 43_340.0],
    [55_540.0, 40_092.0],
    [50_104.0, 37_020.0],
    [34_639.6, 34_332.8],
    [19_763.2, 31_075.2],
    [10_468.4, 25_470.0],
    [5_683.6, 19_800.0],
    [3_200.0, 14_677.2],
    [2_128.0, 12_567.6],
    [1_647.6, 10_477.6],
    [1_364.4, 8_591.2],
    [1_110.0, 7_344.8],
    [942.0, 6_509.6],
];

/// A tissue: how much blood it holds, and how oxygenated that is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tissue {
    /// Volume fraction of whole blood (150 g/l of haemoglobin).
    pub blood: f64,
    /// Share of the haemoglobin that carries oxygen.
    pub saturation: f64,
}

/// The tissues among the endmembers, in their order.
const TISSUES: [Tissue; 3] = [
    Tissue { blood: 0.005, saturation: 0.7 },
    Tissue { blood: 0.30, saturation: 0.97 },
    Tissue { blood: 0.30, saturation: 0.60 },
];

/// Diffuse reflectance, 0..1, of `tissue` at `nanometres`. Beyond 440..=620 nm, the extinction at the end of that range
/// is used.
///
/// Scattering is that of brain, 24.2 (lambda / 500 nm)^-1.611 per cm (Jacques 2013, table 2);
/// absorption is 2.303 * extinction * blood * 150 g/l / 64 500 g/mol (Prahl); the reflectance of the
/// half-space follows from the reduced albedo by diffusion theory at a matched boundary, as wet tissue
/// nearly is (Flock 1989).
pub fn reflectance(tissue: Tissue, nanometres: f64) -> f64 {
    let [oxygenated, deoxygenated] = extinction(nanometres);
    let molar = tissue.saturation * oxygenated + (1.0 - tissue.saturation) * deoxygenated;
    let absorption = std::f64::consts::LN_10 * molar * tissue.blood * 150.0 / 64_500.0;

    let scattering = 24.2 * (nanometres / 500.0).powf(-1.611);
    let albedo = scattering / (scattering + absorption);
    albedo / (1.0 + 2.0 * (1.0 - albedo) + (5.0 / 3.0) * (3.0 * (1.0 - albedo)).sqrt())
}

/// Reflectance of each endmember in a band of Gaussian response around `centre` nm, `fwhm` nm wide at
/// half height.
pub fn endmembers_in_band(centre: f64, fwhm: f64) -> [f64; ENDMEMBERS] {
    let sigma = fwhm / (8.0 * std::f64::consts::LN_2).sqrt();
    let mut sum = [0.0; ENDMEMBERS];
    let mut weights = 0.0;

    for step in -30..=30 {
        let offset = f64::from(step) / 10.0;
        let weight = (-0.5 * offset * offset).exp();
        weights += weight;

        for (sum, tissue) in sum.iter_mut().zip(TISSUES) {
            *sum += weight * reflectance(tissue, centre + offset * sigma);
        }
    }

    // The mirrored lamp is white: it reflects all light in every band.
    sum[LAMP] = weights;
    sum.map(|value| value / weights)
}

/// Extinction at a wavelength, linear between the table's entries.
fn extinction(nanometres: f64) -> [f64; 2] {
    let last = (EXTINCTION.len() - 1) as f64;
    let place = ((nanometres - FIRST_NM) / STEP_NM).clamp(0.0, last);
    let index = (place as usize).min(EXTINCTION.len() - 2);
    let part = place - index as f64;

    let low = EXTINCTION[index];
    let high = EXTINCTION[index + 1];
    [low[0] + part * (high[0] - low[0]), low[1] + part * (high[1] - low[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_blood_absorbs_as_published() {
        // Prahl: 2.303 * 53 236 * 150 / 64 500 = 285 per cm at 540 nm, so with a scattering of 21.4 per cm the reduced
        // albedo of pure oxygenated blood is 0.0698.
        let albedo: f64 = 0.0698;
        let expected = albedo / (1.0 + 2.0 * (1.0 - albedo) + 5.0 / 3.0 * (3.0 * (1.0 - albedo)).sqrt());
        let found = reflectance(Tissue { blood: 1.0, saturation: 1.0 }, 540.0);
        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
    }

    #[test]
    fn oxygenated_blood_has_its_two_dips() {
        // Absorption maxima of oxyhaemoglobin near 542 and 577 nm, a minimum near 560 nm between them.
        let artery = |nm| reflectance(TISSUES[ARTERIAL], nm);
        assert!(artery(542.0) < artery(560.0) && artery(576.0) < artery(560.0));
        let stale = |nm| reflectance(Tissue { blood: 0.3, saturation: 0.0 }, nm);
        assert!(
            stale(556.0) < stale(540.0) && stale(556.0) < stale(576.0),
            "deoxyhaemoglobin has one dip, near 555 nm"
        );
    }

    #[test]
    fn light_that_is_not_absorbed_comes_back() {
        let bloodless = Tissue { blood: 0.0, saturation: 1.0 };
        assert!((reflectance(bloodless, 500.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_mirrored_lamp_is_white_in_every_band() {
        for centre in [460.1, 532.0, 594.9] {
            assert!((endmembers_in_band(centre, 14.0)[LAMP] - 1.0).abs() < 1e-12);
        }
    }
}
