//! Reading a calibration from TOML text. Keys that are left out keep the default's value. References
//! per pixel are pictures in files of their own, which the caller reads.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use toml::{Spanned, Value};

use super::calibration::{BANDS, Band, Calibration, Reference, full_scale};
use super::frame::MosaicFrame;

/// Why a calibration could not be read. The caller knows the file and puts its name in front.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct CalibrationError(String);

impl Calibration {
    /// Reads a calibration:
    ///
    /// ```toml
    /// name = "CMV2K-SSM4X4-VIS"
    /// unit = "12"
    /// version = "3"
    /// date = "2026-03-01"
    /// bit_depth = 10
    /// centre_nm = [570.5, 576.9, 586.9, 594.9, 532.0, 544.4, 550.8, 560.0,
    ///              496.0, 503.0, 513.3, 524.1, 460.1, 468.5, 475.4, 484.5]
    /// fwhm_nm = [12.5, 16.3, 17.9, 16.3, 12.5, 17.4, 10.9, 16.6, 15.9, 18.3, 13.8, 17.4, 10.9, 9.2, 17.0, 10.1]
    /// dark = 32          # counts: one for all bands, or a list of 16
    /// white = "white-3.tiff"        # the same, or the name of a 16-bit picture with a count a pixel
    /// # spectral_correction = 16 rows of 16
    /// ```
    ///
    /// # Errors
    /// If the text is not TOML, a key is unknown, or a value is invalid. The error names the line and the key.
    pub fn from_toml(text: &str) -> Result<Self, CalibrationError> {
        let no_pictures =
            "a count, or a list of 16; the name of a picture is only allowed in a calibration that is read from a file";
        Self::default().changed_by_toml(text, |_| Err(format!("must be {no_pictures}")))
    }

    /// This calibration with the values of the keys that `text` has. `picture` reads the reference picture of a given
    /// name, or says what is wrong with it.
    ///
    /// # Errors
    /// As [`Calibration::from_toml`], and if a picture cannot be read or does not fit.
    pub fn changed_by_toml(
        self,
        text: &str,
        picture: impl Fn(&str) -> Result<MosaicFrame, String>,
    ) -> Result<Self, CalibrationError> {
        let mut keys = Keys::parse(text)?;
        let mut calibration = self;

        if let Some(name) = keys.text("name")? {
            calibration.name = name;
        }
        if let Some(version) = keys.text("version")? {
            calibration.version = version;
        }
        calibration.unit = keys.text("unit")?.or(calibration.unit);
        calibration.date = keys.text("date")?.or(calibration.date);

        let bit_depth =
            keys.take::<u8>("bit_depth", "a whole number", |&bits| check((8..=16).contains(&bits), "must be 8 to 16"))?;
        if let Some(bit_depth) = bit_depth.filter(|&bits| bits != calibration.bit_depth) {
            calibration.bit_depth = bit_depth;
            // White follows the bit depth unless the text gives its own counts.
            calibration.white = Reference::PerBand([full_scale(bit_depth); BANDS]);
        }

        keys.bands(&mut calibration.bands)?;
        keys.references(&mut calibration, &picture)?;

        if let Some(rows) = keys.take("spectral_correction", "16 rows of 16 numbers", |rows: &Rows| {
            check(rows.iter().flatten().all(|value| value.is_finite()), "must be 16 rows of 16 finite numbers")
        })? {
            calibration.correction = rows;
        }

        keys.none_left()?;
        Ok(calibration)
    }
}

type Rows = [[f32; BANDS]; BANDS];

fn check(holds: bool, problem: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(problem.to_owned()) }
}

/// The keys not yet taken, and their places in the text.
struct Keys<'a> {
    text: &'a str,
    values: BTreeMap<String, Spanned<Value>>,
}

impl<'a> Keys<'a> {
    fn parse(text: &'a str) -> Result<Self, CalibrationError> {
        let values = toml::from_str(text).map_err(|error| {
            let line = error.span().map_or(1, |span| line_of(text, span.start));
            CalibrationError(format!("line {line}: {}", error.message()))
        })?;
        Ok(Self { text, values })
    }

