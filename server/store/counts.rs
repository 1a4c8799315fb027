//! What became of telemetry.

use std::sync::atomic::AtomicU64;

/// What became of telemetry since the start.
#[derive(Debug, Default)]
pub struct Counts {
    /// Records written.
    pub written: AtomicU64,
    /// Batches that could not be written at the first try.
    pub failed_batches: AtomicU64,
    /// Records given up, the disk having failed for too long.
    pub lost: AtomicU64,
}
