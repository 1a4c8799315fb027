//! The parts of the server that the recorder works with.

use std::path::PathBuf;
use std::sync::Arc;

use tokio::sync::watch;

use crate::conductor::Conductor;
use parfocal_base::clock::Clock;
use parfocal_devices::camera::Controls;
use parfocal_imaging::Calibration;
use parfocal_pipeline::control::{ControlStatus, Tap};
use parfocal_pipeline::live::LiveHandle;

/// The parts of the server that the recorder works with.
pub struct RecorderParts {
    /// Monotonic and wall clock.
    pub clock: Arc<dyn Clock>,
    /// Number of this run of the server.
    pub run: i64,
    /// Where frames leave the control loop.
    pub tap: Tap,
    /// Status of the control loop.
    pub status: watch::Receiver<Arc<ControlStatus>>,
    /// The camera's settings, if it has any.
    pub controls: Option<Controls>,
    /// Source of the pictures that viewers get.
    pub live: LiveHandle,
    /// Source of the sessions and of what their protocols ask to record.
    pub conductor: Conductor,
    /// Folder of the recordings.
    pub folder: PathBuf,
    /// The sensor's calibration.
    pub calibration: Calibration,
    /// Width and height of the camera's mosaics, samples; `None` for a camera that delivers colour pictures.
    pub size: Option<(usize, usize)>,
}
