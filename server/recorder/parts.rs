//! What recordings are made of.

use std::path::PathBuf;
use std::sync::Arc;

use tokio::sync::watch;

use crate::camera::Controls;
use crate::clock::Clock;
use crate::conductor::Conductor;
use crate::control::{ControlStatus, Tap};
use crate::imaging::Calibration;
use crate::live::LiveHandle;

/// What the recorder works with.
pub struct Parts {
    /// Both clocks.
    pub clock: Arc<dyn Clock>,
    /// This start of the server.
    pub run: i64,
    /// Where frames leave the control loop.
    pub tap: Tap,
    /// The loop's state.
    pub status: watch::Receiver<Arc<ControlStatus>>,
    /// The camera's settings, where it has any.
    pub controls: Option<Controls>,
    /// Pictures.
    pub live: LiveHandle,
    /// The sessions.
    pub conductor: Conductor,
    /// Folder of the recordings.
    pub folder: PathBuf,
    /// The sensor's calibration.
    pub calibration: Calibration,
    /// Width and height of the camera's mosaics, samples; none of a camera that delivers colour pictures.
    pub size: Option<(usize, usize)>,
}
