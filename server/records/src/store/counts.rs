//! Counts of telemetry that was written or lost.

use std::sync::atomic::AtomicU64;

/// How much telemetry was written or lost since the start of the server.
#[derive(Debug, Default)]
pub struct Counts {
    /// Records written.
    pub written: AtomicU64,
    /// Failed attempts to write a batch.
    pub failed_batches: AtomicU64,
    /// Records dropped because the disk failed for too long.
    pub lost: AtomicU64,
}
