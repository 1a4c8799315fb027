//! Maps the camera's clock to ours.

use std::collections::VecDeque;
use std::time::Duration;

use parfocal_base::clock::{Clock, Moment};

/// How far back arrivals are compared; over that time a crystal drifts by some tens of microseconds.
const WINDOW: Duration = Duration::from_secs(4);
/// A wall clock that moves by more than this against the monotonic one, from one frame to the next, was set.
const SET: Duration = Duration::from_millis(5);

/// Maps a camera's time stamps to the monotonic clock.
///
/// The first packet of a frame leaves the camera when its exposure has ended, and is then delayed by a varying time. So
/// the least difference between arrival and stamp over the last seconds is that of a frame that was hardly delayed. A
/// stamp plus that difference is the end of its exposure, without the jitter of network and machine.
#[derive(Debug, Default)]
pub struct Timestamps {
    /// Arrival of each stamp and its difference; differences rise, so the first is the least of the window.
    differences: VecDeque<(Moment, i128)>,
    /// The latest stamp.
    stamp: u64,
    last: Option<Moment>,
    /// Nanoseconds by which the wall clock was ahead of the monotonic one at the latest frame.
    wall_ahead: Option<i128>,
}

impl Timestamps {
    /// The moment of `stamp` (nanoseconds of the camera's clock), whose frame began to arrive at `arrived`. Never later
    /// than `arrived`, unless it has to be, to come after the frame before. For a camera without a clock it is
    /// `arrived`.
    pub fn moment(&mut self, stamp: u64, arrived: Moment) -> Moment {
        let moment = self.undelayed(stamp, arrived);

        // A smaller least difference just found could put this frame before the last one.
        let rising = self.last.map_or(moment, |last| moment.max(Moment::from_nanos(last.as_nanos() + 1)));
        self.last = Some(rising);
        rising
    }

    /// The moment at which a frame began to arrive. `noted` is the time that Aravis noted for it, in nanoseconds of the
    /// wall clock.
    pub fn arrival(&mut self, noted: u64, clock: &dyn Clock) -> Moment {
        let wall = clock.wall().as_nanosecond();
        // The monotonic clock is read last. A pause between the two makes the arrival late, which `moment` removes
        // again; the other order would make it early, which `moment` would believe for seconds.
        let now = clock.now();

        // A wall clock that was set in the meantime makes the age meaningless.
        let ahead = wall - i128::from(now.as_nanos());
        let before = self.wall_ahead.replace(ahead).unwrap_or(ahead);
        let was_set = ahead.abs_diff(before) > SET.as_nanos();

        let age = u64::try_from(wall - i128::from(noted)).unwrap_or(0);
        let age = if was_set || age > 1_000_000_000 { 0 } else { age };
        Moment::from_nanos(now.as_nanos().saturating_sub(age))
    }

    /// Starts comparing arrivals afresh, because the exposure was changed. For cameras that stamp its
    /// beginning, that changes the time from stamp to arrival.
    pub fn forget(&mut self) {
        self.differences.clear();
    }

