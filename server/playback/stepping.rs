//! A policy stepped over a recording: what it sees in each frame, and what it would have asked of the lens. The lens
//! does not follow: every frame shows what the lens did then.

use std::sync::Arc;

use serde::Serialize;

use crate::autofocus::{Observation, Policy};
use crate::camera::FrameImage;
use crate::control::Eye;
use crate::imaging::{Calibration, ContentArea, GrayImage, Reconstructor, RgbImage, content_area};
use crate::lens::FocalPower;
use crate::live::{AreaWatch, DETECT_EVERY};
use crate::recording::{FrameRow, Recording, RecordingError};

/// Why a policy was not stepped over all of a recording.
#[derive(Debug, thiserror::Error)]
pub enum SteppingError {
    /// A frame cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A frame has no patch.
    #[error("frame {frame} holds nothing to focus on: {reason}")]
    NoPatch {
        /// The frame, from 0.
        frame: usize,
        /// Why.
        reason: Arc<str>,
    },
    /// The policy returned what is no focal power.
    #[error("at frame {frame} the policy asked for {target}, which is no focal power from 0 to 1")]
    InvalidTarget {
        /// The frame, from 0.
        frame: usize,
        /// What it asked for.
        target: f64,
    },
}

/// A policy's step on a frame. Focal power is normalised to 0..=1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// The frame, from 0.
    pub frame: usize,
    /// The camera's number of the frame.
    pub frame_number: u64,
    /// End of the exposure, nanoseconds since the recording's start.
    pub time_ns: i64,
    /// Left column of the patch, in mosaic cells.
    pub patch_x: usize,
    /// Top row of the patch, in mosaic cells.
    pub patch_y: usize,
    /// Focal power that the policy was told the frame was exposed at.
    pub focal_power: f64,
    /// The policy's focus metric, if it has one.
    pub metric: Option<f64>,
    /// Focal power that the policy asks for after the frame.
    pub target: f64,
    /// Focal power that was asked for when the recording was made.
    pub recorded_asked: f64,
    /// Best focal power, where a simulation knew it.
    pub recorded_optimal: Option<f64>,
}

/// Steps a policy over a recording, frame by frame.
pub struct Stepping<'a> {
    recording: &'a Recording,
    policy: Box<dyn Policy>,
    reconstructor: Reconstructor,
    eye: Eye,
    areas: AreaWatch,
    area: Option<ContentArea>,
    rgb: RgbImage,
    gray: GrayImage,
    next: usize,
}

impl<'a> Stepping<'a> {
    /// `policy` before the first frame of `recording`, which was made with `calibration`.
    #[must_use]
    pub fn new(recording: &'a Recording, calibration: &Calibration, policy: Box<dyn Policy>) -> Self {
        let reconstructor = Reconstructor::new(calibration);
        Self {
            recording,
            policy,
            eye: Eye::new(reconstructor.clone()),
            reconstructor,
            areas: AreaWatch::default(),
            area: None,
            rgb: RgbImage::default(),
            gray: GrayImage::default(),
            next: 0,
        }
    }

    fn step(&mut self, frame: usize, row: FrameRow) -> Result<Step, SteppingError> {
        let mosaic = self.recording.frame(frame)?;

        // As often as the server looks for it; the first frame shows it already.
        if (frame as u64).is_multiple_of(DETECT_EVERY) {
            self.reconstructor.reconstruct(&mosaic, &mut self.rgb, &mut self.gray);
            if let Some(news) = self.areas.see(content_area::detect(&self.gray)) {
                self.area = news;
            }
        }

        let image = FrameImage::Mosaic(Arc::new(mosaic));
        let patch = self.eye.find(&image, self.area.as_ref());
        let patch = patch.map_err(|reason| SteppingError::NoPatch { frame, reason: reason.message })?;
        let view = self.eye.look(&image, patch, self.policy.field_of_view());

        let focal_power = self.exposed_at(frame, row);
        let decision = self.policy.step(&Observation { view: &view, focal_power });
        let target = decision.target;
        let target = FocalPower::new(target).map_err(|_| SteppingError::InvalidTarget { frame, target })?;

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

    /// Focal power at the middle of the frame's exposure; where the lens did not say, what it was asked for after the
    /// frame before.
    fn exposed_at(&self, frame: usize, row: FrameRow) -> FocalPower {
        let before = frame.checked_sub(1).map_or(row.asked, |before| self.recording.rows()[before].asked);
        let known = FocalPower::new(row.measured).or_else(|_| FocalPower::new(before));
        known.unwrap_or(FocalPower::MIDDLE)
    }
}

impl Iterator for Stepping<'_> {
    type Item = Result<Step, SteppingError>;

    fn next(&mut self) -> Option<Self::Item> {
        let frame = self.next;
        let row = *self.recording.rows().get(frame)?;
        self.next += 1;
        Some(self.step(frame, row))
    }
}
