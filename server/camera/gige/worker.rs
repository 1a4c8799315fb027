//! The camera's thread: unpacks frames, counts those lost, changes settings, finds a lost camera again.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use ::aravis::Buffer;

use super::device::{Arrival, Device, Wanted};
use super::numbers::steps;
use super::timestamps::{Timestamps, arrival};
use crate::camera::{CameraError, CameraHealth, Controls, Frame, FrameImage, MosaicPool, Setting};
use crate::clock::{Clock, Moment};
use crate::imaging::MosaicFrame;

/// The thread looks at requests at least this often.
const LOOK: Duration = Duration::from_millis(50);
/// A camera that sends nothing for this long, beyond its exposure, is lost.
const SILENCE: Duration = Duration::from_millis(1500);
/// Between two attempts to find a lost camera.
const RETRY: Duration = Duration::from_millis(300);

/// What the thread and the caller share.
pub struct Shared {
    clock: Arc<dyn Clock>,
    /// Settings.
    pub controls: Controls,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The latest frame, and when it was whole.
    frame: Option<(Frame, Moment)>,
    /// When the frame that was taken last was whole.
    taken: Option<Moment>,
    name: Arc<str>,
    fake: bool,
    /// What is the case, in words; an error is trouble.
    condition: Result<Arc<str>, Arc<str>>,
    delivered: VecDeque<Moment>,
    lost: u64,
    stop: bool,
}

