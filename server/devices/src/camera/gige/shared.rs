//! State shared by the camera's thread and its callers.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::device::Device;
use crate::camera::{CameraError, CameraHealth, Controls, Frame};
use parfocal_base::clock::{Clock, Moment};

/// State shared by the thread and the caller.
pub struct Shared {
    pub(super) clock: Arc<dyn Clock>,
    /// Settings that the operator can change.
    pub controls: Controls,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The latest frame, and when it was complete.
    frame: Option<(Frame, Moment)>,
    /// When the frame taken last was complete.
    taken: Option<Moment>,
    name: Arc<str>,
    fake: bool,
    /// The camera's state in words; an error when there is trouble.
    condition: Result<Arc<str>, Arc<str>>,
    delivered: VecDeque<Moment>,
    lost: u64,
    stop: bool,
}

impl Shared {
    /// State for a camera by the name `name` that is not there yet, with the reason.
    pub fn missing(clock: Arc<dyn Clock>, name: &str, trouble: &str) -> Self {
        let state = State {
            frame: None,
            taken: None,
            name: Arc::from(name),
            fake: false,
            condition: Err(Arc::from(trouble)),
            delivered: VecDeque::new(),
            lost: 0,
            stop: false,
        };

        Self { clock, controls: Controls::default(), state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Records that the camera is there.
    pub fn found(&self, device: &Device) {
        let mut state = self.state();
        state.name = Arc::from(device.name.as_str());
        state.fake = device.fake;
        state.condition = Ok(words(device));
    }

    /// Takes the latest frame, waiting for it at most `timeout`.
    pub fn next_frame(&self, timeout: Duration) -> Result<Frame, CameraError> {
        let (mut state, _) = self
            .changed
            .wait_timeout_while(self.state(), timeout, |state| state.frame.is_none())
            .unwrap_or_else(PoisonError::into_inner);

        match (state.frame.take(), &state.condition) {
            (Some((frame, whole_at)), _) => {
                state.taken = Some(whole_at);
                Ok(frame)
            }
            (None, Ok(_)) => Err(CameraError::Timeout(timeout)),
            (None, Err(trouble)) => Err(CameraError::Failed(trouble.to_string())),
        }
    }

    /// When the last packet of the frame taken last had arrived.
    pub fn whole_at(&self) -> Option<Moment> {
        self.state().taken
    }

    /// The camera's state.
    pub fn health(&self) -> CameraHealth {
        let now = self.clock.now();
        let state = self.state();
        let recent = state.delivered.iter().filter(|at| now.since(**at) < Duration::from_secs(1)).count();

        let message = match &state.condition {
            Ok(words) => words.clone(),
            Err(trouble) => Arc::from(format!("{trouble}; looking for it again")),
        };

        CameraHealth {
            name: state.name.clone(),
            simulated: state.fake,
            working: state.condition.is_ok(),
            message,
            fps: recent as f64,
            lost: state.lost,
        }
    }

    /// Tells the thread to end; returns whether it is busy with a camera.
    pub fn stop(&self) -> bool {
        let mut state = self.state();
        state.stop = true;
        self.changed.notify_all();
        state.condition.is_ok()
    }

    pub(super) fn stopping(&self) -> bool {
        self.state().stop
    }

    /// Offers a frame, complete since `whole_at`; a frame that nobody took counts as lost.
    pub(super) fn deliver(&self, frame: Frame, whole_at: Moment) {
        let now = self.clock.now();
        let mut state = self.state();

        state.lost += u64::from(state.frame.replace((frame, whole_at)).is_some());

        state.delivered.push_back(now);
        while state.delivered.front().is_some_and(|&at| now.since(at) > Duration::from_secs(1)) {
            state.delivered.pop_front();
        }

        self.changed.notify_all();
    }

    pub(super) fn lose(&self, frames: u64) {
        self.state().lost += frames;
    }

    pub(super) fn set_condition(&self, condition: Result<Arc<str>, Arc<str>>) {
        let mut state = self.state();
        if let Err(trouble) = &condition
            && state.condition.is_ok()
        {
            tracing::warn!(%trouble, "the camera is lost");
        }
        state.condition = condition;
    }

    /// Waits for `time`, or until the thread should end. Returns whether it should end.
    pub(super) fn stop_within(&self, time: Duration) -> bool {
        let (state, _) = self
            .changed
            .wait_timeout_while(self.state(), time, |state| !state.stop)
            .unwrap_or_else(PoisonError::into_inner);
        state.stop
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The camera's picture and packets in words.
pub(super) fn words(device: &Device) -> Arc<str> {
    let Device { width, height, format, packet, .. } = device;
    let packets = packet.map_or(String::new(), |bytes| format!(", packets of {bytes} bytes"));
    Arc::from(format!("{width}x{height} {}{packets}", format.name()))
}
