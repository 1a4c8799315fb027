//! Estimates the focal power at which a frame was exposed, for a lens that cannot be read.

use parfocal_autofocus::STEP;
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;
use parfocal_devices::lens::{LensDynamics, Optics, Response};

/// A lens this close to its destination counts as arrived. An eighth of a policy's step causes no visible blur. So
/// policies stay on the grid of their own steps.
const THERE: f64 = STEP / 8.0;

/// Follows the commands that a lens accepted, and computes its focal power at a moment, such as the middle of an
/// exposure.
///
/// With 15 ms of settling, 50 frames per second and exposures of up to 10 ms, the lens has always arrived when the next
/// frame is exposed. So policies see exactly the focal power they asked for, as in the paper's simulation. With a
/// slower lens, a faster camera or a longer exposure, some frames are exposed while the lens still moves. They are
/// attributed to the focal power that the lens's dynamics predict, never to the destination.
#[derive(Debug)]
pub struct Attribution {
    way: Response,
    destination: FocalPower,
}

impl Attribution {
    /// Begins with the lens at rest at `start`.
    pub fn new(dynamics: LensDynamics, start: FocalPower) -> Self {
        Self { way: Response::new(dynamics, 0.0, start), destination: start }
    }

    /// Records that the lens accepted the command to go to `target` at `now`.
    pub fn commanded(&mut self, now: Moment, target: FocalPower) {
        if target != self.destination {
            self.way.command(now, target);
            self.destination = target;
        }
    }

    /// Records that the lens was lost, and that it, or another one, goes to its destination from `now` with `dynamics`.
    /// Where it stood meanwhile is unknown, so it counts as arrived only when it would have come from the farther end.
    pub fn regained(&mut self, now: Moment, dynamics: LensDynamics) {
        let farther = if self.destination < FocalPower::MIDDLE { FocalPower::MAX } else { FocalPower::MIN };
        self.way = Response::new(dynamics, 0.0, farther);
        self.way.command(now, self.destination);
    }

    /// The lens's focal power at `moment`.
    pub fn focal_power(&self, moment: Moment) -> FocalPower {
        let on_the_way = self.way.focal_power_at(moment);
        if on_the_way.distance(self.destination) < THERE { self.destination } else { on_the_way }
    }

    /// Whether the lens had arrived at its latest destination by `moment`.
    pub fn settled(&self, moment: Moment) -> bool {
        self.focal_power(moment) == self.destination
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn millis(value: u64) -> Moment {
        Moment::from_nanos(value * 1_000_000)
    }

    fn power(value: f64) -> FocalPower {
        FocalPower::new(value).unwrap()
    }

    #[test]
    fn a_frame_belongs_to_where_the_lens_was() {
        let dynamics = LensDynamics { delay: Duration::from_millis(2), settling: Duration::from_millis(15) };
        let mut lens = Attribution::new(dynamics, power(0.5));
        lens.commanded(millis(100), power(0.7));
        assert_eq!(lens.focal_power(millis(99)), power(0.5), "before the command");
        assert_eq!(lens.focal_power(millis(102)), power(0.5), "in the dead time");
        // Two thirds of the settling time leave 20^(-2/3) = 0.135721 of the step.
        let on_the_way = lens.focal_power(millis(112)).get();
        assert!((on_the_way - (0.7 - 0.2 * 0.135_721)).abs() < 1e-6, "{on_the_way}");
        assert!(!lens.settled(millis(112)));
        // After 18 ms, 20^(-18/15) = 0.027 of the step is left: 0.0055 of focal power.
        assert_eq!(lens.focal_power(millis(120)), power(0.7), "exactly, so that steps do not creep off their grid");
        assert!(lens.settled(millis(120)));
    }

    #[test]
    fn a_lens_that_is_back_is_waited_for_although_its_destination_is_the_same() {
        let dynamics = LensDynamics { delay: Duration::from_millis(2), settling: Duration::from_millis(15) };
        let mut lens = Attribution::new(dynamics, power(0.5));
        lens.commanded(millis(100), power(0.7));
        lens.regained(millis(500), dynamics);
        lens.commanded(millis(500), power(0.7));
        // After 18 ms, 20^(-18/15) = 0.027 of the whole way from the far end is left, more than an eighth of a step.
        assert!(!lens.settled(millis(520)), "{:?}", lens.focal_power(millis(520)));
        assert!(lens.settled(millis(532)));
    }

    #[test]
    fn the_same_command_again_does_not_put_off_the_arrival() {
        let dynamics = LensDynamics { delay: Duration::from_millis(10), settling: Duration::from_millis(15) };
        let mut lens = Attribution::new(dynamics, power(0.5));
        for at in 100..130 {
            lens.commanded(millis(at), power(0.6));
        }
        assert!(lens.settled(millis(130)));
    }
}