    fn undelayed(&mut self, stamp: u64, arrived: Moment) -> Moment {
        if stamp == 0 {
            return arrived;
        }

        // The camera's clock was set back, as when it starts to follow a network's clock. Earlier differences would put
        // its frames far into the past.
        if stamp <= self.stamp {
            self.forget();
        }
        self.stamp = stamp;

        let difference = i128::from(arrived.as_nanos()) - i128::from(stamp);
        // Larger differences before this one can never be the least again.
        while self.differences.back().is_some_and(|&(_, other)| other >= difference) {
            self.differences.pop_back();
        }
        self.differences.push_back((arrived, difference));

        while self.differences.front().is_some_and(|&(seen, _)| arrived.since(seen) > WINDOW) {
            self.differences.pop_front();
        }

        let least = self.differences.front().map_or(difference, |&(_, least)| least);
        Moment::from_nanos(u64::try_from(i128::from(stamp) + least).unwrap_or(0)).min(arrived)
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use parfocal_base::clock::ManualClock;

    const MILLI: u64 = 1_000_000;

    fn at(micros: u64) -> Moment {
        Moment::from_nanos(micros * 1000)
    }

    #[test]
    fn jitter_of_arrival_is_taken_out() {
        let mut map = Timestamps::default();
        // The camera's clock began 7 s before ours; packets take 0.1 ms, some 3 ms more.
        let delays = [100, 3100, 100, 900, 2000, 100];
        for (frame, delay) in (0_u64..).zip(delays) {
            let stamp = 7000 * MILLI + frame * 20 * MILLI;
            let seen = map.moment(stamp, at(frame * 20_000 + delay));
            assert_eq!(seen, at(frame * 20_000 + 100), "frame {frame}");
        }
    }

    #[test]
    fn a_camera_clock_that_was_set_is_followed_at_once() {
        let mut map = Timestamps::default();
        map.moment(9000 * MILLI, at(1_000_000));
        assert_eq!(map.moment(1000 * MILLI, at(1_020_000)), at(1_020_000), "back");
        assert_eq!(map.moment(1020 * MILLI, at(1_043_000)), at(1_040_000), "three milliseconds late");
        assert_eq!(map.moment(7000 * MILLI, at(1_060_000)), at(1_060_000), "forward");
        assert_eq!(map.moment(7020 * MILLI, at(1_082_000)), at(1_080_000), "two milliseconds late");
    }

    #[test]
    fn a_difference_of_seconds_ago_is_forgotten() {
        let mut map = Timestamps::default();
        map.moment(1000 * MILLI, at(1_000_000));
        // Set back by 30 ms between two frames that are 40 ms apart: stamps still rise.
        assert_eq!(map.moment(1010 * MILLI, at(1_040_000)), at(1_010_000), "at first the old difference rules");
        assert_eq!(map.moment(5010 * MILLI, at(5_040_000)), at(5_040_000));
    }

    #[test]
    fn a_wall_clock_that_is_set_while_a_frame_arrives_makes_it_late_and_never_early() {
        let clock = ManualClock::new("2026-03-01T09:00:00Z".parse().unwrap());
        clock.advance(Duration::from_secs(10));
        let mut map = Timestamps::default();
        let wall = |clock: &ManualClock| u64::try_from(clock.wall().as_nanosecond()).unwrap();

        let noted = wall(&clock);
        let begun = clock.now();
        clock.advance(Duration::from_millis(15));
        assert_eq!(map.arrival(noted, &clock), begun);

        for ahead in [400, -400] {
            let noted = wall(&clock);
            clock.advance(Duration::from_millis(15));
            clock.set_wall(clock.wall() + jiff::SignedDuration::from_millis(ahead));
            assert_eq!(map.arrival(noted, &clock), clock.now(), "set by {ahead} ms");

            let noted = wall(&clock);
            let begun = clock.now();
            clock.advance(Duration::from_millis(15));
            assert_eq!(map.arrival(noted, &clock), begun);
        }
    }

    #[test]
    fn a_longer_exposure_is_followed_at_once() {
        let mut map = Timestamps::default();
        // Stamped when the exposure begins, 5 ms long, then 15.
        assert_eq!(map.moment(1000 * MILLI, at(1_005_000)), at(1_005_000));
        map.forget();
        assert_eq!(map.moment(1020 * MILLI, at(1_035_000)), at(1_035_000));
    }

    #[test]
    fn without_a_clock_the_arrival_counts() {
        assert_eq!(Timestamps::default().moment(0, at(5)), at(5));
    }

    /// A clock whose reader is held up for 30 ms after each reading.
    struct Slow(ManualClock);

    impl Clock for Slow {
        fn now(&self) -> Moment {
            let now = self.0.now();
            self.0.advance(Duration::from_millis(30));
            now
        }

        fn wall(&self) -> Timestamp {
            let wall = self.0.wall();
            self.0.advance(Duration::from_millis(30));
            wall
        }
    }

    #[test]
    fn who_is_held_up_takes_a_frame_for_late_and_never_for_early() {
        let clock = Slow(ManualClock::new("2026-03-01T09:00:00Z".parse().unwrap()));
        clock.0.advance(Duration::from_secs(10));
        let noted = u64::try_from(clock.0.wall().as_nanosecond()).unwrap();
        let truth = clock.0.now();
        assert!(Timestamps::default().arrival(noted, &clock) >= truth);
    }
}
