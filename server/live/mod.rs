//! Live: the imaging thread. It prepares each frame once for all viewers; a slow viewer misses frames and
//! holds up nobody.

mod area;
mod picture;
mod thread;

pub use picture::{EncodedFrame, Insight, Picture};
pub use thread::start;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use prometheus_client::metrics::histogram::Histogram;
use tokio::sync::watch;

/// Upper ends of the latency histogram's buckets, seconds. They lie around the limits, 1 ms for the median
/// and 3 ms for 99 in 100.
const LATENCY_BUCKETS: [f64; 10] = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2, 2e-2, 5e-2];

/// Counts of the imaging thread's work so far.
#[derive(Debug)]
pub struct Counts {
    viewers: AtomicU64,
    encoded: AtomicU64,
    jpeg_bytes: AtomicU64,
    latency: Histogram,
}

impl Default for Counts {
    fn default() -> Self {
        Self {
            viewers: AtomicU64::default(),
            encoded: AtomicU64::default(),
            jpeg_bytes: AtomicU64::default(),
            latency: Histogram::new(LATENCY_BUCKETS),
        }
    }
}

impl Counts {
    /// Viewers that want pictures now.
    #[must_use]
    pub fn viewers(&self) -> u64 {
        self.viewers.load(Ordering::Relaxed)
    }

    /// Frames encoded as JPEG since the start.
    #[must_use]
    pub fn encoded(&self) -> u64 {
        self.encoded.load(Ordering::Relaxed)
    }

    /// Bytes of JPEG made since the start.
    #[must_use]
    pub fn jpeg_bytes(&self) -> u64 {
        self.jpeg_bytes.load(Ordering::Relaxed)
    }

    /// Time from exposure to lens command, seconds, of the frames that reached the imaging thread.
    #[must_use]
    pub const fn latency(&self) -> &Histogram {
        &self.latency
    }
}

/// The viewers' source of frames. Clone freely.
#[derive(Debug, Clone)]
pub struct LiveHandle {
    frames: watch::Receiver<Option<Arc<EncodedFrame>>>,
    counts: Arc<Counts>,
}

impl LiveHandle {
    /// Joins the viewers. Without viewers no picture is made.
    #[must_use]
    pub fn watch(&self) -> Watcher {
        self.counts.viewers.fetch_add(1, Ordering::Relaxed);
        let mut frames = self.frames.clone();

        // A frame made earlier is stale by the time somebody joins.
        frames.mark_unchanged();

        Watcher { frames, counts: Arc::clone(&self.counts) }
    }

    /// Counts of the imaging thread's work so far.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }
}

/// One viewer's place; leaves when dropped.
#[derive(Debug)]
pub struct Watcher {
    frames: watch::Receiver<Option<Arc<EncodedFrame>>>,
    counts: Arc<Counts>,
}

impl Watcher {
    /// The latest frame not seen yet, waiting for one if needed; `None` once the imaging thread has
    /// ended. Dropping the future loses nothing.
    pub async fn next(&mut self) -> Option<Arc<EncodedFrame>> {
        loop {
            self.frames.changed().await.ok()?;
            if let Some(frame) = self.frames.borrow_and_update().clone() {
                return Some(frame);
            }
        }
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        self.counts.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}
