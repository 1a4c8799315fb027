//! From `--camera SPEC` to a camera.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use super::{Camera, CameraError, CameraSettings, footage, phantom, recorded, replay};
use parfocal_recording::CALIBRATION;

/// Opens the camera that `spec` names: `phantom`, `phantom:still` (in a clamp), `phantom:white` (before a
/// white tile), `phantom:dark` (with its lens cap on), `footage:PATH` with a video, an image or a folder
/// of images, `scan:DIR` with a recorded scan, `recording:DIR` with a hyperspectral recording, or `gige:ID`.
///
/// # Errors
/// [`CameraError::BadSource`] if the camera is unknown, or its source cannot be used.
pub fn open(spec: &str, settings: CameraSettings) -> Result<Box<dyn Camera>, CameraError> {
    match spec.split_once(':') {
        Some(("footage", path)) if !path.is_empty() => played(footage::open(Path::new(path), settings)),
        Some(("scan", path)) if !path.is_empty() => played(recorded::play(Path::new(path), settings)),
        Some(("recording", path)) if !path.is_empty() => played(replay::open(Path::new(path), settings)),
        #[cfg(feature = "aravis")]
        Some(("gige", source)) => Ok(Box::new(super::gige::GigeCamera::open(source, settings)?)),
        #[cfg(not(feature = "aravis"))]
        Some(("gige", _)) => Err(CameraError::BadSource(
            "this build has no GigE Vision: install libaravis-dev and libusb-1.0-0-dev, then build with \
             `--features aravis`"
                .into(),
        )),
        _ => played(phantom::open(spec, settings).ok_or_else(|| {
            format!(
                "unknown camera `{spec}`; choose `phantom` (a simulated brain; `phantom:still`, `phantom:white` and \
             `phantom:dark` to try the bench's commands), `footage:PATH` (a video, an image or a folder of images), \
             `scan:DIR` (a recorded scan), `recording:DIR` (a hyperspectral recording) or `gige:ID` (`gige:list` lists \
             them)"
            )
        })),
    }
}

/// The same, except that a GigE Vision or USB3 Vision camera that does not answer is treated like one that was lost: it
/// is looked for until it is there. For a server, which may be switched on before its camera.
///
/// # Errors
/// [`CameraError::BadSource`] if the camera is unknown, or its source cannot be used.
pub fn open_or_await(spec: &str, settings: CameraSettings) -> Result<Box<dyn Camera>, CameraError> {
    #[cfg(feature = "aravis")]
    if let Some(source) = spec.strip_prefix("gige:") {
        return Ok(Box::new(super::gige::GigeCamera::open_as(source, settings, true)?));
    }
    open(spec, settings)
}

/// The opened camera, or why it could not be opened.
fn played(opened: Result<impl Camera + 'static, impl Display>) -> Result<Box<dyn Camera>, CameraError> {
    match opened {
        Ok(camera) => Ok(Box::new(camera)),
        Err(error) => Err(CameraError::BadSource(error.to_string())),
    }
}

/// The calibration that comes with the camera `spec`: a recording's own. `None` for all other cameras.
pub fn own_calibration(spec: &str) -> Option<PathBuf> {
    spec.strip_prefix("recording:").filter(|path| !path.is_empty()).map(|path| Path::new(path).join(CALIBRATION))
}
