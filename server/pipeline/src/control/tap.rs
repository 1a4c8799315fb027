//! Passes the loop's frames to a recorder while one is connected.

use std::sync::Arc;

use arc_swap::ArcSwapOption;

use super::ControlledFrame;
use parfocal_devices::camera::FrameImage;
use parfocal_recording::{CapturedFrame, Intake, PatchRow};

/// Passes every frame of the loop to a recorder, if one is connected. The loop never waits: frames that the recorder
/// cannot take are lost and counted there. Clones share the connection.
#[derive(Clone, Default)]
pub struct Tap(Arc<ArcSwapOption<Intake>>);

impl Tap {
    /// Connects `intake`, in place of any other: frames go there from now on.
    pub fn connect(&self, intake: Arc<Intake>) {
        self.0.store(Some(intake));
    }

    /// Disconnects the recorder.
    pub fn disconnect(&self) {
        self.0.store(None);
    }

    /// Offers a frame. Colour pictures are not recorded.
    pub(super) fn offer(&self, controlled: &ControlledFrame) {
        let guard = self.0.load();
        let Some(intake) = guard.as_ref() else { return };
        let FrameImage::Mosaic(mosaic) = &controlled.frame.image else { return };

        intake.offer(CapturedFrame {
            number: controlled.frame.number,
            exposed_at: controlled.frame.exposed_at,
            exposure: controlled.frame.exposure,
            asked: controlled.record.asked,
            measured: controlled.record.measured,
            optimal: controlled.record.optimal,
            patch: PatchRow { corner: (controlled.patch.x as u64, controlled.patch.y as u64), jumps: controlled.jumps },
            mosaic: Arc::clone(mosaic),
        });
    }
}
