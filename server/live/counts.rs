//! Counts of the work for viewers so far.

use std::sync::atomic::{AtomicU64, Ordering};

use prometheus_client::metrics::histogram::Histogram;

use crate::imaging::Size;

/// Upper ends of the latency histogram's buckets, seconds. They lie around the limits, 1 ms for the median
/// and 3 ms for 99 in 100.
const LATENCY_BUCKETS: [f64; 10] = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2, 2e-2, 5e-2];

/// Counts of the imaging threads' work so far.
#[derive(Debug)]
pub struct Counts {
    sizes: [SizeCounts; Size::ALL.len()],
    latency: Histogram,
}

/// Counts of one size.
#[derive(Debug, Default)]
pub(super) struct SizeCounts {
    pub(super) viewers: AtomicU64,
    pub(super) encoded: AtomicU64,
    pub(super) jpeg_bytes: AtomicU64,
}

impl Default for Counts {
    fn default() -> Self {
        Self { sizes: Default::default(), latency: Histogram::new(LATENCY_BUCKETS) }
    }
}

impl Counts {
    pub(super) const fn of(&self, size: Size) -> &SizeCounts {
        &self.sizes[size as usize]
    }

    /// Viewers that want pictures of `size` now.
    #[must_use]
    pub fn viewers(&self, size: Size) -> u64 {
        self.of(size).viewers.load(Ordering::Relaxed)
    }

    /// Frames encoded as JPEG of `size` since the start.
    #[must_use]
    pub fn encoded(&self, size: Size) -> u64 {
        self.of(size).encoded.load(Ordering::Relaxed)
    }

    /// Bytes of JPEG of `size` made since the start.
    #[must_use]
    pub fn jpeg_bytes(&self, size: Size) -> u64 {
        self.of(size).jpeg_bytes.load(Ordering::Relaxed)
    }

    /// Time from exposure to lens command, seconds, of the frames that reached the imaging thread.
    #[must_use]
    pub const fn latency(&self) -> &Histogram {
        &self.latency
    }
}
