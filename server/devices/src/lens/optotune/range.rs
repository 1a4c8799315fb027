//! Converts between dioptres, the driver's own units, and focal power 0..=1. No other module does.

use super::codec::Limits;
use crate::lens::LensError;
use parfocal_base::FocalPower;

/// Driver's units per dioptre.
const PER_DIOPTRE: f64 = 200.0;

/// The driver's scale of focal power: `(dioptres + offset) * 200`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    offset: f64,
}

impl Scale {
    /// The scale of a firmware type: `A` adds an offset of five dioptres, the others none.
    pub const fn of_firmware(letter: u8) -> Self {
        Self { offset: if letter == b'A' { 5.0 } else { 0.0 } }
    }

    /// Converts `raw` to dioptres.
    pub fn dioptre(self, raw: i16) -> f64 {
        f64::from(raw) / PER_DIOPTRE - self.offset
    }

    /// Converts `dioptre` to the driver's units, not rounded.
    fn raw(self, dioptre: f64) -> f64 {
        (dioptre + self.offset) * PER_DIOPTRE
    }
}

/// The part of the lens's range that corresponds to focal power 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    scale: Scale,
    min: i16,
    max: i16,
}

impl Range {
    /// The range that the device allows, narrowed to the configured dioptres.
    ///
    /// # Errors
    /// If the range of the device or the narrowed range is empty.
    pub fn new(
        scale: Scale,
        device: Limits,
        min_dioptre: Option<f64>,
        max_dioptre: Option<f64>,
    ) -> Result<Self, LensError> {
        if device.min >= device.max {
            return Err(LensError::Refused(
                "it can hold no focal power at all temperatures from low to high: bring them closer together".into(),
            ));
        }

        let bound = |raw: f64| raw.clamp(f64::from(i16::MIN), f64::from(i16::MAX));
        // Rounded inwards, so that the range does not exceed the dioptres asked for.
        let min = min_dioptre.map_or(device.min, |dioptre| device.min.max(whole(bound(scale.raw(dioptre)).ceil())));
        let max = max_dioptre.map_or(device.max, |dioptre| device.max.min(whole(bound(scale.raw(dioptre)).floor())));

        if min < max {
            return Ok(Self { scale, min, max });
        }

        Err(LensError::Refused(format!(
            "it reaches {:.2} to {:.2} dpt, all of it outside min and max: change them",
            scale.dioptre(device.min),
            scale.dioptre(device.max)
        )))
    }

    /// Converts `power` to the driver's units, never outside the range that the device allows.
    pub fn raw(self, power: FocalPower) -> i16 {
        let min = f64::from(self.min);
        let max = f64::from(self.max);
        whole((min + power.get() * (max - min)).round())
    }

    /// Converts `raw` to the nearest focal power.
    pub fn focal_power(self, raw: i16) -> FocalPower {
        let min = f64::from(self.min);
        let max = f64::from(self.max);
        FocalPower::nearest((f64::from(raw) - min) / (max - min))
    }

    /// Dioptres at focal power 0.
    pub fn min_dioptre(self) -> f64 {
        self.scale.dioptre(self.min)
    }

    /// Dioptres at focal power 1.
    pub fn max_dioptre(self) -> f64 {
        self.scale.dioptre(self.max)
    }
}

/// Converts to whole units. Callers round `value` and keep it within the bounds of `i16`.
const fn whole(value: f64) -> i16 {
    value as i16
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const FIVE_TO_TEN: Limits = Limits { status: 0, max: 3000, min: 2000 };

    fn range(min: Option<f64>, max: Option<f64>) -> Result<Range, LensError> {
        Range::new(Scale::of_firmware(b'A'), FIVE_TO_TEN, min, max)
    }

    #[test]
    fn ten_dioptres_are_3000_units_of_firmware_a_and_2000_of_others() {
        assert!((Scale::of_firmware(b'A').dioptre(3000) - 10.0).abs() < 1e-12);
        assert!((Scale::of_firmware(b'C').dioptre(2000) - 10.0).abs() < 1e-12);

        assert_eq!(range(None, None).unwrap().raw(FocalPower::MAX), 3000);
        assert_eq!(range(None, None).unwrap().raw(FocalPower::MIDDLE), 2500);
    }

    #[test]
    fn a_configured_part_is_used_but_never_beyond_the_device() {
        let part = range(Some(6.0), Some(8.0)).unwrap();
        assert_eq!((part.raw(FocalPower::MIN), part.raw(FocalPower::MAX)), (2200, 2600));

        let beyond = range(Some(-100.0), Some(1e9)).unwrap();
        assert_eq!((beyond.raw(FocalPower::MIN), beyond.raw(FocalPower::MAX)), (2000, 3000));

        assert!(range(Some(11.0), None).unwrap_err().to_string().contains("5.00 to 10.00 dpt"));
    }

    #[test]
    fn a_device_without_any_range_says_what_takes_it_away() {
        let none = Limits { status: 0, max: 1876, min: 3124 };
        let error = Range::new(Scale::of_firmware(b'A'), none, None, None).unwrap_err().to_string();
        assert!(error.contains("temperatures from low to high") && !error.contains("min"), "{error}");
    }

    proptest! {
        #[test]
        fn no_focal_power_leaves_the_device_range(min: i16, max: i16, low: f64, high: f64, power in 0.0..=1.0_f64) {
            let limits = Limits { status: 0, max, min };
            if let Ok(range) = Range::new(Scale::of_firmware(b'A'), limits, Some(low), Some(high)) {
                let power = FocalPower::new(power).unwrap();
                let raw = range.raw(power);
                prop_assert!((min..=max).contains(&raw));
                prop_assert_eq!(range.raw(range.focal_power(raw)), raw);
            }
        }
    }
}
