//! What the server learned about its devices when it started. The focus loop holds them, so they are not asked again.

use std::sync::Arc;

use tokio::sync::Mutex;

use parfocal_imaging::Calibration;

/// What the server learned about its devices when it started.
pub struct Equipment {
    /// The sensor's calibration.
    pub calibration: Arc<Calibration>,
    /// Width and height of the camera's mosaics, samples; `None` for a camera that delivers colour pictures.
    pub mosaics: Option<(usize, usize)>,
    /// Held while the machine is checked, so that a hanging disk blocks only one thread, however often somebody asks.
    pub(super) look: Arc<Mutex<()>>,
    /// Held while spectra of the live picture are computed, so that any number of requests takes one processor at most.
    pub(super) spectra: Mutex<()>,
}

impl Equipment {
    /// A calibration and a camera as they were at the start.
    pub fn new(calibration: Arc<Calibration>, mosaics: Option<(usize, usize)>) -> Self {
        Self { calibration, mosaics, look: Arc::default(), spectra: Mutex::default() }
    }
}
