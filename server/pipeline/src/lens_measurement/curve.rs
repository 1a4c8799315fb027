//! Sharpness over focal power at rest: the scale for reading a moving lens's focal power from the
//! picture.

use super::MeasurementError;

/// Least change of sharpness along the flank, as a share of the greatest sharpness.
const CONTRAST: f64 = 0.15;
/// Parts of the flank flatter than this share of its steepest part are too imprecise to use.
const STEEP: f64 = 0.3;

/// One side of the focus peak, where sharpness determines focal power.
#[derive(Debug, Clone, PartialEq)]
pub struct Flank {
    /// Focal power and sharpness; focal power rises, sharpness strictly rises or strictly falls. At
    /// least two.
    points: Vec<(f64, f64)>,
    /// Distance between the curves on the way up and on the way down, in focal power.
    pub hysteresis: f64,
}

impl Flank {
    /// The steepest side of the curves measured going `up` and `down` through the same `powers`, which
    /// rise.
    pub fn find(powers: &[f64], up: &[f64], down: &[f64]) -> Result<Self, MeasurementError> {
        let mean: Vec<f64> = up.iter().zip(down).map(|(up, down)| (up + down) / 2.0).collect();
        let (first, last) = steepest_run(&mean);
        let (first, last) = trimmed(&mean, first, last);

        let contrast = (mean[last] - mean[first]).abs() / mean.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        if first == last || contrast < CONTRAST {
            return Err(MeasurementError::Flat(contrast));
        }

        // A difference in sharpness over the slope is a difference in focal power.
        let slope = (mean[last] - mean[first]) / (powers[last] - powers[first]);

        let apart = (first..=last).map(|stop| down[stop] - up[stop]).sum::<f64>() / (last - first + 1) as f64;
        let points = (first..=last).map(|stop| (powers[stop], mean[stop])).collect();
        Ok(Self { points, hysteresis: apart / slope })
    }

    /// Focal power at its two ends.
    pub fn ends(&self) -> (f64, f64) {
        let power = |point: Option<&(f64, f64)>| point.map_or(0.5, |(power, _)| *power);
        (power(self.points.first()), power(self.points.last()))
    }

    /// The focal power at which a patch of `sharpness` was seen; extrapolated linearly beyond the ends.
    pub fn focal_power(&self, sharpness: f64) -> f64 {
        let rising = self.points.last() > self.points.first() && self.points[1].1 > self.points[0].1;
        let beyond = |of: f64| if rising { of >= sharpness } else { of <= sharpness };
        let next = self.points.iter().position(|point| beyond(point.1)).unwrap_or(self.points.len() - 1).max(1);

        let (from, low) = self.points[next - 1];
        let (to, high) = self.points[next];
        from + (sharpness - low) / (high - low) * (to - from)
    }
}

/// First and last stop of the run along which `values` strictly rise or fall the most.
fn steepest_run(values: &[f64]) -> (usize, usize) {
    let mut best = (0, 0);
    let mut first = 0;

    for stop in 1..values.len() {
        let turned = stop > first + 1 && (values[stop] > values[stop - 1]) != (values[stop - 1] > values[stop - 2]);
        if turned {
            first = stop - 1;
        }

        if (values[stop] - values[first]).abs() > (values[best.1] - values[best.0]).abs() {
            best = (first, stop);
        }
    }

    best
}

/// Cuts the flat ends off a run.
fn trimmed(values: &[f64], mut first: usize, mut last: usize) -> (usize, usize) {
    let rise = |stop: usize| (values[stop + 1] - values[stop]).abs();
    let steepest = (first..last).map(rise).fold(0.0, f64::max);

    while first < last && rise(first) < STEEP * steepest {
        first += 1;
    }
    while last > first && rise(last - 1) < STEEP * steepest {
        last -= 1;
    }

    (first, last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steepest_side_of_a_peak_is_found_and_read_backwards() {
        let powers: Vec<f64> = (0..=10).map(|stop| f64::from(stop) / 10.0).collect();
        // Rises slowly to 0.3, then falls steeply by 10 a stop to 0.7, and lies flat.
        let curve = [37.0, 38.0, 39.0, 40.0, 30.0, 20.0, 10.0, 1.0, 0.9, 0.8, 0.7];
        // A play of 0.01 of focal power on a slope of 100: half of it either way.
        let shifted = |by: f64| curve.map(|value| value + by);
        let flank = Flank::find(&powers, &shifted(0.5), &shifted(-0.5)).unwrap();
        assert_eq!(flank.ends(), (0.3, 0.7));
        assert!((flank.focal_power(25.0) - 0.45).abs() < 1e-12);
        assert!((flank.focal_power(45.0) - 0.25).abs() < 1e-12, "beyond the end");
        let slope = (1.0 - 40.0) / 0.4;
        assert!((flank.hysteresis - -1.0 / slope).abs() < 1e-12, "{}", flank.hysteresis);
    }

    #[test]
    fn a_picture_that_does_not_change_is_refused() {
        let powers: Vec<f64> = (0..=10).map(|stop| f64::from(stop) / 10.0).collect();
        let flat = [20.0, 20.1, 20.0, 20.2, 20.1, 20.0, 20.1, 20.3, 20.2, 20.0, 20.1];
        assert!(matches!(Flank::find(&powers, &flat, &flat), Err(MeasurementError::Flat(_))));
    }
}
