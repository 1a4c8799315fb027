//! Following the leading viewers: a recording of the view keeps the pictures at the size that they get.

use std::sync::Arc;

use tokio::sync::watch;

use super::lead::{Leaders, leading};
use super::{EncodedFrame, LiveHandle, Viewer};

impl LiveHandle {
    /// A source of frames, each at most once, at the size that the leading viewers get, or at the smallest if none
    /// leads.
    pub fn follow(&self) -> Follower {
        let leaders = self.leaders.subscribe();
        let viewer = self.viewer(leading(&leaders.borrow()), false);
        Follower { leaders, viewer }
    }
}

/// Gets frames, each at most once, at the size that the leading viewers get.
#[derive(Debug)]
pub struct Follower {
    leaders: watch::Receiver<Leaders>,
    viewer: Viewer,
}

impl Follower {
    /// The next frame, waiting for one if needed; `None` once the imaging thread has ended. Dropping the future loses
    /// nothing.
    pub async fn next(&mut self) -> Option<Arc<EncodedFrame>> {
        loop {
            self.viewer.resize(leading(&self.leaders.borrow_and_update()));

            tokio::select! {
                biased;
                frame = self.viewer.next() => return frame,
                Ok(()) = self.leaders.changed() => {}
            }
        }
    }
}
