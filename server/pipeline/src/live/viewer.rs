//! A viewer whose pictures change size while it looks.

use std::future::pending;
use std::sync::Arc;

use super::{EncodedFrame, LiveHandle, Watcher};
use parfocal_imaging::Size;

/// Gets frames, each at most once, at the size that was last asked for. Until the first frame of a larger size arrives,
/// frames of the previous size continue. A smaller size replaces the previous one at once: it arrives soon.
#[derive(Debug)]
pub struct Viewer {
    live: LiveHandle,
    /// Whether a [`Follower`](super::Follower) gets the size of this viewer.
    leads: bool,
    /// Its place among the viewers of a size; `None` while it looks away.
    watcher: Option<Watcher>,
    /// Its place among those of a larger size, until the first frame of that size arrives.
    coming: Option<Watcher>,
    /// Number of the last frame returned.
    last: u64,
}

impl LiveHandle {
    /// A viewer that may change its size, and gets `size` first. If it `leads`, a [`Follower`](super::Follower) gets
    /// the largest size that any leading viewer has.
    pub fn viewer(&self, size: Size, leads: bool) -> Viewer {
        Viewer { live: self.clone(), leads, watcher: Some(self.join(size, leads)), coming: None, last: 0 }
    }
}

impl Viewer {
    /// The size of the frames that it gets now; `None` while it looks away.
    pub fn size(&self) -> Option<Size> {
        self.watcher.as_ref().map(|watcher| watcher.size)
    }

    /// The size that was last asked for; `None` while it looks away.
    pub fn asked(&self) -> Option<Size> {
        self.coming.as_ref().or(self.watcher.as_ref()).map(|watcher| watcher.size)
    }

    /// Whether the first frame of a larger size has not arrived yet.
    pub const fn is_growing(&self) -> bool {
        self.coming.is_some()
    }

    /// Asks for `size` from now on. Returns whether that is another size than before. Changes nothing while it looks
    /// away.
    pub fn resize(&mut self, size: Size) -> bool {
        let size = size.min(self.live.largest());
        let asked = self.asked();
        let Some(watcher) = self.watcher.as_mut().filter(|_| asked != Some(size)) else { return false };

        self.coming = (size > watcher.size).then(|| self.live.join(size, self.leads));
        if size < watcher.size {
            *watcher = self.live.join(size, self.leads);
        }
        true
    }

    /// Gets no more frames until [`Viewer::look`].
    pub fn look_away(&mut self) {
        self.watcher = None;
        self.coming = None;
    }

    /// Gets frames of `size` again, if it looked away.
    pub fn look(&mut self, size: Size) {
        self.watcher.get_or_insert_with(|| self.live.join(size, self.leads));
    }

    /// The next frame, waiting for one if needed, forever while it looks away; `None` once the imaging thread has
    /// ended. Dropping the future loses nothing.
    pub async fn next(&mut self) -> Option<Arc<EncodedFrame>> {
        loop {
            let frame = tokio::select! {
                biased;
                frame = next_of(&mut self.coming) => {
                    self.watcher = self.coming.take();
                    frame?
                }
                frame = next_of(&mut self.watcher) => frame?,
            };

            // A larger picture takes longer, so the first one may be of a frame that was already returned.
            if frame.picture.number > self.last {
                self.last = frame.picture.number;
                return Some(frame);
            }
        }
    }
}

/// The next frame of `watcher`; waits forever if there is none.
async fn next_of(watcher: &mut Option<Watcher>) -> Option<Arc<EncodedFrame>> {
    match watcher {
        Some(watcher) => watcher.next().await,
        None => pending().await,
    }
}
