//! What the caller and the driver's thread share: the command slot, and what is known of the device.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rustix::event::{EventfdFlags, eventfd};

use super::range::Range;
use super::status::Status;
use crate::clock::{Clock, Moment};
use crate::lens::{FocalPower, LensError, Response};

/// A command that waited this long in the slot is not being carried out.
const STALLED: Duration = Duration::from_millis(250);

/// Both sides hold one. The lock is never held over input or output.
pub struct Shared {
    /// Time.
    pub clock: Arc<dyn Clock>,
    /// Model of the glass, fed when a command goes over the wire.
    pub response: Arc<Response>,
    /// Readable when there is something for the thread to look at.
    pub wake: OwnedFd,
    line_errors: AtomicU64,
    state: Mutex<State>,
    changed: Condvar,
}

/// Everything known.
pub struct State {
    /// The latest command that is not yet on its way, and when the slot was filled.
    wanted: Option<(FocalPower, Moment)>,
    /// The latest command that was taken: what is restored when the lens comes back.
    pub last: Option<FocalPower>,
    /// The device while it is connected and focal power is under control, else why it is not.
    pub device: Result<Device, LensError>,
    /// Whether the first attempt to connect is over.
    tried: bool,
    /// How a connected device does, in words.
    pub message: Arc<str>,
    /// Why commands are not carried out though the device is connected.
    pub refusal: Option<Arc<str>>,
    /// Whether a lens driver ever greeted back here.
    pub greeted: bool,
    /// How far the thread is.
    progress: Progress,
    /// Someone waits for fresh readings.
    pub refresh: bool,
    /// Counts the times that all readings were fresh.
    refreshed: u64,
}

/// A connected device.
#[derive(Clone)]
pub struct Device {
    /// Firmware's type and version.
    pub firmware: String,
    /// Serial number.
    pub serial: String,
    /// What focal power 0..=1 stands for.
    pub range: Range,
    /// Mode of control, by number.
    pub mode: u8,
    /// Status bits.
    pub status: Status,
    /// Of the lens, in °C.
    pub temperature: f64,
    /// Focal power set, as read back, in the driver's own units.
    pub read_back: i16,
}

/// How far the thread is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    Serving,
    /// It is to end.
    Ending,
    Ended,
}

impl State {
    /// Whether the thread is to end.
    pub fn ending(&self) -> bool {
        self.progress != Progress::Serving
    }

    /// Whether a lens driver was ever connected here.
    pub const fn was_connected(&self) -> bool {
        self.refreshed > 0
    }
}

impl Shared {
    /// # Errors
    /// When the system has no event descriptor left.
    pub fn new(clock: Arc<dyn Clock>, response: Arc<Response>) -> io::Result<Self> {
        let wake = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        let state = State {
            wanted: None,
            last: None,
            device: Err(LensError::Gone("still connecting".into())),
            tried: false,
            message: Arc::default(),
            refusal: None,
            greeted: false,
            progress: Progress::Serving,
            refresh: false,
            refreshed: 0,
        };
        let line_errors = AtomicU64::new(0);
        Ok(Self { clock, response, wake, line_errors, state: Mutex::new(state), changed: Condvar::new() })
    }

    /// What is known.
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a command into the slot, in place of one that is still there.
    ///
    /// # Errors
    /// When it will not be carried out.
    pub fn command(&self, target: FocalPower) -> Result<(), LensError> {
        let now = self.clock.now();
        let mut state = self.state();
        if let Err(trouble) = &state.device {
            return Err(trouble.clone());
        }
        let since = state.wanted.map_or(now, |(_, since)| since);
        state.wanted = Some((target, since));
        state.last = Some(target);
        let refusal = state.refusal.clone();
        drop(state);
        self.wake();
        if now.since(since) > STALLED {
            return Err(LensError::Stalled("its port accepts no more: check the USB cable".into()));
        }
        refusal.map_or(Ok(()), |why| Err(LensError::Refused(why.to_string())))
    }

