//! The hill-climber: keeps its direction as long as a focus metric rises, and turns back otherwise.

use super::{Decision, FieldOfView, Observation, Policy, STEP};
use parfocal_imaging::Patch;

/// Distance to a bound that counts as being on it: because of rounding, sums of 0.05 miss 0 and 1 slightly.
const ON_BOUND: f64 = 1e-9;

/// The traditional optimiser of Budd et al., MICCAI 2023. It takes one step of 0.05 per frame: in the last direction if
/// `0 < f < 1` and the metric rose since the last frame, else in the opposite one.
///
/// The paper does not define the first move. Here the initial direction is upwards, and the first frame counts as a
/// rise, since there is nothing to compare it with. At a bound the direction always reverses, even if that means a step
/// outwards; the next frame corrects this.
#[derive(Debug, Clone)]
pub struct HillClimber {
    metric: fn(&Patch) -> f64,
    last_metric: f64,
    direction: f64,
}

impl HillClimber {
    /// A climber on `metric`, which must be greater the sharper a patch is.
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

    fn forget(&mut self) {
        *self = Self::new(self.metric);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_base::FocalPower;
    use parfocal_imaging::PATCH_SIDE;

    /// Uses the patch's first value as the metric, so that a test can give a sequence of metrics.
    fn first_value(patch: &Patch) -> f64 {
        f64::from(patch.0[0])
    }

    /// Feeds metrics to a climber whose lens obeys at once. Returns its focal powers, in steps of 0.05.
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
        // First move: up. 2 > 1: continue. 3 > 2: continue. 2 < 3: turn down. 3 > 2: continue down. 2 < 3: turn up.
        assert_eq!(walk(0.5, &[1.0, 2.0, 3.0, 2.0, 3.0, 2.0]), [11.0, 12.0, 13.0, 12.0, 11.0, 12.0]);
    }

    #[test]
    fn a_metric_that_stays_the_same_has_not_risen() {
        assert_eq!(walk(0.5, &[1.0, 1.0, 1.0, 1.0]), [11.0, 10.0, 11.0, 10.0]);
    }

    #[test]
    fn reverses_at_the_upper_bound_whatever_the_metric_does() {
        // From 19 steps up to the bound. There it reverses although 3 > 2. 4 > 3: continue down.
        assert_eq!(walk(0.9, &[1.0, 2.0, 3.0, 4.0]), [19.0, 20.0, 19.0, 18.0]);
    }

    #[test]
    fn a_start_on_a_bound_reverses_the_direction_it_begins_with() {
        // The initial direction is upwards. At 1 the reversal leads inside. At 0 it leads outside and is clamped; then
        // the direction reverses again.
        assert_eq!(walk(1.0, &[1.0, 2.0, 3.0]), [19.0, 18.0, 17.0]);
        assert_eq!(walk(0.0, &[1.0, 2.0, 3.0]), [0.0, 1.0, 2.0]);
    }

    #[test]
    fn finds_a_bound_in_spite_of_rounding() {
        // Ten steps down from 0.5 end at 2.8e-17, not at 0. Another step outwards would cost a frame.
        let metrics = [2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0];
        assert_eq!(walk(0.5, &metrics)[9..], [2.0, 1.0, 0.0, 1.0, 2.0]);
    }
}
