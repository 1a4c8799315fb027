//! How a lens responds to commands over time: dead time, play, first-order settling.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::{LensDynamics, Optics};
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;

/// Number of moves remembered: five seconds of commands at 50 per second, so that a camera can look back over a long
/// exposure.
const REMEMBERED: usize = 256;

/// The focal power of a lens as a function of time and of its commands.
///
/// A command takes effect after the dead time. Then play of half-width `play` (in focal power) absorbs the first
/// `2 * play` of every reversal. This is the simplest hysteresis loop with the two branches that a tunable lens shows.
/// The lens approaches its destination as `1 - exp(-t / tau)` with `tau = settling / ln 20`, so that 5 % of a step
/// remain after the settling time. It never overshoots: focal power stays within 0..=1.
#[derive(Debug)]
pub struct Response {
    dynamics: LensDynamics,
    play: f64,
    /// Never empty; in order of `starts`. Locked only for a few instructions.
    moves: Mutex<VecDeque<Move>>,
}

/// The effect of one command: from `starts` on, focal power goes from `from` towards `to`.
#[derive(Debug, Clone, Copy)]
struct Move {
    starts: Moment,
    from: f64,
    to: f64,
}

impl Response {
    /// A lens at rest at `start`. `play` is the half-width of the hysteresis, 0 for none.
    pub fn new(dynamics: LensDynamics, play: f64, start: FocalPower) -> Self {
        let rest = Move { starts: Moment::from_nanos(0), from: start.get(), to: start.get() };
        Self { dynamics, play, moves: Mutex::new(VecDeque::from([rest])) }
    }

    /// Gives the command to go to `target` at `now`.
    pub fn command(&self, now: Moment, target: FocalPower) {
        let mut moves = self.moves();
        let Some(&last) = moves.back() else { return };

        // A command never overtakes the one before it.
        let starts = (now + self.dynamics.delay).max(last.starts);
        let to = last.to.clamp(target.get() - self.play, target.get() + self.play);
        let from = self.position(&last, starts);

        if moves.len() == REMEMBERED {
            moves.pop_front();
        }

        moves.push_back(Move { starts, from, to });
    }

    fn position(&self, of: &Move, at: Moment) -> f64 {
        let tau = self.dynamics.settling.as_secs_f64() / 20_f64.ln();
        let remaining = if tau > 0.0 { (-at.since(of.starts).as_secs_f64() / tau).exp() } else { 0.0 };
        of.to + (of.from - of.to) * remaining
    }

    fn moves(&self) -> MutexGuard<'_, VecDeque<Move>> {
        self.moves.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Optics for Response {
    fn focal_power_at(&self, moment: Moment) -> FocalPower {
        let moves = self.moves();
        let begun = moves.partition_point(|of| of.starts <= moment);
        let position = match begun.checked_sub(1).and_then(|index| moves.get(index)) {
            Some(current) => self.position(current, moment),
            None => moves.front().map_or(0.5, |oldest| oldest.from),
        };

        FocalPower::nearest(position)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;

    const DYNAMICS: LensDynamics =
        LensDynamics { delay: Duration::from_millis(2), settling: Duration::from_millis(15) };

    fn millis(value: f64) -> Moment {
        Moment::from_nanos(0) + Duration::from_secs_f64(value / 1000.0)
    }

    fn power(value: f64) -> FocalPower {
        FocalPower::new(value).unwrap()
    }

    #[test]
    fn a_step_waits_out_the_dead_time_and_then_settles_exponentially() {
        let glass = Response::new(DYNAMICS, 0.0, power(0.2));
        glass.command(millis(100.0), power(0.8));
        assert_eq!(glass.focal_power_at(millis(101.9)), power(0.2));

        // Two thirds of the settling time leave 20^(-2/3) = 0.135721 of the step.
        let expected = 0.8 - 0.6 * 0.135_721;
        assert!((glass.focal_power_at(millis(112.0)).get() - expected).abs() < 1e-6);

        let settled = glass.focal_power_at(millis(117.0)).get();
        assert!((settled - (0.8 - 0.6 * 0.05)).abs() < 1e-9, "5 % of the step remain: {settled}");
        assert!((glass.focal_power_at(millis(300.0)).get() - 0.8).abs() < 1e-9);
    }

    #[test]
    fn a_new_command_starts_from_where_the_glass_is() {
        let glass = Response::new(DYNAMICS, 0.0, power(0.0));
        glass.command(millis(0.0), power(1.0));
        glass.command(millis(10.0), power(0.0));

        // At 12 ms the first move has run for 10 ms: 1 - 20^(-2/3) = 0.864279.
        assert!((glass.focal_power_at(millis(12.0)).get() - 0.864_279).abs() < 1e-6);
        assert!((glass.focal_power_at(millis(27.0)).get() - 0.864_279 * 0.05).abs() < 1e-6);
        assert!((glass.focal_power_at(millis(10.0)).get() - (1.0 - 20_f64.powf(-8.0 / 15.0))).abs() < 1e-9);
    }

    #[test]
    fn up_and_down_are_two_branches_apart_by_twice_the_play() {
        let glass = Response::new(DYNAMICS, 0.01, power(0.0));
        let mut time = 0.0;
        let mut settled = |target: f64| {
            glass.command(millis(time), power(target));
            time += 1000.0;
            glass.focal_power_at(millis(time)).get()
        };

        assert!((settled(0.5) - 0.49).abs() < 1e-9, "rising branch");
        assert!((settled(0.9) - 0.89).abs() < 1e-9);
        assert!((settled(0.885) - 0.89).abs() < 1e-9, "a reversal within the play moves nothing");
        assert!((settled(0.5) - 0.51).abs() < 1e-9, "falling branch");
    }

    proptest! {
        #[test]
        fn focal_power_never_leaves_the_range_nor_passes_the_commands(
            commands in prop::collection::vec((0_u64..40_000, 0.0..=1.0_f64), 1..400),
            looks in prop::collection::vec(0_u64..20_000_000, 1..50),
            play in 0.0..0.2_f64,
        ) {
            let glass = Response::new(DYNAMICS, play, FocalPower::MIDDLE);
            let mut low = 0.5_f64;
            let mut high = 0.5_f64;
            let mut now = Moment::from_nanos(0);
            for (gap, target) in commands {
                now = now + Duration::from_micros(gap);
                glass.command(now, power(target));
                low = low.min(target);
                high = high.max(target);
            }

            for look in looks {
                let seen = glass.focal_power_at(Moment::from_nanos(look * 1000)).get();
                prop_assert!((low - 1e-12..=high + 1e-12).contains(&seen), "{seen} outside {low}..{high}");
            }
        }
    }
}
