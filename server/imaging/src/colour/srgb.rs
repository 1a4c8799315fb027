//! sRGB (IEC 61966-2-1): from XYZ to linear components, and their encoding in 8 bits.

/// Linear sRGB from XYZ with Y = 1 for white (IEC 61966-2-1).
pub(super) const FROM_XYZ: [[f64; 3]; 3] =
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

/// The transfer function: linear 0..=1 to encoded 0..=1.
fn encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The transfer function as a table. An entry every 1/4095 is fine enough to be at most one 8-bit
/// step off, even where the function is steepest.
#[derive(Debug, Clone)]
pub(crate) struct Encoder(Box<[u8; 1 << 16]>);

impl Encoder {
    /// Factor that turns a linear component of 0..=1 into an index.
    pub(crate) const SCALE: f32 = 4095.0;

    #[allow(clippy::large_stack_arrays, reason = "64 KiB, once, on its way to the heap")]
    pub(crate) fn new() -> Self {
        let mut table = Box::new([255; 1 << 16]);
        for (index, value) in (0..=4095_u16).zip(table.iter_mut()) {
            *value = (255.0 * encode(f64::from(index) / 4095.0)).round() as u8;
        }
        Self(table)
    }

    /// The encoded value of a linear component times [`Self::SCALE`], rounded; larger ones encode
    /// as 1. The table has an entry for any index, so no bounds check is needed.
    #[inline(always)]
    pub(crate) fn at(&self, index: u16) -> u8 {
        self.0[usize::from(index)]
    }

    /// The index of a linear component times [`Self::SCALE`], clamped to the valid range.
    #[inline(always)]
    pub(crate) fn index(scaled: f32) -> u16 {
        // Adding 2^23 leaves the number, rounded, in the lowest bits: cheaper than a cast, which must
        // handle NaN.
        (scaled.clamp(0.0, Self::SCALE) + 8_388_608.0).to_bits() as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_has_the_standards_values() {
        // 0.214 is the linear value of the encoded 0.5; the standard's two branches meet at 0.0031308 -> 0.04045.
        for (linear, expected) in [(0.0, 0.0), (0.003_130_8, 0.04045), (0.214_041, 0.5), (1.0, 1.0)] {
            assert!((encode(linear) - expected).abs() < 1e-4, "{linear}");
        }
    }

    #[test]
    fn the_table_is_at_most_one_step_off() {
        let encoder = Encoder::new();
        for step in 0..=100_000 {
            let linear = f64::from(step) / 100_000.0;
            let found = encoder.at(Encoder::index(linear as f32 * Encoder::SCALE));
            assert!((f64::from(found) - 255.0 * encode(linear)).abs() <= 1.0, "{linear}");
        }
    }

    #[test]
    fn what_is_out_of_range_is_cut() {
        let encoder = Encoder::new();
        let at = |scaled| encoder.at(Encoder::index(scaled));
        assert_eq!((at(-5.0), at(1e9), at(f32::NEG_INFINITY), encoder.at(u16::MAX)), (0, 255, 0, 255));
    }

    #[test]
    fn the_primaries_come_out_pure() {
        // XYZ of the primaries by the standard's forward matrix.
        let primaries = [[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]];
        for (which, xyz) in primaries.iter().enumerate() {
            for (component, row) in FROM_XYZ.iter().enumerate() {
                let found: f64 = row.iter().zip(xyz).map(|(a, b)| a * b).sum();
                assert!((found - f64::from(u8::from(which == component))).abs() < 1e-3);
            }
        }
    }
}
