//! Publishes the pictures of one size to their viewers.

use std::sync::Arc;

use tokio::sync::watch;

use super::frame_encoder::FrameEncoder;
use super::{Counts, EncodedFrame};
use crate::control::ControlledFrame;
use parfocal_base::clock::{Clock, Moment};
use parfocal_imaging::Size;

/// The sending end of a size's pictures.
#[derive(Clone)]
pub(super) struct Publisher {
    pub(super) size: Size,
    pub(super) sender: watch::Sender<Option<Arc<EncodedFrame>>>,
    pub(super) counts: Arc<Counts>,
    pub(super) clock: Arc<dyn Clock>,
}

impl Publisher {
    /// Whether this size has viewers.
    pub(super) fn is_watched(&self) -> bool {
        self.counts.of(self.size).viewers.get() > 0
    }

    /// Encodes `frame`, which `encoder` has developed since `began`, and hands it to all viewers.
    pub(super) fn publish(&self, encoder: &mut FrameEncoder, frame: &ControlledFrame, began: Moment) {
        match encoder.encode(frame) {
            Ok(made) => {
                let counts = self.counts.of(self.size);
                counts.encoded.inc();
                counts.jpeg_bytes.inc_by(made.picture.jpeg.len() as u64);
                self.sender.send_replace(Some(Arc::new(made)));
            }
            Err(error) => tracing::error!(%error, "a picture could not be encoded"),
        }
        self.counts.note_picture(self.size, &frame.record, self.clock.now().since(began));
    }
}
