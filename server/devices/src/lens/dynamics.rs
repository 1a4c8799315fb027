//! The measured dynamics of a lens, stored in a file.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::LensDynamics;

/// The results of `parfocal lens measure` (`dynamics.toml`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredDynamics {
    /// Name of the lens's driver.
    pub driver: String,
    /// Serial number of the lens. The file is rejected for any other lens.
    pub serial: String,
    /// Date of the measurement, UTC.
    pub date: String,
    /// Milliseconds from the command to the first movement.
    pub delay_ms: f64,
    /// Milliseconds from the first movement to within 5 % of the step.
    pub settling_ms: f64,
    /// Hysteresis, 0..=1: distance between the focal powers, on the way up and on the way down, at which the picture
    /// looks the same.
    pub hysteresis: f64,
}

impl MeasuredDynamics {
    /// Longest plausible delay or settling time: ten seconds.
    const LONGEST_MS: f64 = 10_000.0;

    /// Parses the file's `text`.
    ///
    /// # Errors
    /// If the text is not such a file. The error says what is wrong.
    pub fn from_toml(text: &str) -> Result<Self, String> {
        let read: Self = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        let believed = |value: f64| (0.0..=Self::LONGEST_MS).contains(&value);
        if !believed(read.delay_ms) || !believed(read.settling_ms) {
            return Err(format!("delay_ms and settling_ms must be from 0 to {}", Self::LONGEST_MS));
        }
        Ok(read)
    }

    /// The text of the file, as TOML.
    ///
    /// # Errors
    /// If it cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// The dynamics as the control loop uses them.
    pub fn dynamics(&self) -> LensDynamics {
        let millis = |value: f64| Duration::from_secs_f64(value.clamp(0.0, Self::LONGEST_MS) / 1000.0);
        LensDynamics { delay: millis(self.delay_ms), settling: millis(self.settling_ms) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dynamics_survive_writing_and_nonsense_is_refused() {
        let measured = MeasuredDynamics {
            driver: "Optotune Lens Driver 4".into(),
            serial: "AREA0042".into(),
            date: "2026-03-01T10:00:00Z".into(),
            delay_ms: 3.25,
            settling_ms: 15.5,
            hysteresis: 0.008,
        };

        let text = measured.to_toml().unwrap();
        assert_eq!(MeasuredDynamics::from_toml(&text).unwrap(), measured);
        assert_eq!(measured.dynamics().delay, Duration::from_micros(3250));
        assert!(MeasuredDynamics::from_toml(&text.replace("3.25", "-1.0")).unwrap_err().contains("from 0 to"));
        assert!(MeasuredDynamics::from_toml(&text.replace("3.25", "nan")).is_err());
        assert!(MeasuredDynamics::from_toml("delay_ms = 3").unwrap_err().contains("missing field"));
    }
}
