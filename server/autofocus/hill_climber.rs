//! The hill-climber: keeps one direction for as long as a focus metric rises, and turns back when it
//! does not.

use super::{Decision, FieldOfView, Observation, Policy, STEP};
use crate::imaging::Patch;

/// Distance to a bound that counts as being on it: sums of 0.05 miss 0 and 1 by their rounding.
const ON_BOUND: f64 = 1e-9;

/// The traditional optimiser of Budd et al., MICCAI 2023: one step of 0.05 a frame, in the last direction if
/// `0 < f < 1` and the metric rose since the last frame, else in the opposite one.
///
/// The paper leaves the first move open. Here the direction before it is upwards, and the first
/// frame, which has nothing to compare with, counts as a rise. At a bound the direction always
/// reverses, even where that asks for a step outwards; the frame after puts it right.
#[derive(Debug, Clone)]
pub struct HillClimber {
    metric: fn(&Patch) -> f64,
    last_metric: f64,
    direction: f64,
}

impl HillClimber {
    /// A climber on `metric`, which is greater the sharper a patch is.
    #[must_use]
    pub const fn new(metric: fn(&Patch) -> f64) -> Self {
        Self { metric, last_metric: f64::NEG_INFINITY, direction: 1.0 }
    }
}

impl Policy for HillClimber {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Patch
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        let metric = (self.metric)(&seen.view.patch);
        let focal_power = seen.focal_power.get();
        let inside = focal_power > ON_BOUND && focal_power < 1.0 - ON_BOUND;

        if !(inside && metric > self.last_metric) {
            self.direction = -self.direction;
        }

        self.last_metric = metric;
        let target = seen.focal_power.moved(self.direction * STEP).get();
        Decision { target, metric: Some(metric), belief: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imaging::PATCH_SIDE;
    use crate::lens::FocalPower;

    /// The patch's first value stands for the metric, so that a sequence can be written down.
    fn first_value(patch: &Patch) -> f64 {
        f64::from(patch.0[0])
    }

    /// Feeds metrics to a climber whose lens obeys at once; returns where it went, in steps of 0.05.
    fn walk(start: f64, metrics: &[f32]) -> Vec<f64> {
        let mut climber = HillClimber::new(first_value);
        let mut focal_power = FocalPower::new(start).unwrap();
        metrics
            .iter()
            .map(|&metric| {
                let patch = Patch([metric; PATCH_SIDE * PATCH_SIDE]);
                let decision = climber.step(&Observation { view: &patch.into(), focal_power });
                assert_eq!(decision.metric, Some(f64::from(metric)));
                focal_power = FocalPower::new(decision.target).unwrap();
                (focal_power.get() / STEP * 1e6).round() / 1e6
            })
            .collect()
    }

    #[test]
    fn climbs_while_the_metric_rises_and_turns_where_it_falls() {
        // First move up; 2 > 1 on; 3 > 2 on; 2 < 3 back; 3 > 2 on (down); 2 < 3 back up.
        assert_eq!(walk(0.5, &[1.0, 2.0, 3.0, 2.0, 3.0, 2.0]), [11.0, 12.0, 13.0, 12.0, 11.0, 12.0]);
    }

    #[test]
    fn a_metric_that_stays_the_same_has_not_risen() {
        assert_eq!(walk(0.5, &[1.0, 1.0, 1.0, 1.0]), [11.0, 10.0, 11.0, 10.0]);
    }

    #[test]
    fn reverses_at_the_upper_bound_whatever_the_metric_does() {
        // At 19 up to the bound; there it reverses although 3 > 2; 4 > 3 goes on down.
        assert_eq!(walk(0.9, &[1.0, 2.0, 3.0, 4.0]), [19.0, 20.0, 19.0, 18.0]);
    }

    #[test]
    fn a_start_on_a_bound_reverses_the_direction_it_begins_with() {
        // Upwards before the first move: at 1 the reversal leads inside; at 0 it leads out, is cut off,
        // and reverses again.
        assert_eq!(walk(1.0, &[1.0, 2.0, 3.0]), [19.0, 18.0, 17.0]);
        assert_eq!(walk(0.0, &[1.0, 2.0, 3.0]), [0.0, 1.0, 2.0]);
    }

    #[test]
    fn finds_a_bound_in_spite_of_rounding() {
        // Ten steps down from 0.5 end at 2.8e-17, not at 0; a step further out would cost a frame.
        let metrics = [2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0];
        assert_eq!(walk(0.5, &metrics)[9..], [2.0, 1.0, 0.0, 1.0, 2.0]);
    }
}
