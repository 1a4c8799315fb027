//! A recording under way, of either kind.

use std::path::Path;

use super::view::ViewRecorder;
use parfocal_recording::{Recorder, RecordingProgress};
use parfocal_trial::protocol::Record;

/// A recording under way, by what it records.
pub enum Running {
    /// Mosaics.
    Mosaic(Recorder),
    /// The pictures that viewers get.
    View(ViewRecorder),
}

impl Running {
    /// Frames and bytes recorded so far, and how the recording ended if it has.
    pub fn progress(&self) -> RecordingProgress {
        match self {
            Self::Mosaic(recorder) => recorder.progress(),
            Self::View(recorder) => recorder.progress(),
        }
    }

    /// Folder of the recording.
    pub fn folder(&self) -> &Path {
        match self {
            Self::Mosaic(recorder) => recorder.folder(),
            Self::View(recorder) => recorder.folder(),
        }
    }

    /// What is being recorded.
    pub const fn kind(&self) -> Record {
        match self {
            Self::Mosaic(_) => Record::Mosaic,
            Self::View(_) => Record::View,
        }
    }

    /// Stops the recording and returns its final progress.
    pub fn stop(self) -> RecordingProgress {
        match self {
            Self::Mosaic(recorder) => recorder.stop(),
            Self::View(recorder) => recorder.stop(),
        }
    }
}
