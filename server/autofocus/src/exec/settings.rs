//! How policies' processes run.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use parfocal_base::clock::Clock;

/// How policies' processes run.
#[derive(Clone)]
pub struct ProcessSettings {
    /// The program whose hidden command [`LAUNCH`] turns into a process.
    pub launcher: PathBuf,
    /// The clock for limits and backoff.
    pub clock: Arc<dyn Clock>,
    /// Longest time from the start of a process until it is ready.
    pub start: Duration,
    /// Longest time for an answer. Then the process is ended.
    pub answer: Duration,
    /// Longest wait for a process when an instance is built.
    pub build: Duration,
    /// Whether several instances work at a time.
    pub many: bool,
    /// The time that a frame is given.
    pub times: Times,
    /// Gets every line that a process prints.
    pub say: fn(&str),
}

/// The time that a frame is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Times {
    /// That of the clock.
    Clock,
    /// So much later than the frame before, so that a simulation repeats exactly.
    Every(Duration),
}
