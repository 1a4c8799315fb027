//! The place of the patch, relative to the bright circle, so that it stays where it was seen when the circle moves.

use serde::{Deserialize, Serialize};

/// A place in the bright circle: how far its centre lies to the right of the circle's centre and below it, in radii of
/// the circle. Never outside the circle, so that at most half of a patch there leaves it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(from = "(f64, f64)", into = "(f64, f64)")]
pub struct PatchPlace {
    across: f64,
    down: f64,
}

/// Places are kept to this part of a radius: less than a tenth of a pixel.
const GRAIN: f64 = 1e4;

impl PatchPlace {
    /// The circle's centre.
    pub const CENTRE: Self = Self { across: 0.0, down: 0.0 };

    /// The place `across` to the right and `down` below the centre, in radii. A place outside the circle is moved
    /// straight towards the centre, onto the circle. What is no number counts as the centre.
    pub fn nearest(across: f64, down: f64) -> Self {
        let distance = across.hypot(down);
        if !distance.is_finite() {
            return Self::CENTRE;
        }

        let within = distance.max(1.0);
        let rounded = |round: fn(f64) -> f64| {
            let kept = |length: f64| round(length / within * GRAIN) / GRAIN;
            Self { across: kept(across), down: kept(down) }
        };

        // On the circle itself rounding may lead out of it.
        let nearest = rounded(f64::round);
        if nearest.across.hypot(nearest.down) <= 1.0 { nearest } else { rounded(f64::trunc) }
    }

    /// How far it lies to the right of the circle's centre, in radii: -1..=1.
    pub const fn across(self) -> f64 {
        self.across
    }

    /// How far it lies below the circle's centre, in radii: -1..=1.
    pub const fn down(self) -> f64 {
        self.down
    }
}

impl From<(f64, f64)> for PatchPlace {
    fn from((across, down): (f64, f64)) -> Self {
        Self::nearest(across, down)
    }
}

impl From<PatchPlace> for (f64, f64) {
    fn from(place: PatchPlace) -> Self {
        (place.across, place.down)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_never_leaves_the_circle() {
        assert_eq!(<(f64, f64)>::from(PatchPlace::nearest(0.25, -0.5)), (0.25, -0.5));
        assert_eq!(<(f64, f64)>::from(PatchPlace::nearest(3.0, 4.0)), (0.6, 0.8));
        assert_eq!(<(f64, f64)>::from(PatchPlace::nearest(0.0, -7.0)), (0.0, -1.0));
        for (across, down) in [(f64::NAN, 0.0), (0.0, f64::INFINITY)] {
            assert_eq!(PatchPlace::nearest(across, down), PatchPlace::CENTRE);
        }
    }

    #[test]
    fn a_place_that_was_kept_is_read_as_it_was() {
        for step in 0..1000 {
            let angle = f64::from(step) / 7.0;
            let place = PatchPlace::nearest(1.2 * angle.cos(), 0.9 * angle.sin());
            assert_eq!(PatchPlace::from(<(f64, f64)>::from(place)), place, "{place:?}");
        }
    }
}
