//! Steps a policy over a recording: what it sees in each frame, and which focal power it would have requested. The lens
//! does not follow the policy: every frame shows what the lens did during the recording.

use std::sync::Arc;

use serde::Serialize;

use parfocal_autofocus::{Observation, Policy};
use parfocal_base::FocalPower;
use parfocal_base::PatchPlace;
use parfocal_devices::camera::FrameImage;
use parfocal_imaging::{CELL, Calibration, PATCH_SIDE, PatchArea, Reconstructor};
use parfocal_pipeline::control::{Eye, HoldReason};
use parfocal_recording::{FrameRow, PatchRow, Recording};

/// A policy's step on one frame. Focal powers are normalised to 0..=1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Index of the frame, from 0.
    pub frame: usize,
    /// Number that the camera gave the frame.
    pub frame_number: u64,
    /// End of the exposure, in nanoseconds since the recording's start.
    pub time_ns: i64,
    /// Left column of the patch, in mosaic cells.
    pub patch_x: usize,
    /// Top row of the patch, in mosaic cells.
    pub patch_y: usize,
    /// Focal power at the exposure, as given to the policy.
    pub focal_power: f64,
    /// Focus metric of the policy; none if it has none.
    pub metric: Option<f64>,
    /// Focal power that the policy requests after the frame.
    pub target: f64,
    /// Focal power that was requested after the frame when the recording was made.
    pub recorded_asked: f64,
    /// Best focal power, if the recording is simulated; otherwise none.
    pub recorded_optimal: Option<f64>,
}

/// Steps a policy over a recording, frame by frame. A frame that cannot be read, or of which the policy makes nothing
/// that can be used, gives an error in words.
pub struct Stepping<'a> {
    recording: &'a Recording,
    policy: Box<dyn Policy>,
    eye: Eye,
    jumps: Option<u64>,
    next: usize,
}

impl<'a> Stepping<'a> {
    /// Prepares `policy` for the first frame of `recording`, which was made with `calibration`.
    pub fn new(recording: &'a Recording, calibration: &Calibration, policy: Box<dyn Policy>) -> Self {
        let eye = Eye::new(Reconstructor::new(calibration));
        Self { recording, policy, eye, jumps: None, next: 0 }
    }

    fn step(&mut self, frame: usize, row: FrameRow) -> Result<Step, String> {
        let mosaic = self.recording.frame(frame).map_err(|error| error.to_string())?;
        let image = FrameImage::Mosaic(Arc::new(mosaic));
        let patch = self.patch(frame, &image, row.patch)?;
        let view = self.eye.look(&image, patch, self.policy.field_of_view());

        let focal_power = self.exposed_at(frame, row);
        let decision = self.policy.step(&Observation { view: &view, focal_power });
        let target = decision.target;
        let target = FocalPower::new(target).map_err(|_| match self.policy.fault() {
            // A policy in another process.
            Some(fault) => format!("at frame {frame} the policy gave no focal power: {fault}"),
            None => format!("at frame {frame} the policy returned {target}, which is not a focal power from 0 to 1"),
        })?;

        Ok(Step {
            frame,
            frame_number: row.number,
            time_ns: row.time,
            patch_x: patch.x,
            patch_y: patch.y,
            focal_power: focal_power.get(),
            metric: decision.metric,
            target: target.get(),
            recorded_asked: row.asked,
            recorded_optimal: FocalPower::new(row.optimal).ok().map(FocalPower::get),
        })
    }

    /// The patch where the control loop had it. Where it jumped, the policy forgets what it saw, as it did then.
    fn patch(&mut self, frame: usize, image: &FrameImage, patch: PatchRow) -> Result<PatchArea, String> {
        let no_patch = |reason: HoldReason| format!("frame {frame} holds nothing to focus on: {}", reason.message);
        let central = self.eye.find(image, PatchPlace::CENTRE, None).map_err(no_patch)?;
        if self.jumps.replace(patch.jumps).is_some_and(|jumps| jumps != patch.jumps) {
            self.policy.forget();
        }

        let (width, height) = self.recording.size();
        let within = |first: u64, samples: usize| {
            let last = (samples / CELL).checked_sub(PATCH_SIDE)?;
            usize::try_from(first).ok().filter(|first| *first <= last)
        };
        let (x, y) = patch.corner;
        match (within(x, width), within(y, height)) {
            (Some(x), Some(y)) => Ok(PatchArea { x, y, ..central }),
            _ => Err(format!(
                "frame {frame} has its patch at {x}, {y}, outside the picture; the columns patch_x and patch_y are damaged"
            )),
        }
    }

    /// Focal power at the middle of the frame's exposure. If the lens did not report it, the focal power that was
    /// requested after the previous frame.
    fn exposed_at(&self, frame: usize, row: FrameRow) -> FocalPower {
        let before = frame.checked_sub(1).map_or(row.asked, |before| self.recording.rows()[before].asked);
        let known = FocalPower::new(row.measured).or_else(|_| FocalPower::new(before));
        known.unwrap_or(FocalPower::MIDDLE)
    }
}

impl Iterator for Stepping<'_> {
    type Item = Result<Step, String>;

    fn next(&mut self) -> Option<Self::Item> {
        let frame = self.next;
        let row = *self.recording.rows().get(frame)?;
        self.next += 1;
        Some(self.step(frame, row))
    }
}
