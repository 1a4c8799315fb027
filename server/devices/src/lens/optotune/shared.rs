//! State shared by the caller and the driver's thread: the slot for commands, and the device's readings.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rustix::event::{EventfdFlags, eventfd};

use super::range::Range;
use super::status::Status;
use crate::lens::{LensError, Response};
use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment};

/// If a command has waited in the slot longer than this, commands are not being carried out.
const STALLED: Duration = Duration::from_millis(250);

/// Prefix of the serial numbers of emulated units (see [`crate::lens::emulator`]), which have no real lens.
const EMULATED: &str = "EMUL";

/// Shared by both sides. The lock is never held during input or output.
pub struct Shared {
    /// The clock for deadlines and time stamps.
    pub clock: Arc<dyn Clock>,
    /// Model of the lens. It gets each command when the command is sent.
    pub response: Arc<Response>,
    /// Becomes readable when the thread must look at the slot or the requests.
    pub wake: OwnedFd,
    line_errors: AtomicU64,
    state: Mutex<State>,
    changed: Condvar,
}

/// Everything known about the device.
#[allow(clippy::struct_excessive_bools, reason = "the device reports each by itself; no two make a state")]
pub struct State {
    /// The slot: the latest command not yet sent, and the time since which the slot has been full.
    wanted: Option<(FocalPower, Moment)>,
    /// The latest command accepted. It is sent again after a reconnection.
    pub last: Option<FocalPower>,
    /// The device while it is connected and controls focal power; otherwise the reason why not.
    pub device: Result<Device, LensError>,
    /// Whether the first attempt to connect has ended.
    tried: bool,
    /// The state of a connected device in words.
    pub message: Arc<str>,
    /// Why commands are not carried out although the device is connected.
    pub refusal: Option<Arc<str>>,
    /// Whether the device, or the last one that was connected, is an emulated unit.
    pub emulated: bool,
    /// Whether a lens driver has ever replied to the greeting on this port.
    pub greeted: bool,
    /// Progress of the thread.
    progress: Progress,
    /// Whether the caller waits for new readings.
    pub refresh: bool,
    /// Number of times that all readings were taken anew.
    refreshed: u64,
}

/// A connected device.
#[derive(Clone)]
pub struct Device {
    /// Firmware's type and version.
    pub firmware: String,
    /// Serial number.
    pub serial: String,
    /// The range that corresponds to focal power 0..=1.
    pub range: Range,
    /// Mode of control, by the driver's number.
    pub mode: u8,
    /// Status bits.
    pub status: Status,
    /// Temperature of the lens, °C.
    pub temperature: f64,
    /// The focal power set, as read back, in the driver's own units.
    pub read_back: i16,
}

/// Progress of the driver's thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    Serving,
    /// The thread was asked to end.
    Ending,
    Ended,
}

impl State {
    /// Whether the thread was asked to end, or has ended.
    pub fn ending(&self) -> bool {
        self.progress != Progress::Serving
    }

    /// Whether a lens driver has ever been connected on this port.
    pub const fn was_connected(&self) -> bool {
        self.refreshed > 0
    }
}

impl Shared {
    /// State for a driver that is not connected yet.
    ///
    /// # Errors
    /// If the system has no event descriptor left.
    pub fn new(clock: Arc<dyn Clock>, response: Arc<Response>) -> io::Result<Self> {
        let wake = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        let state = State {
            wanted: None,
            last: None,
            device: Err(LensError::Gone("still connecting".into())),
            tried: false,
            message: Arc::default(),
            refusal: None,
            emulated: false,
            greeted: false,
            progress: Progress::Serving,
            refresh: false,
            refreshed: 0,
        };

        let line_errors = AtomicU64::new(0);
        Ok(Self { clock, response, wake, line_errors, state: Mutex::new(state), changed: Condvar::new() })
    }

    /// Locks the state.
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a command into the slot. Replaces one that is still there.
    ///
    /// # Errors
    /// If the device is away, accepts commands too slowly, or did not follow earlier ones.
    pub fn command(&self, target: FocalPower) -> Result<(), LensError> {
        let now = self.clock.now();
        let mut state = self.state();
        if let Err(trouble) = &state.device {
            return Err(trouble.clone());
        }

        // The age of a replaced command is kept, because the slot has been full since then.
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
        // This fails only if the counter is full, and then the thread is awake.
        let _ = rustix::io::write(&self.wake, &1_u64.to_ne_bytes());
    }

    /// Records that the device is connected.
    pub fn connected(&self, device: Device, message: Arc<str>) {
        let mut state = self.state();
        state.emulated = device.serial.starts_with(EMULATED);
        state.device = Ok(device);
        state.message = message;
        state.refusal = None;
        state.tried = true;
        state.refresh = false;
        state.refreshed += 1;

        self.changed.notify_all();
    }

    /// Records that the device is away, and why. The latest command is kept, to be sent again later.
    pub fn lost(&self, trouble: LensError) {
        let mut state = self.state();
        state.device = Err(trouble);
        state.wanted = None;
        state.refusal = None;
        state.tried = true;

        self.changed.notify_all();
    }

    /// Records that all readings have been taken anew.
    pub fn refreshed(&self) {
        let mut state = self.state();
        state.refresh = false;
        state.refreshed += 1;
        self.changed.notify_all();
    }

    /// Waits at most `timeout` for the end of the first attempt to connect, and returns the device.
    ///
    /// # Errors
    /// If the device is not connected. The error gives the reason.
    pub fn wait_connected(&self, timeout: Duration) -> Result<Device, LensError> {
        self.wait_while(timeout, |state| !state.tried).0.device.clone()
    }

    /// Requests new readings, waits for them at most `timeout`, and returns them.
    ///
    /// # Errors
    /// If the device is away or does not answer in time.
    pub fn refresh(&self, timeout: Duration) -> Result<Device, LensError> {
        let before = {
            let mut state = self.state();
            state.refresh = true;
            state.refreshed
        };

        self.wake();

        let (state, late) = self.wait_while(timeout, |state| state.device.is_ok() && state.refreshed == before);

        match &state.device {
            Ok(_) if late => Err(LensError::Gone("it did not answer in time".into())),
            device => device.clone(),
        }
    }

    /// Waits for `time`, or until the thread is asked to end. Returns whether it was asked to end.
    pub fn stop_within(&self, time: Duration) -> bool {
        self.wait_while(time, |state| !state.ending()).0.ending()
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

    /// Records that the thread has ended.
    pub fn ended(&self) {
        self.state().progress = Progress::Ended;
        self.changed.notify_all();
    }

    /// Waits for the thread's end, at most `timeout`.
    pub fn wait_ended(&self, timeout: Duration) {
        drop(self.wait_while(timeout, |state| state.progress != Progress::Ended));
    }

    /// Waits as long as `waiting` holds, at most `timeout`. Returns the state, and whether it still held at the end.
    fn wait_while(&self, timeout: Duration, waiting: impl Fn(&State) -> bool) -> (MutexGuard<'_, State>, bool) {
        let waited = self.changed.wait_timeout_while(self.state(), timeout, |state| waiting(state));
        let (state, late) = waited.unwrap_or_else(PoisonError::into_inner);
        (state, late.timed_out())
    }

    /// Counts one line error: a reply that was damaged, late or missing, or noise.
    pub fn count_line_error(&self) {
        self.line_errors.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of line errors so far.
    pub fn line_errors(&self) -> u64 {
        self.line_errors.load(Ordering::Relaxed)
    }
}