    fn error(&self, key: &str, at: usize, problem: &str) -> CalibrationError {
        CalibrationError(format!("line {}, key '{key}': {problem}", line_of(self.text, at)))
    }

    /// Removes `key` and reads its value as a `T` that passes `check`. `None` if the key is absent.
    fn take<T: DeserializeOwned>(
        &mut self,
        key: &str,
        expected: &str,
        check: impl FnOnce(&T) -> Result<(), String>,
    ) -> Result<Option<T>, CalibrationError> {
        let Some(value) = self.values.remove(key) else { return Ok(None) };

        let at = value.span().start;
        let read = value.into_inner().try_into::<T>();
        let read = read.map_err(|error| self.error(key, at, &format!("must be {expected}: {}", error.message())))?;

        check(&read).map_err(|problem| self.error(key, at, &problem))?;
        Ok(Some(read))
    }

    fn text(&mut self, key: &str) -> Result<Option<String>, CalibrationError> {
        self.take(key, "text", |text: &String| check(!text.trim().is_empty(), "must not be empty"))
    }

    fn bands(&mut self, bands: &mut [Band; BANDS]) -> Result<(), CalibrationError> {
        let in_range = |low: f64, high: f64| {
            move |values: &[f64; BANDS]| {
                let holds = values.iter().all(|value| (low..=high).contains(value));
                check(holds, &format!("every value must be between {low} and {high} nm"))
            }
        };

        if let Some(centres) = self.take("centre_nm", "16 wavelengths in nm", in_range(380.0, 780.0))? {
            bands.iter_mut().zip(centres).for_each(|(band, centre)| band.centre_nm = centre);
        }

        if let Some(widths) = self.take("fwhm_nm", "16 widths in nm", in_range(1.0, 100.0))? {
            bands.iter_mut().zip(widths).for_each(|(band, width)| band.fwhm_nm = width);
        }

        Ok(())
    }

    fn references(
        &mut self,
        calibration: &mut Calibration,
        picture: &impl Fn(&str) -> Result<MosaicFrame, String>,
    ) -> Result<(), CalibrationError> {
        let most = calibration.full_scale();
        let places = ["dark", "white"].map(|key| self.values.get(key).map_or(0, |value| value.span().start));

        // White must be at least a count above dark: a smaller span would amplify noise without bound.
        let dark = match self.picture("dark", most, picture)? {
            Some(dark) => Some(dark),
            None => self.counts("dark", |dark| {
                let holds = dark.iter().all(|count| (0.0..=most - 1.0).contains(count));
                check(holds, &format!("every count must be between 0 and {}", most - 1.0))
            })?,
        };

        let above_dark = format!("every count must be above that band's dark by 1 or more, and at most {most}");
        let white = match self.picture("white", most, picture)? {
            Some(white) => Some(white),
            None => self.counts("white", |white| {
                let holds = white.iter().all(|count| (0.0..=most).contains(count));
                check(holds, &above_dark)
            })?,
        };

        if let Some(dark) = dark {
            calibration.dark = dark;
        }
        if let Some(white) = white {
            calibration.white = white;
        }

        let dark_means = calibration.dark.band_means();
        let white_means = calibration.white.band_means();
        if !white_means.iter().zip(&dark_means).all(|(white, dark)| *white >= dark + 1.0) {
            return Err(self.error("white", places[1], &above_dark));
        }

        match calibration.size() {
            Some((width, height)) if !calibration.fits(width, height) => {
                Err(self.error("white", places[1], "must be a picture of the size of the dark one"))
            }
            _ => Ok(()),
        }
    }

    /// The reference picture that `key` names, if its value is text.
    fn picture(
        &mut self,
        key: &str,
        most: f32,
        read: &impl Fn(&str) -> Result<MosaicFrame, String>,
    ) -> Result<Option<Reference>, CalibrationError> {
        let Some(value) = self.values.get(key).filter(|value| value.get_ref().is_str()) else { return Ok(None) };
        let at = value.span().start;
        let name = self.text(key)?.unwrap_or_default();
        let frame = read(&name).map_err(|problem| self.error(key, at, &problem))?;

        if frame.samples().iter().any(|&sample| f32::from(sample) > most) {
            return Err(self.error(key, at, &format!("{name} has counts above {most}, the limit of the bit depth")));
        }

        Ok(Some(Reference::PerPixel(frame)))
    }

