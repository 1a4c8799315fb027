//! Writing a calibration as TOML text, as [`Calibration::changed_by_toml`] reads it.

use std::fmt::Write;

use toml::Value;

use super::calibration::{BANDS, Calibration, Reference};

impl Calibration {
    /// The calibration as TOML. References per pixel are pictures: `dark` and `white` are the names
    /// of the files in which the caller keeps them.
    pub fn to_toml(&self, dark: &str, white: &str) -> String {
        let mut text = String::new();
        let mut put = |key: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{key} = {value}");
        };

        put("name", quoted(&self.name));
        if let Some(unit) = &self.unit {
            put("unit", quoted(unit));
        }

        put("version", quoted(&self.version));
        if let Some(date) = &self.date {
            put("date", quoted(date));
        }

        put("bit_depth", self.bit_depth.to_string());
        put("centre_nm", format!("{:?}", self.bands.map(|band| band.centre_nm)));
        put("fwhm_nm", format!("{:?}", self.bands.map(|band| band.fwhm_nm)));
        put("dark", reference(&self.dark, dark));
        put("white", reference(&self.white, white));

        let rows: Vec<String> = self.correction.iter().map(|row: &[f32; BANDS]| format!("  {row:?},\n")).collect();
        put("spectral_correction", format!("[\n{}]", rows.concat()));

        text
    }
}

fn quoted(text: &str) -> String {
    Value::String(text.to_owned()).to_string()
}

fn reference(reference: &Reference, name: &str) -> String {
    match reference {
        Reference::PerBand(counts) => format!("{counts:?}"),
        Reference::PerPixel(_) => quoted(name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MosaicFrame;

    #[test]
    fn a_calibration_survives_writing_and_reading() {
        let white = MosaicFrame::new(8, 4, vec![900; 32]).unwrap();
        let mut calibration = Calibration {
            name: "a \"quoted\" name".into(),
            unit: Some("12".into()),
            version: "3".into(),
            date: Some("2026-03-01".into()),
            dark: Reference::PerBand([3.25; BANDS]),
            white: Reference::PerPixel(white.clone()),
            ..Calibration::default()
        };
        calibration.correction[3][5] = -0.125;

        let text = calibration.to_toml("dark.tiff", "white.tiff");
        let read = Calibration::default().changed_by_toml(&text, |name| {
            assert_eq!(name, "white.tiff");
            Ok(white.clone())
        });
        assert_eq!(read.unwrap(), calibration);
    }
}
