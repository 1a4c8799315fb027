//! The monotonic and the wall clock. They are parameters everywhere, so that a trial replays exactly.

use std::ops::Add;
use std::sync::Mutex;
use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// A point on the monotonic clock (`CLOCK_MONOTONIC`), in nanoseconds since an arbitrary start that stays
/// the same until the machine reboots. Comparable between processes of one machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Moment(u64);

impl Moment {
    /// The moment `nanoseconds` after the clock's start.
    pub const fn from_nanos(nanoseconds: u64) -> Self {
        Self(nanoseconds)
    }

    /// Nanoseconds since the clock's start.
    pub const fn as_nanos(self) -> u64 {
        self.0
    }

    /// Time from `earlier` to this moment; zero if `earlier` is in fact later.
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Moment {
    type Output = Self;

    fn add(self, later: Duration) -> Self {
        Self(self.0.saturating_add(u64::try_from(later.as_nanos()).unwrap_or(u64::MAX)))
    }
}

/// The source of time.
pub trait Clock: Send + Sync {
    /// The current time on the monotonic clock.
    fn now(&self) -> Moment;
    /// The current wall-clock time (UTC).
    fn wall(&self) -> Timestamp;
}

/// The machine's own clocks.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    fn now(&self) -> Moment {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        // The kernel's monotonic clock is never negative.
        Moment(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
    }

    #[allow(clippy::disallowed_methods, reason = "the one place that reads the wall clock")]
    fn wall(&self) -> Timestamp {
        Timestamp::now()
    }
}

/// A clock that stands still until it is advanced: for tests and for simulations faster than real time.
#[derive(Debug)]
pub struct ManualClock(Mutex<(Moment, Timestamp)>);

impl ManualClock {
    /// A clock at monotonic zero and at `wall`.
    pub const fn new(wall: Timestamp) -> Self {
        Self(Mutex::new((Moment(0), wall)))
    }

    /// Advances both clocks by `step`.
    pub fn advance(&self, step: Duration) {
        let mut now = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        now.0 = now.0 + step;
        now.1 = now.1.saturating_add(step).unwrap_or(now.1);
    }

    /// Sets the wall clock to `wall`, as when somebody sets a machine's clock.
    pub fn set_wall(&self, wall: Timestamp) {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).1 = wall;
    }
}

impl Clock for ManualClock {
    fn now(&self) -> Moment {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).0
    }

    fn wall(&self) -> Timestamp {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).1
    }
}