    /// Counts of `key`: one for all bands, or a list of 16. `None` if the key is absent.
    fn counts(
        &mut self,
        key: &str,
        check: impl FnOnce(&[f32; BANDS]) -> Result<(), String>,
    ) -> Result<Option<Reference>, CalibrationError> {
        let single = self.values.get(key).and_then(|value| match value.get_ref() {
            Value::Integer(_) | Value::Float(_) => Some(value.get_ref().clone()),
            _ => None,
        });
        // One count becomes a list of 16 in place, so that both forms are read and checked alike.
        if let (Some(single), Some(value)) = (single, self.values.get_mut(key)) {
            *value.get_mut() = Value::Array(vec![single; BANDS]);
        }

        Ok(self.take(key, "a count, or a list of 16", check)?.map(Reference::PerBand))
    }

    fn none_left(&self) -> Result<(), CalibrationError> {
        let Some((key, value)) = self.values.first_key_value() else { return Ok(()) };
        let known = "name, unit, version, date, bit_depth, centre_nm, fwhm_nm, dark, white, spectral_correction";
        Err(self.error(key, value.span().start, &format!("is not a key of a calibration; the keys are: {known}")))
    }
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&byte| byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        Calibration::from_toml(text).unwrap_err().to_string()
    }

    #[test]
    fn keys_left_out_keep_the_default() {
        assert_eq!(Calibration::from_toml("").unwrap(), Calibration::default());
    }

    #[test]
    fn reads_every_key() {
        let list =
            |first: f64, step: f64| format!("{:?}", (0..16).map(|i| first + step * f64::from(i)).collect::<Vec<_>>());

        let rows = format!("{:?}", [[0.5_f32; BANDS]; BANDS]);
        let text = format!(
            "name = 'unit 12'\nversion = 'b'\nbit_depth = 12\ncentre_nm = {}\nfwhm_nm = {}\ndark = 60\nwhite = {}\n\
             spectral_correction = {rows}\n",
            list(460.0, 8.0),
            list(10.0, 0.5),
            list(3000.0, 10.0),
        );

        let read = Calibration::from_toml(&text).unwrap();
        assert_eq!((read.name.as_str(), read.version.as_str(), read.bit_depth), ("unit 12", "b", 12));
        assert_eq!(read.bands[2], Band { centre_nm: 476.0, fwhm_nm: 11.0 });

        assert_eq!(read.dark, Reference::PerBand([60.0; BANDS]));
        assert!((read.white.band_means()[15] - 3150.0).abs() < 1e-3);
        assert_eq!(read.correction, [[0.5; BANDS]; BANDS]);
    }

    #[test]
    fn white_follows_the_bit_depth() {
        let read = Calibration::from_toml("bit_depth = 8").unwrap();
        assert_eq!(read.white, Reference::PerBand([255.0; BANDS]));
    }

    #[test]
    fn errors_name_line_and_key() {
        assert_eq!(message("name = 'a'\nbit_depth = 99\n"), "line 2, key 'bit_depth': must be 8 to 16");
        assert!(message("\n\nwhite = 'bright'").starts_with("line 3, key 'white': must be a count, or a list of 16"));
        assert!(message("dark = [1, 2]").starts_with("line 1, key 'dark': must be a count, or a list of 16"));
        assert!(
            message("dark = 900\nwhite = 800")
                .starts_with("line 2, key 'white': every count must be above that band's dark")
        );
        assert!(message("dark = 100\nwhite = 100.0001").contains("by 1 or more"));
        assert!(message("white = 'white.tiff'").contains("read from a file"));
        assert!(message("white = 2000").ends_with("by 1 or more, and at most 1023"));
        assert!(message("name = 'a'\nwhtie = 1").starts_with("line 2, key 'whtie': is not a key"));
        assert!(message("centre_nm = [nan]").contains("key 'centre_nm'"));
        assert!(message("name = 'a'\n= 3").starts_with("line 2: "));
    }

    #[test]
    fn a_dark_at_the_default_white_is_refused() {
        assert_eq!(message("dark = 1023"), "line 1, key 'dark': every count must be between 0 and 1022");
    }
}
