//! A thread beside the imaging thread that takes the latest frame whenever it is done with one, so nobody waits for it.

use std::sync::Arc;
use std::thread::JoinHandle;

use crate::control::{ControlledFrame, LatestSlot};

/// Where the thread takes its frames.
pub(super) type FrameSlot = Arc<LatestSlot<ControlledFrame>>;

/// The thread; it is told to end, and waited for, when this is dropped.
pub(super) struct FrameThread {
    slot: FrameSlot,
    thread: Option<JoinHandle<()>>,
}

impl FrameThread {
    /// Starts the thread `name`, which does `work` until its slot is closed.
    ///
    /// # Errors
    /// If the system cannot create a thread.
    pub(super) fn start(name: String, work: impl FnOnce(FrameSlot) + Send + 'static) -> std::io::Result<Self> {
        let slot = FrameSlot::default();
        let taken = Arc::clone(&slot);
        let thread = std::thread::Builder::new().name(name).spawn(move || work(taken))?;
        Ok(Self { slot, thread: Some(thread) })
    }

    /// Hands `frame` over; never waits.
    pub(super) fn offer(&self, frame: &ControlledFrame) {
        self.slot.put(frame.clone());
    }
}

impl Drop for FrameThread {
    fn drop(&mut self) {
        self.slot.close();
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
