//! Following the leading viewers: a recording of the view keeps the pictures at the size that they get.

use std::sync::Arc;

use tokio::sync::watch;

use super::lead::{Leaders, leading};
use super::{EncodedFrame, LiveHandle, Watcher};

impl LiveHandle {
    /// A source of frames, each at most once, at the size that the leading viewers get, or at the smallest if none
    /// leads.
    #[must_use]
    pub fn follow(&self) -> Follower {
        let leaders = self.leaders.subscribe();
        let watcher = self.watch(leading(&leaders.borrow()));
        Follower { live: self.clone(), leaders, watcher, coming: None, last: 0 }
    }
}

/// Gets frames, each at most once, at the size that the leading viewers get.
#[derive(Debug)]
pub struct Follower {
    live: LiveHandle,
    leaders: watch::Receiver<Leaders>,
    watcher: Watcher,
    /// The viewers of a larger size, until its first frame arrives.
    coming: Option<Watcher>,
    /// Number of the last frame returned.
    last: u64,
}

impl Follower {
    /// The next frame, waiting for one if needed; `None` once the imaging thread has ended. Dropping the future loses
    /// nothing.
    pub async fn next(&mut self) -> Option<Arc<EncodedFrame>> {
        loop {
            self.join();

            let frame = tokio::select! {
                biased;
                frame = next_of(&mut self.coming) => {
                    if let Some(coming) = self.coming.take() {
                        self.watcher = coming;
                    }
                    frame?
                }
                frame = self.watcher.next() => frame?,
                Ok(()) = self.leaders.changed() => continue,
            };

            // A larger picture takes longer, so the first one may be of a frame that was already returned.
            if frame.picture.number > self.last {
                self.last = frame.picture.number;
                return Some(frame);
            }
        }
    }

    /// Joins the viewers of the size that leads now. Frames of the previous size continue until the first frame of a
    /// larger one arrives, as they do for the viewers themselves.
    fn join(&mut self) {
        let size = leading(&self.leaders.borrow_and_update()).min(self.live.largest());
        if self.coming.as_ref().unwrap_or(&self.watcher).size() == size {
            return;
        }

        self.coming = (size > self.watcher.size()).then(|| self.live.watch(size));
        if size < self.watcher.size() {
            self.watcher = self.live.watch(size);
        }
    }
}

/// The next frame of the size `coming`; waits forever if there is none.
async fn next_of(coming: &mut Option<Watcher>) -> Option<Arc<EncodedFrame>> {
    match coming {
        Some(coming) => coming.next().await,
        None => std::future::pending().await,
    }
}
