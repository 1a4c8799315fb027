//! Where frames leave the loop to be recorded, while someone records.

use std::sync::Arc;

use arc_swap::ArcSwapOption;

use super::ControlledFrame;
use crate::camera::FrameImage;
use crate::recording::{Intake, Shot};

/// Hands every frame of the loop to a recorder, if one is connected. The loop never waits: what the recorder cannot
/// take is lost and counted there. Clone freely.
#[derive(Clone, Default)]
pub struct Tap(Arc<ArcSwapOption<Intake>>);

impl Tap {
    /// From now on frames go to `intake`, in place of any other.
    pub fn connect(&self, intake: Arc<Intake>) {
        self.0.store(Some(intake));
    }

    /// From now on frames go nowhere.
    pub fn disconnect(&self) {
        self.0.store(None);
    }

    /// Offers a frame. Colour pictures are not recorded.
    pub(super) fn offer(&self, controlled: &ControlledFrame) {
        let guard = self.0.load();
        let Some(intake) = guard.as_ref() else { return };
        let FrameImage::Mosaic(mosaic) = &controlled.frame.image else { return };

        intake.offer(Shot {
            number: controlled.frame.number,
            exposed_at: controlled.frame.exposed_at,
            exposure: controlled.frame.exposure,
            asked: controlled.record.asked,
            measured: controlled.record.measured,
            optimal: controlled.record.optimal,
            mosaic: Arc::clone(mosaic),
        });
    }
}
