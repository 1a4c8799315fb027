//! Which focal power a frame was exposed at, as far as a lens that cannot be read can tell.

use std::time::Duration;

use crate::clock::Moment;
use crate::lens::{FocalPower, LensDynamics, Optics, Response};

/// Follows the commands that a lens took, and tells where its glass was at the end of an exposure.
///
/// At 50 frames a second and 15 ms of settling the lens has always arrived when the next exposure ends, so that policies
/// see exactly the focal power they asked for, as in the paper's simulation. A slower lens or a faster camera shows them
/// frames from the way there; those are attributed to the point on the way that the lens's dynamics give, never to
/// the destination.
#[derive(Debug)]
pub struct Attribution {
    way: Response,
    destination: FocalPower,
    arrival: Moment,
    travel: Duration,
}

impl Attribution {
    /// A lens at rest at `start`.
    pub fn new(dynamics: LensDynamics, start: FocalPower) -> Self {
        Self {
            way: Response::new(dynamics, 0.0, start),
            destination: start,
            arrival: Moment::from_nanos(0),
            travel: dynamics.delay + dynamics.settling,
        }
    }

    /// The lens took the command to go to `target` at `now`.
    pub fn commanded(&mut self, now: Moment, target: FocalPower) {
        if target != self.destination {
            self.way.command(now, target);
            self.destination = target;
            self.arrival = now + self.travel;
        }
    }

    /// Focal power of a frame whose exposure ended at `exposed_at`.
    pub fn focal_power(&self, exposed_at: Moment) -> FocalPower {
        if self.settled(exposed_at) { self.destination } else { self.way.focal_power_at(exposed_at) }
    }

    /// Whether the lens had arrived at its latest destination by then.
    pub fn settled(&self, exposed_at: Moment) -> bool {
        exposed_at >= self.arrival
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn millis(value: u64) -> Moment {
        Moment::from_nanos(value * 1_000_000)
    }

    fn power(value: f64) -> FocalPower {
        FocalPower::new(value).unwrap()
    }

    #[test]
    fn a_frame_belongs_to_where_the_lens_was_when_its_exposure_ended() {
        let dynamics = LensDynamics { delay: Duration::from_millis(2), settling: Duration::from_millis(15) };
        let mut lens = Attribution::new(dynamics, power(0.5));
        lens.commanded(millis(100), power(0.55));
        assert_eq!(lens.focal_power(millis(99)), power(0.5), "exposed before the command");
        assert_eq!(lens.focal_power(millis(102)), power(0.5), "in the dead time");
        // Two thirds of the settling time leave 20^(-2/3) = 0.135721 of the step.
        let on_the_way = lens.focal_power(millis(112)).get();
        assert!((on_the_way - (0.55 - 0.05 * 0.135_721)).abs() < 1e-6, "{on_the_way}");
        assert!(!lens.settled(millis(116)) && lens.settled(millis(117)));
        assert_eq!(lens.focal_power(millis(117)), power(0.55), "exactly, so that steps do not creep off their grid");
    }

    #[test]
    fn the_same_command_again_does_not_put_off_the_arrival() {
        let dynamics = LensDynamics { delay: Duration::ZERO, settling: Duration::from_millis(15) };
        let mut lens = Attribution::new(dynamics, power(0.5));
        lens.commanded(millis(100), power(0.6));
        lens.commanded(millis(110), power(0.6));
        assert!(lens.settled(millis(115)));
    }
}
