//! Focal power: finite and within 0..=1 by construction.

use serde::{Deserialize, Serialize};

/// Normalised focal power: 0..=1 over the lens's usable range. Only lens drivers use dioptres.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct FocalPower(f64);

/// A focal power error below this counts as in focus, as in the paper.
pub const IN_FOCUS: f64 = 0.1;

/// A number that is not a focal power.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("focal power must be a number from 0 to 1, not {0}")]
pub struct OutOfRange(pub f64);

impl FocalPower {
    /// The least focal power, 0.
    pub const MIN: Self = Self(0.0);
    /// The middle of the range, 0.5.
    pub const MIDDLE: Self = Self(0.5);
    /// The greatest focal power, 1.
    pub const MAX: Self = Self(1.0);

    /// `value` as a focal power.
    ///
    /// # Errors
    /// If `value` is outside 0..=1 or NaN.
    pub fn new(value: f64) -> Result<Self, OutOfRange> {
        if (0.0..=1.0).contains(&value) { Ok(Self(value)) } else { Err(OutOfRange(value)) }
    }

    /// The focal power nearest to `value`; the middle if `value` is NaN.
    pub const fn nearest(value: f64) -> Self {
        if value.is_nan() { Self::MIDDLE } else { Self(value.clamp(0.0, 1.0)) }
    }

    /// This focal power moved by `step`, stopping at the ends of the range.
    #[must_use]
    pub fn moved(self, step: f64) -> Self {
        Self::nearest(self.0 + step)
    }

    /// The value, 0..=1.
    pub const fn get(self) -> f64 {
        self.0
    }

    /// Absolute difference to `other`.
    pub fn distance(self, other: Self) -> f64 {
        (self.0 - other.0).abs()
    }
}

impl TryFrom<f64> for FocalPower {
    type Error = OutOfRange;

    fn try_from(value: f64) -> Result<Self, OutOfRange> {
        Self::new(value)
    }
}

impl From<FocalPower> for f64 {
    fn from(power: FocalPower) -> Self {
        power.0
    }
}