    /// Takes the command out of the slot.
    pub fn take_command(&self) -> Option<FocalPower> {
        self.state().wanted.take().map(|(target, _)| target)
    }

    /// Whether a command waits in the slot.
    pub fn has_command(&self) -> bool {
        self.state().wanted.is_some()
    }

    /// Makes the thread look at the slot and the requests.
    pub fn wake(&self) {
        // Fails only when the counter is full, and then the thread is awake.
        let _ = rustix::io::write(&self.wake, &1_u64.to_ne_bytes());
    }

    /// Notes that the device is here.
    pub fn connected(&self, device: Device, message: Arc<str>) {
        let mut state = self.state();
        (state.device, state.message, state.refusal) = (Ok(device), message, None);
        (state.tried, state.refresh) = (true, false);
        state.refreshed += 1;
        self.changed.notify_all();
    }

    /// Notes that the device is away, and why. What was in the slot stays what will be restored.
    pub fn lost(&self, trouble: LensError) {
        let mut state = self.state();
        (state.device, state.wanted, state.refusal) = (Err(trouble), None, None);
        state.tried = true;
        self.changed.notify_all();
    }

    /// Notes that all readings are fresh.
    pub fn refreshed(&self) {
        let mut state = self.state();
        state.refresh = false;
        state.refreshed += 1;
        self.changed.notify_all();
    }

    /// Waits for the end of the first attempt to connect, at most `timeout`, and returns the device.
    ///
    /// # Errors
    /// With what stood in the way.
    pub fn wait_connected(&self, timeout: Duration) -> Result<Device, LensError> {
        let (state, _) = self
            .changed
            .wait_timeout_while(self.state(), timeout, |state| !state.tried)
            .unwrap_or_else(PoisonError::into_inner);
        state.device.clone()
    }

    /// Has everything read afresh, waits for it at most `timeout`, and returns it.
    ///
    /// # Errors
    /// When the device is away or does not answer in time.
    pub fn refresh(&self, timeout: Duration) -> Result<Device, LensError> {
        let before = {
            let mut state = self.state();
            state.refresh = true;
            state.refreshed
        };
        self.wake();
        let waiting = |state: &mut State| state.device.is_ok() && state.refreshed == before;
        let (state, late) =
            self.changed.wait_timeout_while(self.state(), timeout, waiting).unwrap_or_else(PoisonError::into_inner);
        match &state.device {
            Ok(_) if late.timed_out() => Err(LensError::Gone("it did not answer in time".into())),
            device => device.clone(),
        }
    }

    /// Waits `time`, or until the thread is to end; whether it is.
    pub fn stop_within(&self, time: Duration) -> bool {
        let (state, _) = self
            .changed
            .wait_timeout_while(self.state(), time, |state| !state.ending())
            .unwrap_or_else(PoisonError::into_inner);
        state.ending()
    }

    /// Tells the thread to end.
    pub fn end(&self) {
        let mut state = self.state();
        if state.progress == Progress::Serving {
            state.progress = Progress::Ending;
        }
        drop(state);
        self.changed.notify_all();
        self.wake();
    }

    /// Notes that the thread has ended.
    pub fn ended(&self) {
        self.state().progress = Progress::Ended;
        self.changed.notify_all();
    }

    /// Waits for the thread's end, at most `timeout`.
    pub fn wait_ended(&self, timeout: Duration) {
        let _ = self.changed.wait_timeout_while(self.state(), timeout, |state| state.progress != Progress::Ended);
    }

    /// Counts a reply that was damaged, late or missing, or noise.
    pub fn count_line_error(&self) {
        self.line_errors.fetch_add(1, Ordering::Relaxed);
    }

    /// How often that was.
    pub fn line_errors(&self) -> u64 {
        self.line_errors.load(Ordering::Relaxed)
    }
}
