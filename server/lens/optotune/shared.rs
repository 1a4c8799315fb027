//! What the caller and the driver's thread share: the command slot, and what is known of the device.

use std::io;
use std::os::fd::OwnedFd;
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
    /// The thread is to end, and how to leave the lens.
    pub ending: Option<Ending>,
    /// Someone waits for fresh readings.
    pub refresh: bool,
    /// Counts the times that all readings were fresh.
    refreshed: u64,
}

/// How to leave the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// Without current.
    Relaxed,
    /// Where it is.
    AsItIs,
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

impl State {
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
            ending: None,
            refresh: false,
            refreshed: 0,
        };
        Ok(Self { clock, response, wake, state: Mutex::new(state), changed: Condvar::new() })
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
            .wait_timeout_while(self.state(), time, |state| state.ending.is_none())
            .unwrap_or_else(PoisonError::into_inner);
        state.ending.is_some()
    }

    /// Tells the thread to end, and how to leave the lens.
    pub fn end(&self, ending: Ending) {
        self.state().ending = Some(ending);
        self.changed.notify_all();
        self.wake();
    }
}
