//! Live: the imaging threads. They prepare each frame once for all viewers of a size. A slow viewer misses frames but
//! delays nobody.

mod area;
mod counts;
mod depth_map;
mod follow;
mod frame_encoder;
mod frame_thread;
mod larger_size;
mod lead;
mod picture;
mod publisher;
mod thread;
mod viewer;

pub use counts::Counts;
pub use depth_map::{DepthMap, DepthMaps, PlaceDepth, Side};
pub use follow::Follower;
pub use picture::{EncodedFrame, Insight, Picture};
pub use thread::start;
pub use viewer::Viewer;

use std::sync::Arc;

use tokio::sync::watch;

use crate::control::ControlledFrame;
use lead::{Lead, Leaders};
use parfocal_imaging::Size;

/// The latest frame of one size.
type LatestFrame = watch::Receiver<Option<Arc<EncodedFrame>>>;

/// The viewers' source of frames. Clone freely.
#[derive(Debug, Clone)]
pub struct LiveHandle {
    /// Indexed by [`Size`], up to the largest size of the camera's pictures.
    frames: Arc<[LatestFrame]>,
    counts: Arc<Counts>,
    leaders: watch::Sender<Leaders>,
    /// The loop's frames, for those who make pictures of their own.
    taken: watch::Sender<Option<Arc<ControlledFrame>>>,
    depth_maps: watch::Sender<Option<Arc<DepthMap>>>,
}

impl LiveHandle {
    /// Joins the viewers of `size`, or of the largest size if that is smaller. A size without viewers is not made.
    fn join(&self, size: Size, leads: bool) -> Watcher {
        let size = size.min(self.largest());
        self.counts.of(size).viewers.inc();
        let mut frames = self.frames[size as usize].clone();

        // A frame made earlier is stale by the time somebody joins.
        frames.mark_unchanged();

        let lead = leads.then(|| Lead::new(size, self.leaders.clone()));
        Watcher { size, frames, counts: Arc::clone(&self.counts), _lead: lead }
    }

    /// The loop's latest frame, as far as the imaging thread takes it.
    pub fn frames(&self) -> watch::Receiver<Option<Arc<ControlledFrame>>> {
        self.taken.subscribe()
    }

    /// The latest depth map. Maps are made while somebody holds such a receiver, outside of a session's settings.
    pub fn depth_maps(&self) -> DepthMaps {
        self.depth_maps.subscribe()
    }

    /// The largest size of the camera's pictures.
    pub fn largest(&self) -> Size {
        Size::ALL[self.frames.len() - 1]
    }

    /// Counts of the imaging threads' work so far.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }
}

/// One viewer among those of a size; leaves when dropped.
#[derive(Debug)]
#[must_use]
struct Watcher {
    size: Size,
    frames: LatestFrame,
    counts: Arc<Counts>,
    /// Set for a leading viewer.
    _lead: Option<Lead>,
}

impl Watcher {
    /// The latest frame not seen yet, waiting for one if needed; `None` once the imaging thread has
    /// ended. Dropping the future loses nothing.
    async fn next(&mut self) -> Option<Arc<EncodedFrame>> {
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
        self.counts.of(self.size).viewers.dec();
    }
}
