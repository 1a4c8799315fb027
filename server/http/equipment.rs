//! What the server knows of its devices from its start: the focus loop holds them, so they are not asked again.

use std::sync::Arc;

use tokio::sync::Mutex;

use crate::imaging::Calibration;
use crate::lens::LensInfo;

/// What the server knows of its devices from its start.
pub struct Equipment {
    /// What the lens said of itself, if it did.
    pub lens: Option<LensInfo>,
    /// The sensor's calibration.
    pub calibration: Arc<Calibration>,
    /// Width and height of the camera's mosaics, samples; none of a camera that delivers colour pictures.
    pub mosaics: Option<(usize, usize)>,
    /// Held while the machine is looked at. A disk that hangs then holds one thread, however often somebody asks.
    pub(super) look: Arc<Mutex<()>>,
}

impl Equipment {
    /// A lens, a calibration and a camera as they were found.
    #[must_use]
    pub fn new(lens: Option<LensInfo>, calibration: Arc<Calibration>, mosaics: Option<(usize, usize)>) -> Self {
        Self { lens, calibration, mosaics, look: Arc::default() }
    }
}
