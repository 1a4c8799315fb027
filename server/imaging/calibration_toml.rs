//! Reading a calibration from TOML text. Keys that are left out keep the default's value.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use toml::{Spanned, Value};

use super::calibration::{BANDS, Band, Calibration, Reference, full_scale};

/// Why a calibration could not be read. The caller knows the file and says its name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CalibrationError {
    /// The text is not TOML.
    #[error("line {line}: {problem}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// A key is unknown, or its value cannot be.
    #[error("line {line}, key '{key}': {problem}")]
    Key {
        /// Line of the value, from 1.
        line: usize,
        /// The key.
        key: String,
        /// What is wrong with it.
        problem: String,
    },
}

impl Calibration {
    /// Reads a calibration:
    ///
    /// ```toml
    /// name = "unit 12"
    /// version = "2026-03-01"
    /// bit_depth = 10
    /// centre_nm = [570.5, 576.9, 586.9, 594.9, 532.0, 544.4, 550.8, 560.0,
    ///              496.0, 503.0, 513.3, 524.1, 460.1, 468.5, 475.4, 484.5]
    /// fwhm_nm = [12.5, 16.3, 17.9, 16.3, 12.5, 17.4, 10.9, 16.6, 15.9, 18.3, 13.8, 17.4, 10.9, 9.2, 17.0, 10.1]
    /// dark = 32          # counts: one for all bands, or a list of 16
    /// white = 900        # the same
    /// # spectral_correction = 16 rows of 16
    /// ```
    ///
    /// # Errors
    /// For text that is not TOML, an unknown key, or a value that cannot be; it names the line and the key.
    pub fn from_toml(text: &str) -> Result<Self, CalibrationError> {
        let mut keys = Keys::parse(text)?;
        let mut calibration = Self::default();
        if let Some(name) = keys.text("name")? {
            calibration.name = name;
        }
        if let Some(version) = keys.text("version")? {
            calibration.version = version;
        }
        if let Some(bit_depth) =
            keys.take::<u8>("bit_depth", "a whole number", |&bits| check((8..=16).contains(&bits), "must be 8 to 16"))?
        {
            calibration.bit_depth = bit_depth;
            calibration.white = Reference::PerBand([full_scale(bit_depth); BANDS]);
        }
        keys.bands(&mut calibration.bands)?;
        keys.references(&mut calibration)?;
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

/// The keys not yet taken, and where they stand.
struct Keys<'a> {
    text: &'a str,
    values: BTreeMap<String, Spanned<Value>>,
}

impl<'a> Keys<'a> {
    fn parse(text: &'a str) -> Result<Self, CalibrationError> {
        let values = toml::from_str(text).map_err(|error| CalibrationError::Syntax {
            line: error.span().map_or(1, |span| line_of(text, span.start)),
            problem: error.message().to_owned(),
        })?;
        Ok(Self { text, values })
    }

    fn error(&self, key: &str, at: usize, problem: String) -> CalibrationError {
        CalibrationError::Key { line: line_of(self.text, at), key: key.to_owned(), problem }
    }

    /// Takes `key` out, read as a `T` that passes `check`.
    fn take<T: DeserializeOwned>(
        &mut self,
        key: &str,
        expected: &str,
        check: impl FnOnce(&T) -> Result<(), String>,
    ) -> Result<Option<T>, CalibrationError> {
        let Some(value) = self.values.remove(key) else { return Ok(None) };
        let at = value.span().start;
        let read = value.into_inner().try_into::<T>();
        let read = read.map_err(|error| self.error(key, at, format!("must be {expected}: {}", error.message())))?;
        check(&read).map_err(|problem| self.error(key, at, problem))?;
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

    fn references(&mut self, calibration: &mut Calibration) -> Result<(), CalibrationError> {
        let most = calibration.full_scale();
        // White must be a count above dark at least: a smaller span would blow noise up without bound.
        let dark = self.counts("dark", |dark| {
            let holds = dark.iter().all(|count| (0.0..=most - 1.0).contains(count));
            check(holds, &format!("every count must be between 0 and {}", most - 1.0))
        })?;
        let dark = dark.unwrap_or(calibration.dark.band_means());
        let white = self.counts("white", |white| {
            let holds = white.iter().zip(&dark).all(|(white, dark)| (dark + 1.0..=most).contains(white));
            check(holds, &format!("every count must be above that band's dark by 1 or more, and at most {most}"))
        })?;
        calibration.dark = Reference::PerBand(dark);
        if let Some(white) = white {
            calibration.white = Reference::PerBand(white);
        }
        Ok(())
    }

    /// One count for all bands, or a list of 16.
    fn counts(
        &mut self,
        key: &str,
        check: impl FnOnce(&[f32; BANDS]) -> Result<(), String>,
    ) -> Result<Option<[f32; BANDS]>, CalibrationError> {
        let single = self.values.get(key).and_then(|value| match value.get_ref() {
            Value::Integer(_) | Value::Float(_) => Some(value.get_ref().clone()),
            _ => None,
        });
        if let (Some(single), Some(value)) = (single, self.values.get_mut(key)) {
            *value.get_mut() = Value::Array(vec![single; BANDS]);
        }
        self.take(key, "a count, or a list of 16", check)
    }

    fn none_left(&self) -> Result<(), CalibrationError> {
        let Some((key, value)) = self.values.first_key_value() else { return Ok(()) };
        let known = "name, version, bit_depth, centre_nm, fwhm_nm, dark, white, spectral_correction";
        Err(self.error(key, value.span().start, format!("is not a key of a calibration; there are: {known}")))
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
