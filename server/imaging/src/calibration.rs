//! A sensor's calibration: what each band of the mosaic senses and how its counts become reflectances.

use serde::Serialize;

use super::frame::MosaicFrame;

/// Bands in one mosaic cell.
pub const BANDS: usize = 16;

/// The response of one band of the mosaic: a Gaussian in wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// Centre wavelength in nm.
    pub centre_nm: f64,
    /// Full width at half maximum in nm.
    pub fwhm_nm: f64,
}

/// Counts of a reference exposure: no light (dark), or a white target under the light in use (white).
#[derive(Debug, Clone, PartialEq)]
pub enum Reference {
    /// One count per band, in the order of [`MosaicFrame`].
    PerBand([f32; BANDS]),
    /// One count per pixel: the mean of several exposures.
    PerPixel(MosaicFrame),
}

/// How one sensor's counts become reflectances and colours. Band = 4 * row + column of the mosaic cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Name of the sensor.
    pub name: String,
    /// Serial number of the sensor's unit, if it is known.
    pub unit: Option<String>,
    /// Version of that unit's calibration; counts up with every change.
    pub version: String,
    /// Date of the last change, if known.
    pub date: Option<String>,
    /// Significant bits of a sample, 8..=16.
    pub bit_depth: u8,
    /// The bands' responses.
    pub bands: [Band; BANDS],
    /// Counts without light.
    pub dark: Reference,
    /// Counts of a white target.
    pub white: Reference,
    /// Spectral correction: row `i` makes corrected band `i` from the 16 white-balanced bands.
    pub correction: [[f32; BANDS]; BANDS],
}

/// Centre and full width at half maximum of one calibrated CMV2K-SSM4X4-VIS sensor (460 to 600 nm version), in nm.
const DEFAULT_BANDS: [(f64, f64); BANDS] = [
    (570.5, 12.5),
    (576.9, 16.3),
    (586.9, 17.9),
    (594.9, 16.3),
    (532.0, 12.5),
    (544.4, 17.4),
    (550.8, 10.9),
    (560.0, 16.6),
    (496.0, 15.9),
    (503.0, 18.3),
    (513.3, 13.8),
    (524.1, 17.4),
    (460.1, 10.9),
    (468.5, 9.2),
    (475.4, 17.0),
    (484.5, 10.1),
];

impl Default for Calibration {
    /// The bands of one calibrated unit, 10 bit. Every unit ships with its own calibration. Until it is given, there is
    /// no dark offset, white is full scale in every band, and nothing is corrected.
    fn default() -> Self {
        Self {
            name: "CMV2K-SSM4X4-VIS 460-600 nm".to_owned(),
            unit: None,
            version: "default".to_owned(),
            date: None,
            bit_depth: 10,
            bands: DEFAULT_BANDS.map(|(centre_nm, fwhm_nm)| Band { centre_nm, fwhm_nm }),
            dark: Reference::PerBand([0.0; BANDS]),
            white: Reference::PerBand([full_scale(10); BANDS]),
            correction: identity(),
        }
    }
}

impl Calibration {
    /// Whether per-pixel references, if any, are `width` x `height` sensor pixels, as a camera's frames must be.
    pub fn fits(&self, width: usize, height: usize) -> bool {
        self.sizes().all(|size| size == (width, height))
    }

    /// Whether a white target was measured. Without, counts say nothing about reflectance.
    pub fn has_white(&self) -> bool {
        self.white != Reference::PerBand([self.full_scale(); BANDS])
    }

    /// How exports and reports name it: name, unit, version and date.
    pub fn title(&self) -> String {
        let unit = self.unit.as_ref().map_or(String::new(), |unit| format!(", unit {unit}"));
        let date = self.date.as_ref().map_or(String::new(), |date| format!(" of {date}"));
        format!("{}{unit}, version {}{date}", self.name, self.version)
    }

    /// Size of its references per pixel, width and height in samples, if it has any.
    pub fn size(&self) -> Option<(usize, usize)> {
        self.sizes().next()
    }

    /// Width and height of each reference per pixel, in samples.
    fn sizes(&self) -> impl Iterator<Item = (usize, usize)> {
        [&self.dark, &self.white].into_iter().filter_map(|reference| match reference {
            Reference::PerBand(_) => None,
            Reference::PerPixel(frame) => Some((frame.width(), frame.height())),
        })
    }

    /// The largest count a sample can have.
    pub fn full_scale(&self) -> f32 {
        full_scale(self.bit_depth)
    }
}

impl Reference {
    /// Mean count of each band.
    pub fn band_means(&self) -> [f32; BANDS] {
        let frame = match self {
            Self::PerBand(counts) => return *counts,
            Self::PerPixel(frame) => frame,
        };

        let mut sums = [0_u64; BANDS];
        for (y, row) in frame.samples().chunks_exact(frame.width()).enumerate() {
            for (x, &sample) in row.iter().enumerate() {
                sums[4 * (y % 4) + x % 4] += u64::from(sample);
            }
        }

        let cells = (frame.band_width() * frame.band_height()) as f64;
        sums.map(|sum| (sum as f64 / cells) as f32)
    }
}

pub(super) fn full_scale(bit_depth: u8) -> f32 {
    f32::from(u16::MAX >> (16 - u32::from(bit_depth.clamp(1, 16))))
}

pub(super) fn identity() -> [[f32; BANDS]; BANDS] {
    std::array::from_fn(|row| std::array::from_fn(|column| if row == column { 1.0 } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_is_ten_bit_with_the_published_bands() {
        let calibration = Calibration::default();
        assert!((calibration.full_scale() - 1023.0).abs() < f32::EPSILON);

        let centre = |row: usize, column: usize| calibration.bands[4 * row + column].centre_nm;
        assert_eq!((centre(0, 0), centre(1, 2), centre(3, 3)).0.to_bits(), 570.5_f64.to_bits());
        assert!((centre(1, 2) - 550.8).abs() < 1e-9 && (centre(3, 3) - 484.5).abs() < 1e-9);
    }

    #[test]
    fn band_means_follow_the_mosaic() {
        let samples = (0..8 * 4).map(|i| if i % 8 < 4 { 10 } else { 30 + i / 8 }).collect();
        let reference = Reference::PerPixel(MosaicFrame::new(8, 4, samples).unwrap());
        let means = reference.band_means();
        assert!((means[0] - 20.0).abs() < 1e-6, "mean of 10 and 30");
        assert!((means[13] - 21.5).abs() < 1e-6, "mean of 10 and 33");
    }

    #[test]
    fn references_must_have_the_size_of_the_frames() {
        let dark = Reference::PerPixel(MosaicFrame::new(8, 4, vec![1; 32]).unwrap());
        let calibration = Calibration { dark, ..Calibration::default() };
        assert!(calibration.fits(8, 4) && !calibration.fits(8, 8));
        assert!(Calibration::default().fits(2048, 1088));
    }
}
