//! The camera's thread: streams from a camera until it is lost, and looks for one that is lost or not there yet.
//! Unpacks frames, counts lost ones, changes settings.

use std::sync::Arc;
use std::time::Duration;

use ::aravis::Buffer;

use super::device::{Arrival, Device, Setup};
use super::shared::{Shared, words};
use super::timestamps::Timestamps;
use crate::camera::pool::MosaicPool;
use crate::camera::{Frame, FrameImage, LEAST_FPS, Setting};
use parfocal_base::guarded;
use parfocal_imaging::MosaicFrame;

/// The thread checks for requests at least this often.
const LOOK: Duration = Duration::from_millis(50);
/// A camera that sends nothing for this long, beyond its exposure, counts as lost. A slow one may take the time of
/// three frames.
const SILENCE: Duration = Duration::from_millis(1500);
/// Time between two attempts to find a camera that is lost or not there yet.
const RETRY: Duration = Duration::from_millis(300);
/// GigE Vision counts frames from 1 to this number, and then again from 1.
const LAST_NUMBER: u64 = 65_535;

/// Streams from `device` until asked to stop. If the camera is lost, or not there yet, opens it again. Every picture
/// must be of `size`, for which everything else was set up.
pub fn run(shared: &Shared, setup: &Setup, device: Option<Device>, size: (usize, usize)) {
    let mut number = 0;
    let mut changes = Vec::new();
    let mut connected = device;

    while !shared.stopping() {
        let attempt = || match connected.take().map_or_else(|| Device::open(setup), Ok) {
            Ok(device) if (device.width, device.height) != size => format!(
                "the camera's picture is {}x{}, but the server was started for {}x{}: start it again while the camera \
                 is on, or give width and height",
                device.width, device.height, size.0, size.1
            ),
            Ok(device) => {
                shared.found(&device);
                Session::new(shared, device, &mut number, &mut changes).stream()
            }
            Err(error) => error.to_string(),
        };
        let trouble = guarded(attempt).unwrap_or_else(|panic| format!("its driver failed: {panic}"));
        if shared.stopping() {
            return;
        }

        shared.controls.offer(Vec::new());
        shared.set_condition(Err(trouble.into()));
        if shared.stop_within(RETRY) {
            return;
        }
    }
}

/// Streaming from a camera until it is lost.
struct Session<'a> {
    shared: &'a Shared,
    device: Device,
    /// Our number of the latest frame.
    number: &'a mut u64,
    /// The latest change of each setting. They are made again when a lost camera comes back, because it has forgotten
    /// them.
    changes: &'a mut Vec<(Setting, f64)>,
    /// The camera's number of the latest frame.
    seen: Option<u64>,
    /// Exposure time of the camera; zero if it does not report it.
    exposure: Duration,
    /// Time between frames; zero if the camera does not report it.
    period: Duration,
    /// Whether only incomplete frames come.
    torn: bool,
    pool: MosaicPool,
    timestamps: Timestamps,
}

impl<'a> Session<'a> {
    /// Prepares streaming from `device`. Our frame numbers continue from `number`, and the earlier `changes` of
    /// settings are made again.
    fn new(shared: &'a Shared, device: Device, number: &'a mut u64, changes: &'a mut Vec<(Setting, f64)>) -> Self {
        let pool = MosaicPool::new(device.width, device.height);
        let mut session = Self {
            shared,
            device,
            number,
            changes,
            seen: None,
            exposure: Duration::ZERO,
            period: Duration::ZERO,
            torn: false,
            pool,
            timestamps: Timestamps::default(),
        };

        for (setting, value) in session.changes.clone() {
            session.change(setting, value);
        }

        session.offer();
        session
    }

    /// Streams until the camera is lost or the thread should end; returns the reason if it is lost.
    fn stream(mut self) -> String {
        let mut last = self.shared.clock.now();
        let mut whole = last;
        while !self.shared.stopping() {
            self.change_settings();

            match self.device.wait(LOOK) {
                Arrival::Whole(buffer) => {
                    last = self.shared.clock.now();
                    whole = last;
                    self.tell_torn(false);
                    self.deliver(&buffer);
                    self.device.give_back(buffer);
                }
                Arrival::Incomplete(number) => {
                    last = self.shared.clock.now();
                    self.count(number);
                    self.shared.lose(1);
                    self.tell_torn(last.since(whole) > self.silence());
                }
                Arrival::Nothing if self.shared.clock.now().since(last) > self.silence() => {
                    return "the camera sends no frames: check its power, cable and trigger".into();
                }
                Arrival::Nothing => {}
            }

            if self.device.is_lost() {
                return "the camera is gone: check its power and cable".into();
            }
        }

        String::new()
    }

    /// How long a working camera may send nothing.
    fn silence(&self) -> Duration {
        SILENCE.max(3 * self.period) + self.exposure
    }

    /// Reports when every frame that comes is incomplete, and when that is over.
    fn tell_torn(&mut self, torn: bool) {
        if torn != self.torn {
            self.torn = torn;
            self.tell_condition();
        }
    }