impl Shared {
    /// For a camera that was just opened.
    pub fn new(clock: Arc<dyn Clock>, device: &Device) -> Self {
        let state = State {
            frame: None,
            taken: None,
            name: Arc::from(device.name.as_str()),
            fake: device.fake,
            condition: Ok(words(device)),
            delivered: VecDeque::new(),
            lost: 0,
            stop: false,
        };
        Self { clock, controls: Controls::default(), state: Mutex::new(state), changed: Condvar::new() }
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

    /// When the last packet of the frame that was taken last was in.
    pub fn whole_at(&self) -> Option<Moment> {
        self.state().taken
    }

    /// How the camera does.
    #[allow(clippy::cast_precision_loss, reason = "some hundred frames")]
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

    /// Tells the thread to end; whether it is busy with a camera.
    pub fn stop(&self) -> bool {
        let mut state = self.state();
        state.stop = true;
        self.changed.notify_all();
        state.condition.is_ok()
    }

    fn stopping(&self) -> bool {
        self.state().stop
    }

    /// Puts a frame, whole since `whole_at`, up for taking; one that nobody took counts as lost.
    fn deliver(&self, frame: Frame, whole_at: Moment) {
        let now = self.clock.now();
        let mut state = self.state();
        state.lost += u64::from(state.frame.replace((frame, whole_at)).is_some());
        state.delivered.push_back(now);
        while state.delivered.front().is_some_and(|&at| now.since(at) > Duration::from_secs(1)) {
            state.delivered.pop_front();
        }
        self.changed.notify_all();
    }

    fn lose(&self, frames: u64) {
        self.state().lost += frames;
    }

    fn set_condition(&self, condition: Result<Arc<str>, Arc<str>>) {
        let mut state = self.state();
        if let Err(trouble) = &condition
            && state.condition.is_ok()
        {
            tracing::warn!(%trouble, "the camera is lost");
        }
        state.condition = condition;
    }

    /// Waits `time`, or until the thread is to end; whether it is.
    fn stop_within(&self, time: Duration) -> bool {
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

/// Streams from `device`, and from the same camera opened anew when it is lost, until told to stop.
pub fn run(shared: &Shared, wanted: &Wanted, device: Device) {
    let mut number = 0;
    let mut connected = Some(device);
    while !shared.stopping() {
        let trouble = match connected.take().map_or_else(|| Device::open(wanted), Ok) {
            Ok(device) => {
                shared.set_condition(Ok(words(&device)));
                Session::new(shared, device, &mut number).stream()
            }
            Err(error) => error.to_string(),
        };
        shared.controls.offer(Vec::new());
        shared.set_condition(Err(trouble.into()));
        if shared.stop_within(RETRY) {
            return;
        }
    }
}

fn words(device: &Device) -> Arc<str> {
    let Device { width, height, format, packet, .. } = device;
    let packets = packet.map_or(String::new(), |bytes| format!(", packets of {bytes} bytes"));
    Arc::from(format!("{width}x{height} {}{packets}", format.name()))
}

/// A camera's streaming from one loss to the next.
struct Session<'a> {
    shared: &'a Shared,
    device: Device,
    /// Our number of the latest frame.
    number: &'a mut u64,
    /// The camera's number of the latest frame.
    seen: Option<u64>,
    /// As the camera has it; zero where it does not tell.
    exposure: Duration,
    pool: MosaicPool,
    timestamps: Timestamps,
}

impl<'a> Session<'a> {
    fn new(shared: &'a Shared, device: Device, number: &'a mut u64) -> Self {
        let pool = MosaicPool::new(device.width, device.height);
        let timestamps = Timestamps::default();
        let mut session = Self { shared, device, number, seen: None, exposure: Duration::ZERO, pool, timestamps };
        session.offer();
        session
    }

    /// Streams until the camera is lost or the thread is to end; says why.
    fn stream(mut self) -> String {
        let mut last = self.shared.clock.now();
        while !self.shared.stopping() {
            self.change_settings();
            match self.device.wait(LOOK) {
                Arrival::Whole(buffer) => {
                    last = self.shared.clock.now();
                    self.deliver(&buffer);
                    self.device.give_back(buffer);
                }
                Arrival::Incomplete(number) => {
                    last = self.shared.clock.now();
                    self.count(number);
                    self.shared.lose(1);
                }
                Arrival::Nothing if self.shared.clock.now().since(last) > SILENCE + self.exposure => {
                    return "no frames come from the camera: check its power, cable and trigger".into();
                }
                Arrival::Nothing => {}
            }
            if self.device.is_lost() {
                return "the camera went away: check its power and cable".into();
            }
        }
        "closed".into()
    }

    fn deliver(&mut self, buffer: &Buffer) {
        let arrived = arrival(buffer.system_timestamp(), self.shared.clock.as_ref());
        let now = self.shared.clock.now();
        self.count(buffer.frame_id());
        let exposed_at = self.timestamps.moment(buffer.timestamp(), arrived);
        match self.mosaic(&buffer.image_data()) {
            Some(mosaic) => {
                let (number, exposure, image) = (*self.number, self.exposure, FrameImage::Mosaic(mosaic));
                self.shared.deliver(Frame { number, exposed_at, exposure, image, truth: None }, now);
            }
            None => self.shared.lose(1),
        }
    }

    /// The mosaic of a frame's `bytes`; nothing if there are too few.
    fn mosaic(&mut self, bytes: &[u8]) -> Option<Arc<MosaicFrame>> {
        let Device { width, height, format, .. } = self.device;
        let bytes = bytes.get(..format.bytes(width * height))?;
        let mut samples = self.pool.blank();
        format.unpack(bytes, &mut samples);
        self.pool.frame(samples).ok()
    }

    /// Moves our number on as the camera's went, gaps being frames lost.
    fn count(&mut self, camera_number: u64) {
        let steps = steps(self.seen, camera_number);
        *self.number += steps;
        self.shared.lose(steps - 1);
        self.seen = Some(camera_number);
    }

    fn change_settings(&mut self) {
        let wanted = self.shared.controls.take();
        if wanted.is_empty() {
            return;
        }
        for (setting, value) in wanted {
            if let Err(error) = self.device.change(setting, value) {
                tracing::warn!(?setting, value, %error, "the camera refused a setting");
                self.shared.controls.refuse(setting, &error.to_string());
            }
        }
        self.offer();
    }

    /// Says what can be changed, and notes how long the camera exposes.
    fn offer(&mut self) {
        let offers = self.device.offers();
        let exposure = offers.iter().find(|one| one.setting == Setting::Exposure);
        self.exposure = exposure.map_or(Duration::ZERO, |one| Duration::from_secs_f64(one.value.clamp(0.0, 1e9) / 1e6));
        self.shared.controls.offer(offers);
    }
}
