//! The pace of simulated cameras: frames are due at fixed times; a missed frame is lost, never queued.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use super::CameraError;
use parfocal_base::clock::{Clock, Moment};

/// A camera's timetable and how well it is kept.
#[derive(Debug, Clone)]
pub struct Pace {
    start: Moment,
    period: Duration,
    /// Number of the latest frame that was begun; numbers count from 1.
    number: u64,
    lost: u64,
    /// When the frames of the last second were handed over.
    delivered: VecDeque<Moment>,
}

impl Pace {
    /// A frame every `1 / fps` seconds, the first at `start`. A rate outside 1..=1000 is clamped to it.
    pub fn new(fps: f64, start: Moment) -> Self {
        let fps = if fps.is_nan() { 1.0 } else { fps.clamp(1.0, 1000.0) };
        Self { start, period: Duration::from_secs_f64(1.0 / fps), number: 0, lost: 0, delivered: VecDeque::new() }
    }

    /// Waits for the next frame's time and returns its number.
    ///
    /// # Errors
    /// If that time is further away than `timeout`. The call has then waited for `timeout`.
    pub fn wait(&mut self, clock: &dyn Clock, timeout: Duration) -> Result<u64, CameraError> {
        let now = clock.now();
        let (number, due) = self.next(now);
        let ahead = due.since(now);

        std::thread::sleep(ahead.min(timeout));
        if ahead > timeout {
            return Err(CameraError::Timeout(timeout));
        }

        self.lost += number - self.number - 1;
        self.number = number;
        Ok(number)
    }

    /// The next frame to make at `now`, and when it is due. A frame less than half a period late is still
    /// made; older ones are skipped.
    fn next(&self, now: Moment) -> (u64, Moment) {
        // 584 years of nanoseconds fit `u64`.
        let period = self.period.as_nanos() as u64;
        let earliest = (now.since(self.start).as_nanos() as u64 + period / 2) / period;
        let index = self.number.max(earliest);
        (index + 1, self.start + Duration::from_nanos(index * period))
    }

    /// Notes that a frame was handed over.
    pub fn delivered(&mut self, at: Moment) {
        self.delivered.push_back(at);
        while self.delivered.front().is_some_and(|first| at.since(*first) > Duration::from_secs(1)) {
            self.delivered.pop_front();
        }
    }

    /// Frames per second, as measured over the second before `now`.
    pub fn rate(&self, now: Moment) -> f64 {
        let recent = self.delivered.iter().filter(|at| now.since(**at) <= Duration::from_secs(1));
        let (count, first) = recent.fold((0_usize, None), |(count, first), at| (count + 1, first.or(Some(*at))));
        let last = self.delivered.back().copied().unwrap_or(now);
        match first {
            Some(first) if count > 1 && last > first => (count - 1) as f64 / last.since(first).as_secs_f64(),
            _ => count as f64,
        }
    }

    /// Frames skipped because the one before took too long.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// How well the pace is kept, in one sentence.
    pub fn message(&self) -> Arc<str> {
        let asked = 1.0 / self.period.as_secs_f64();
        let kept = self.delivered.back().is_none_or(|last| self.rate(*last) > 0.95 * asked);
        if kept {
            return Arc::from(format!("{asked:.0} frames a second, as requested"));
        }

        Arc::from(format!("this machine is too busy for {asked:.0} frames a second; lower the rate with --fps"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Moment {
        Moment::from_nanos(milliseconds * 1_000_000)
    }

    #[test]
    fn frames_fall_due_at_even_times() {
        let mut pace = Pace::new(50.0, at(1000));
        assert_eq!(pace.next(at(1000)), (1, at(1000)));
        pace.number = 1;
        assert_eq!(pace.next(at(1003)), (2, at(1020)));
        assert_eq!(pace.next(at(1029)), (2, at(1020)), "a little late is made at once");
    }

    #[test]
    fn missed_frames_are_skipped_not_queued() {
        let mut pace = Pace::new(50.0, at(0));
        pace.number = 1;
        let (number, due) = pace.next(at(175));
        assert_eq!((number, due), (10, at(180)), "eight frames were missed, the next is in the future");
    }

    #[test]
    fn lost_frames_are_counted_and_leave_a_gap() {
        let clock = parfocal_base::clock::ManualClock::new(jiff::Timestamp::UNIX_EPOCH);
        let mut pace = Pace::new(50.0, clock.now());
        assert_eq!(pace.wait(&clock, Duration::from_secs(1)), Ok(1));
        clock.advance(Duration::from_millis(100));
        assert_eq!(pace.wait(&clock, Duration::from_secs(1)), Ok(6));
        assert_eq!(pace.lost(), 4);
    }

    #[test]
    fn a_frame_too_far_off_is_a_timeout() {
        let clock = parfocal_base::clock::ManualClock::new(jiff::Timestamp::UNIX_EPOCH);
        let mut pace = Pace::new(1.0, clock.now());
        assert_eq!(pace.wait(&clock, Duration::ZERO), Ok(1));
        let timeout = Duration::from_millis(1);
        assert_eq!(pace.wait(&clock, timeout), Err(CameraError::Timeout(timeout)));
        assert_eq!(pace.lost(), 0);
    }

    #[test]
    fn the_rate_is_that_of_the_last_second() {
        let mut pace = Pace::new(50.0, at(0));
        for frame in 0..100 {
            pace.delivered(at(40 * frame));
        }
        assert!((pace.rate(at(3960)) - 25.0).abs() < 1e-9);
        assert!(pace.rate(at(9000)).abs() < 1e-9, "none of late");
    }
}
