//! A recording under way, of either kind.

use std::path::Path;

use super::view::ViewRecorder;
use crate::recording::{Progress, Recorder};
use crate::trial::protocol::Record;

/// What is being recorded.
pub enum Running {
    /// Mosaics.
    Mosaic(Recorder),
    /// The pictures that viewers get.
    View(ViewRecorder),
}

impl Running {
    /// How far it has come.
    pub fn progress(&self) -> Progress {
        match self {
            Self::Mosaic(recorder) => recorder.progress(),
            Self::View(recorder) => recorder.progress(),
        }
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        match self {
            Self::Mosaic(recorder) => recorder.folder(),
            Self::View(recorder) => recorder.folder(),
        }
    }

    /// Which of the two it is.
    pub const fn kind(&self) -> Record {
        match self {
            Self::Mosaic(_) => Record::Mosaic,
            Self::View(_) => Record::View,
        }
    }

    /// Stops, and says how it ended.
    pub fn stop(self) -> Progress {
        match self {
            Self::Mosaic(recorder) => recorder.stop(),
            Self::View(recorder) => recorder.stop(),
        }
    }
}
