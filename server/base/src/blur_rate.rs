//! Blur rate of the optics.

/// Blur rate of the optics: pixels of blur (standard deviation) in the picture per unit of focal power error.
/// `parfocal scan info` measures it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlurRate(f64);

impl BlurRate {
    /// Accepted blur rates, in pixels per unit of focal power.
    pub const RANGE: std::ops::RangeInclusive<f64> = 0.1..=200.0;

    /// A rate of `pixels` per unit of focal power; `None` outside [`BlurRate::RANGE`].
    pub fn new(pixels: f64) -> Option<Self> {
        Self::RANGE.contains(&pixels).then_some(Self(pixels))
    }

    /// The rate in pixels per unit of focal power.
    pub const fn get(self) -> f64 {
        self.0
    }
}

impl std::str::FromStr for BlurRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let pixels = text.parse().map_err(|_| format!("'{text}' is not a number of pixels"))?;
        Self::new(pixels).ok_or_else(|| format!("must be from {} to {} pixels", Self::RANGE.start(), Self::RANGE.end()))
    }
}