    /// Tells the camera's picture, and what keeps its frames from coming whole or often enough.
    fn tell_condition(&self) {
        let torn = "; every frame arrives with parts missing: larger packets, a larger receive buffer, or fewer frames \
                    a second";
        let mut words = words(&self.device).to_string();
        words.push_str(if self.torn { torn } else { "" });
        words.push_str(&too_slow(self.exposure, self.period));
        self.shared.set_condition(Ok(words.into()));
    }

    fn deliver(&mut self, buffer: &Buffer) {
        let arrived = self.timestamps.arrival(buffer.system_timestamp(), self.shared.clock.as_ref());
        let now = self.shared.clock.now();

        self.count(buffer.frame_id());
        let exposed_at = self.timestamps.moment(buffer.timestamp(), arrived);

        match self.mosaic(&buffer.image_data()) {
            Some(mosaic) => {
                let number = *self.number;
                let exposure = self.exposure;
                let image = FrameImage::Mosaic(mosaic);
                self.shared.deliver(Frame { number, exposed_at, exposure, image, truth: None }, now);
            }
            None => self.shared.lose(1),
        }
    }

    /// The mosaic of a frame's `bytes`; `None` if there are too few.
    fn mosaic(&mut self, bytes: &[u8]) -> Option<Arc<MosaicFrame>> {
        let Device { width, height, format, .. } = self.device;
        let bytes = bytes.get(..format.bytes(width * height))?;

        let mut samples = self.pool.blank();
        format.unpack(bytes, &mut samples);
        self.pool.frame(samples).ok()
    }

    /// Advances our number as far as the camera's; gaps are frames lost.
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
            self.change(setting, value);
        }
        self.offer();
    }

    fn change(&mut self, setting: Setting, value: f64) {
        match self.device.change(setting, value) {
            Ok(()) => {
                self.changes.retain(|(known, _)| *known != setting);
                self.changes.push((setting, value));
            }
            // What was accepted before still holds, also for the next connection.
            Err(error) => {
                tracing::warn!(?setting, value, %error, "the camera refused a setting");
                self.shared.controls.refuse(setting, &error.to_string());
            }
        }
    }

    /// Publishes what can be changed, and notes the camera's exposure time and frame rate.
    fn offer(&mut self) {
        let offers = self.device.offers();
        let value = |setting| offers.iter().find(|one| one.setting == setting).map(|one| one.value);
        let seconds = |value: f64| Duration::from_secs_f64(value.clamp(0.0, 1000.0));

        let exposure = value(Setting::Exposure).map_or(Duration::ZERO, |micros| seconds(micros / 1e6));
        self.period =
            value(Setting::FrameRate).filter(|&rate| rate > 0.0).map_or(Duration::ZERO, |rate| seconds(1.0 / rate));

        if exposure != self.exposure {
            self.timestamps.forget();
        }
        self.exposure = exposure;
        self.shared.controls.offer(offers);
        self.tell_condition();
    }
}

/// What to do if the camera makes fewer frames than the control loop needs: these would seem to fail to come. A
/// specification may ask for so long an exposure, and a camera may have it from before. Empty if it makes enough.
fn too_slow(exposure: Duration, period: Duration) -> String {
    // A tenth more, because cameras round their rates.
    const LONGEST: Duration = Duration::from_millis(1100 / LEAST_FPS as u64);

    let needed = format!("the control loop needs {LEAST_FPS} frames a second");
    if exposure > LONGEST {
        format!("; {needed}, and an exposure takes {} ms: shorten it", exposure.as_millis())
    } else if period > LONGEST {
        format!("; {needed}, and the camera makes {:.1}: raise its frame rate", 1.0 / period.as_secs_f64())
    } else {
        String::new()
    }
}

/// Frames from the camera's number `seen` to `now`; 1 if its counting was interrupted.
const fn steps(seen: Option<u64>, now: u64) -> u64 {
    match seen {
        Some(seen) if now > seen => now - seen,
        // The number rolled over, unless that would be an absurd gap. Some cameras do not leave out 0.
        Some(seen) if now > 0 && seen <= LAST_NUMBER && now + LAST_NUMBER - seen < 1000 => now + LAST_NUMBER - seen,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cameras_numbers_roll_over_and_leave_gaps() {
        assert_eq!(steps(None, 17), 1);
        assert_eq!(steps(Some(17), 18), 1);
        assert_eq!(steps(Some(17), 20), 3);
        assert_eq!(steps(Some(65_535), 1), 1);
        assert_eq!(steps(Some(65_534), 2), 3);
        assert_eq!(steps(Some(65_535), 0), 1, "a camera that counts from 0");
        assert_eq!(steps(Some(5000), 1), 1, "the camera restarted");
        assert_eq!(steps(Some(1 << 40), 3), 1);
    }

    #[test]
    fn a_camera_too_slow_for_the_control_loop_is_told_what_to_change() {
        let told = |exposure, period| too_slow(Duration::from_millis(exposure), Duration::from_millis(period));
        assert!(told(500, 500).ends_with("needs 5 frames a second, and an exposure takes 500 ms: shorten it"));
        assert!(told(20, 400).ends_with("and the camera makes 2.5: raise its frame rate"));
        assert_eq!(told(200, 200) + &told(0, 0), "");
    }
}
