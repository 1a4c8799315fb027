//! GigE Vision and USB3 Vision cameras, through Aravis.
//!
//! A thread of its own talks to the camera: it unpacks each frame to the sensor's mosaic, leaves the latest for
//! [`Camera::next_frame`], and looks for the camera again when it is lost.

mod device;
mod session;
mod shared;
mod timestamps;

use std::sync::{Arc, OnceLock, mpsc};
use std::thread::JoinHandle;
use std::time::Duration;

use ::aravis::Aravis;

use self::device::{Device, DeviceError, Setup};
use self::shared::Shared;
use super::{Camera, CameraError, CameraHealth, CameraSettings, Controls, Frame};
use parfocal_base::clock::Moment;
use parfocal_base::priority::ThreadRole;

/// A machine vision camera.
pub struct GigeCamera {
    size: (usize, usize),
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl GigeCamera {
    /// Connects to the camera `source`: an identity as [`list`] gives it, or an address; with options
    /// `format` (a pixel format), `width`, `height`, `packet` (bytes, instead of negotiating), `exposure`
    /// (microseconds), `gain`. With `list` as the source, the error lists the cameras that answer.
    ///
    /// # Errors
    /// [`CameraError::BadSource`], with the reason, if it cannot be used right now. It recovers from later failures by
    /// itself.
    pub fn open(source: &str, settings: CameraSettings) -> Result<Self, CameraError> {
        Self::open_as(source, settings, false)
    }

    /// The same, except that if `patient` is set, a camera that does not answer is treated like one that was lost: it
    /// is looked for until it is there.
    pub(super) fn open_as(source: &str, settings: CameraSettings, patient: bool) -> Result<Self, CameraError> {
        let setup = Setup::parse(source, settings.fps);
        let setup = setup.map_err(|error| CameraError::BadSource(format!("camera gige: {error}")))?;
        if setup.id == "list" {
            return Err(CameraError::BadSource(listing()));
        }

        let (sender, receiver) = mpsc::channel();
        let thread = std::thread::Builder::new()
            .name("gige".into())
            .spawn(move || {
                // Opened here, so that Aravis's thread that receives packets inherits the priority.
                parfocal_base::priority::raise_with_children(ThreadRole::Wire);
                let named = |error: DeviceError| format!("{}: {error}; {}", setup.id, listing());
                let (device, trouble) = match Device::open(&setup) {
                    Ok(device) => (Some(device), String::new()),
                    Err(error @ DeviceError::Away(_)) if patient => (None, named(error)),
                    Err(error) => {
                        let _ = sender.send(Err(named(error)));
                        return;
                    }
                };

                let size =
                    device.as_ref().map_or_else(|| setup.expected_size(), |device| (device.width, device.height));
                let shared = Arc::new(Shared::missing(settings.clock, &format!("camera {}", setup.id), &trouble));
                if let Some(device) = &device {
                    shared.found(device);
                } else {
                    tracing::warn!("{trouble}; looking for it");
                }
                let _ = sender.send(Ok((size, Arc::clone(&shared))));
                session::run(&shared, &setup, device, size);
            })
            .map_err(|error| CameraError::BadSource(format!("the system is out of resources: {error}")))?;

        let opened = receiver.recv().unwrap_or_else(|_| Err("the camera's thread ended at once".to_owned()));
        let (size, shared) = opened.map_err(CameraError::BadSource)?;
        Ok(Self { size, shared, thread: Some(thread) })
    }

    /// When the last packet of the latest frame from [`Camera::next_frame`] had arrived. The time of the transfer,
    /// which depends on the link, ends here. For measurements.
    pub fn whole_at(&self) -> Option<Moment> {
        self.shared.whole_at()
    }
}

impl Camera for GigeCamera {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        self.shared.next_frame(timeout)
    }

    fn health(&self) -> CameraHealth {
        self.shared.health()
    }

    fn mosaic_size(&self) -> Option<(usize, usize)> {
        Some(self.size)
    }

    fn controls(&self) -> Option<Controls> {
        Some(self.shared.controls.clone())
    }
}

impl Drop for GigeCamera {
    fn drop(&mut self) {
        // A thread that is looking for a lost camera ends by itself within seconds, so there is no need to wait for it.
        let streaming = self.shared.stop();
        if let Some(thread) = self.thread.take().filter(|_| streaming) {
            let _ = thread.join();
        }
    }
}

/// A camera that can be opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundCamera {
    /// Identity, by which it can be opened.
    pub id: String,
    /// Maker and model.
    pub model: String,
    /// Network address or USB port.
    pub address: String,
}

/// Every camera that answers, on every network interface and USB port. Takes about a second.
pub fn list() -> Vec<FoundCamera> {
    static ARAVIS: OnceLock<Option<std::sync::Mutex<Aravis>>> = OnceLock::new();
    let aravis = ARAVIS.get_or_init(|| Aravis::initialize().ok().map(std::sync::Mutex::new));
    let Some(aravis) = aravis else { return Vec::new() };
    let devices = aravis.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_device_list();

    let found = devices.into_iter().map(|device| FoundCamera {
        id: device.id.to_string_lossy().into_owned(),
        model: format!("{} {}", device.vendor.to_string_lossy(), device.model.to_string_lossy()),
        address: device.address.to_string_lossy().into_owned(),
    });
    found.collect()
}

fn listing() -> String {
    let found = list();
    if found.is_empty() {
        return "no camera answers: check power, cable and the network interface's address".into();
    }

    let one = |found: &FoundCamera| format!("gige:{} ({} at {})", found.id, found.model, found.address);
    format!("cameras that answer: {}", found.iter().map(one).collect::<Vec<_>>().join(", "))
}
