//! Publishes the pictures of one size to their viewers.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::sync::watch;

use super::{Counts, EncodedFrame};
use parfocal_base::step::StepRecord;
use parfocal_imaging::Size;

/// The sending end of a size's pictures.
#[derive(Clone)]
pub(super) struct Publisher {
    size: Size,
    sender: watch::Sender<Option<Arc<EncodedFrame>>>,
    counts: Arc<Counts>,
}

impl Publisher {
    /// The outlet for `size`, which counts its pictures in `counts`.
    pub(super) const fn new(size: Size, sender: watch::Sender<Option<Arc<EncodedFrame>>>, counts: Arc<Counts>) -> Self {
        Self { size, sender, counts }
    }

    /// Whether this size has viewers.
    pub(super) fn is_watched(&self) -> bool {
        self.counts.of(self.size).viewers.load(Ordering::Relaxed) > 0
    }

    /// Records the time that the picture of `step`'s frame `took`.
    pub(super) fn note_time(&self, step: &StepRecord, took: Duration) {
        self.counts.note_picture(self.size, step, took);
    }

    /// Hands `frame` to all viewers.
    pub(super) fn publish(&self, frame: EncodedFrame) {
        let counts = self.counts.of(self.size);
        counts.encoded.fetch_add(1, Ordering::Relaxed);
        counts.jpeg_bytes.fetch_add(frame.picture.jpeg.len() as u64, Ordering::Relaxed);
        self.sender.send_replace(Some(Arc::new(frame)));
    }
}
