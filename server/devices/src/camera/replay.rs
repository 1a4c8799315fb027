//! A hyperspectral recording as a camera: plays its frames at their own pace, over and over.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::playback::base_name;
use super::{Camera, CameraError, CameraHealth, CameraSettings, Frame, FrameImage, Truth};
use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment};
use parfocal_recording::{Recording, RecordingError};

/// Pause before the recording starts again, if it is too short to have a frame rate.
const PAUSE: Duration = Duration::from_millis(40);

/// Plays the recording in `path` as a camera. It shows what was seen then, however the lens moves now.
///
/// # Errors
/// If there is no recording, it cannot be read, or it has no frames.
pub fn open(path: &Path, settings: CameraSettings) -> Result<impl Camera + use<>, RecordingError> {
    let recording = Recording::open(path)?;
    recording.frame(0)?;

    let rate = recording.rate();
    let name = format!("recording {} (a recording of: {})", base_name(path), recording.header().camera);
    Ok(Replay {
        name: name.into(),
        start: settings.clock.now(),
        round: nanoseconds(
            Duration::from_secs_f64(recording.seconds())
                + rate.map_or(PAUSE, |rate| Duration::from_secs_f64(1.0 / rate)),
        ),
        rate: rate.unwrap_or(0.0),
        clock: settings.clock,
        recording,
        shown: 0,
        lost: 0,
        fault: None,
    })
}

struct Replay {
    name: Arc<str>,
    recording: Recording,
    clock: Arc<dyn Clock>,
    start: Moment,
    /// Nanoseconds from one beginning of the recording to the next; not 0.
    round: u64,
    rate: f64,
    /// Frames whose time has come, shown or lost, over all rounds.
    shown: u64,
    lost: u64,
    fault: Option<Arc<str>>,
}

impl Replay {
    /// Nanoseconds after the start at which frame `number` (from 0, over all rounds) is due.
    fn due(&self, number: u64) -> u64 {
        let rows = self.recording.rows();
        let count = rows.len() as u64;
        let first = rows.first().map_or(0, |row| row.time);
        let time = rows.get((number % count) as usize).map_or(0, |row| row.time.saturating_sub(first));
        u64::try_from(time).unwrap_or(0).saturating_add(self.round.saturating_mul(number / count))
    }

    /// The frame to show next: the latest whose time has come, or the first that is still to come.
    fn next(&self, elapsed: u64) -> u64 {
        // Whole rounds that were missed are skipped at once: they may be billions, if frames are nanoseconds apart.
        let begun = elapsed / self.round * self.recording.rows().len() as u64;
        let mut next = self.shown.max(begun);
        while self.due(next + 1) <= elapsed {
            next += 1;
        }
        next
    }
}

impl Camera for Replay {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        let elapsed = nanoseconds(self.clock.now().since(self.start));
        let next = self.next(elapsed);

        let ahead = Duration::from_nanos(self.due(next).saturating_sub(elapsed));
        std::thread::sleep(ahead.min(timeout));
        if ahead > timeout {
            return Err(CameraError::Timeout(timeout));
        }

        self.lost += next - self.shown;
        self.shown = next + 1;

        let index = (next % self.recording.rows().len() as u64) as usize;
        let read = self.recording.frame(index);
        self.fault = read.as_ref().err().map(|error| Arc::from(error.to_string()));
        let mosaic = read.map_err(|error| CameraError::Failed(error.to_string()))?;

        let row = self.recording.rows()[index];
        let known = |power: f64| FocalPower::new(power).ok();
        Ok(Frame {
            number: next + 1,
            exposed_at: self.clock.now(),
            exposure: Duration::try_from_secs_f64(row.exposure / 1e3).unwrap_or_default(),
            image: FrameImage::Mosaic(Arc::new(mosaic)),
            truth: known(row.optimal).zip(known(row.measured)).map(|(optimal, exposed)| Truth { optimal, exposed }),
        })
    }

    fn mosaic_size(&self) -> Option<(usize, usize)> {
        Some(self.recording.size())
    }

    fn computes(&self) -> bool {
        true
    }

    fn health(&self) -> CameraHealth {
        let message = || Arc::from(format!("repeats the {} frames of the recording", self.recording.rows().len()));
        CameraHealth {
            name: Arc::clone(&self.name),
            simulated: true,
            working: self.fault.is_none(),
            message: self.fault.clone().unwrap_or_else(message),
            fps: self.rate,
            lost: self.lost,
        }
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
