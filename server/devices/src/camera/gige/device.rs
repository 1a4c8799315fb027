//! One connection to a camera: opened, set up, streaming.

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ::aravis::prelude::*;
use ::aravis::{AcquisitionMode, Auto, Buffer, BufferStatus, GvDevice, Stream, glib};

use gio::prelude::*;

use crate::camera::{Adjustable, Setting};
use parfocal_base::options::{BadOptions, Options};
use parfocal_imaging::{CELL, PixelFormat};

/// Size of the sensor this program is made for.
const SENSOR: (i32, i32) = (2048, 1088);
/// Sides of a picture that can be asked for, pixels; the camera knows its own limits.
const SIDES: RangeInclusive<i32> = 1..=65_535;
/// Sizes of a packet that can be asked for, bytes.
const PACKETS: RangeInclusive<i32> = 1..=65_535;
/// Exposure times that can be asked for, microseconds: up to an hour.
const EXPOSURES: RangeInclusive<f64> = 0.001..=3.6e9;
/// Gains that can be asked for, in whatever unit the camera has.
const GAINS: RangeInclusive<f64> = -1e6..=1e6;
/// Frames that may be in transfer between camera and thread.
const BUFFERS: usize = 8;
/// Packet size for Aravis's fake camera: it cannot negotiate, and its loopback takes packets of any
/// size.
const FAKE_PACKET: i32 = 16_000;

/// Which camera to open, and how to set it up.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// Identity, or network address.
    pub id: String,
    /// Pixel format; `None` for the best that the camera has.
    format: Option<PixelFormat>,
    width: Option<i32>,
    height: Option<i32>,
    /// Bytes of a GigE Vision packet; `None` to negotiate.
    packet: Option<i32>,
    /// Exposure time, microseconds; `None` for the camera's own.
    exposure: Option<f64>,
    /// Gain, in the camera's own units; `None` for the camera's own.
    gain: Option<f64>,
    fps: f64,
}

impl Setup {
    /// Parses `source`, with `fps` as the rate.
    pub fn parse(source: &str, fps: f64) -> Result<Self, BadOptions> {
        let (id, mut options) = Options::split(source)?;
        let setup = Self {
            id: id.to_owned(),
            format: options.take("format")?,
            width: options.take_within("width", SIDES, " pixels")?,
            height: options.take_within("height", SIDES, " pixels")?,
            packet: options.take_within("packet", PACKETS, " bytes")?,
            exposure: options.take_within("exposure", EXPOSURES, " microseconds")?,
            gain: options.take_within("gain", GAINS, "")?,
            fps,
        };

        options.finish()?;
        Ok(setup)
    }

    /// Width and height to expect of a camera that is not there yet: those asked for, otherwise the sensor's.
    pub fn expected_size(&self) -> (usize, usize) {
        let side = |given: Option<i32>, usual: i32| usize::try_from(given.unwrap_or(usual)).unwrap_or_default();
        (side(self.width, SENSOR.0), side(self.height, SENSOR.1))
    }
}

/// A camera that streams, until dropped.
pub struct Device {
    camera: ::aravis::Camera,
    stream: Stream,
    lost: Arc<AtomicBool>,
    /// Maker and model.
    pub name: String,
    /// Whether it is Aravis's own fake camera.
    pub fake: bool,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Pixel format in use.
    pub format: PixelFormat,
    /// Bytes of a packet, on GigE Vision.
    pub packet: Option<u32>,
}

/// Why a camera cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// It does not answer.
    #[error("{0}")]
    Away(glib::Error),
    /// Aravis reports an error.
    #[error("{0}")]
    Aravis(#[from] glib::Error),
    /// This program cannot use the camera.
    #[error("{0}")]
    Unsuitable(String),
}

/// What the stream delivered.
pub enum Arrival {
    /// A whole frame.
    Whole(Buffer),
    /// A frame with parts missing; holds the camera's number of it.
    Incomplete(u64),
    /// Nothing came in time.
    Nothing,
}

impl Device {
    /// Connects to the camera of `setup`, sets it up and starts it.
    pub fn open(setup: &Setup) -> Result<Self, DeviceError> {
        let camera = connect(&setup.id).map_err(DeviceError::Away)?;

        let vendor = camera.vendor_name()?;
        let model = camera.model_name()?;
        let fake = vendor == "Aravis";

        let format = choose_format(&camera, setup.format)?;
        let (width, height) = set_region(&camera, setup)?;
        camera.set_acquisition_mode(AcquisitionMode::Continuous)?;

        // A camera that does not support one of these still runs: exposure and rate can still be set by hand.
        let _ = camera.set_exposure_time_auto(Auto::Off);
        let _ = camera.set_gain_auto(Auto::Off);

        if let Some(exposure) = setup.exposure {
            camera.set_exposure_time(exposure)?;
        }
        if let Some(gain) = setup.gain {
            camera.set_gain(gain)?;
        }
        set_frame_rate(&camera, setup.fps);

        let packet = negotiate_packet(&camera, setup.packet.or(fake.then_some(FAKE_PACKET)))?;
        let stream = camera.create_stream()?;
        let payload = usize::try_from(camera.payload()?).unwrap_or_default();
        for _ in 0..BUFFERS {
            stream.push_buffer(Buffer::new_allocate(payload));
        }

        let lost = Arc::new(AtomicBool::new(false));
        if let Some(device) = camera.device() {
            let noted = lost.clone();
            device.connect_control_lost(move |_| noted.store(true, Ordering::Relaxed));
        }

        camera.start_acquisition()?;

        let name = format!("{vendor} {model}");
        Ok(Self { camera, stream, lost, name, fake, width, height, format, packet })
    }

    /// Whether the camera is known to be gone.
    pub fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }

    /// Waits for the next arrival. The caller must give a whole frame's buffer back.
    pub fn wait(&self, timeout: Duration) -> Arrival {
        let micros = u64::try_from(timeout.as_micros()).unwrap_or(u64::MAX);
        let Some(buffer) = self.stream.timeout_pop_buffer(micros) else { return Arrival::Nothing };
        if buffer.status() == BufferStatus::Success {
            return Arrival::Whole(buffer);
        }

        let number = buffer.frame_id();
        self.give_back(buffer);
        Arrival::Incomplete(number)
    }

    /// Lets the camera fill `buffer` again.
    pub fn give_back(&self, buffer: Buffer) {
        self.stream.push_buffer(buffer);
    }

    /// The settings that the camera offers to change.
    pub fn offers(&self) -> Vec<Adjustable> {
        let offer = |setting| {
            let (value, (min, max)) = match setting {
                Setting::Exposure => (self.camera.exposure_time().ok()?, self.camera.exposure_time_bounds().ok()?),
                Setting::Gain => (self.camera.gain().ok()?, self.camera.gain_bounds().ok()?),
                Setting::FrameRate => (self.camera.frame_rate().ok()?, self.camera.frame_rate_bounds().ok()?),
            };

            Some(Adjustable { setting, value, min, max })
        };

        Setting::ALL.into_iter().filter_map(offer).collect()
    }

    /// Changes a setting.
    pub fn change(&self, setting: Setting, value: f64) -> Result<(), DeviceError> {
        match setting {
            Setting::Exposure => self.camera.set_exposure_time(value)?,
            Setting::Gain => self.camera.set_gain(value)?,
            Setting::FrameRate => self.camera.set_frame_rate(value)?,
        }
        Ok(())
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let _ = self.camera.stop_acquisition();
    }
}

/// Opens the camera `id`. A camera on this same machine answers on every network interface, and Aravis may then wait
/// for its packets on the wrong one. So such a camera is opened again, by the loopback address.
fn connect(id: &str) -> Result<::aravis::Camera, glib::Error> {
    let camera = ::aravis::Camera::new(Some(id))?;
    let device = camera.device().and_then(|device| device.downcast::<GvDevice>().ok());
    let ends = device.map(|device| [device.device_address(), device.interface_address()].map(loopback));

    if ends != Some([true, false]) {
        return Ok(camera);
    }

    // A camera has one controller at a time, so the first must be closed.
    drop(camera);
    ::aravis::Camera::new(Some("127.0.0.1"))
}

fn loopback(address: Option<gio::SocketAddress>) -> bool {
    let inet = address.and_then(|address| address.downcast::<gio::InetSocketAddress>().ok());
    inet.is_some_and(|inet| inet.address().is_loopback())
}

fn choose_format(camera: &::aravis::Camera, wanted: Option<PixelFormat>) -> Result<PixelFormat, DeviceError> {
    let offered = camera.dup_available_pixel_formats_as_strings()?;
    let has = |format: &PixelFormat| offered.iter().any(|name| name == format.name());
    let chosen = wanted.map_or_else(|| PixelFormat::ALL.into_iter().find(has), |format| Some(format).filter(has));

    let Some(format) = chosen else {
        let wanted = wanted.map_or("any format that can be read".into(), |format| format.name().to_owned());
        return Err(DeviceError::Unsuitable(format!("it does not offer {wanted}; it offers {}", offered.join(", "))));
    };

    camera.set_pixel_format_from_string(format.name())?;
    Ok(format)
}

fn set_region(camera: &::aravis::Camera, setup: &Setup) -> Result<(usize, usize), DeviceError> {
    // The greatest sides are those beyond the offsets, which another program may have left. Sides of 0 stay as they
    // are.
    camera.set_region(0, 0, 0, 0)?;
    let width_most = camera.width_bounds()?.1;
    let height_most = camera.height_bounds()?.1;
    let width = setup.width.unwrap_or(whole_cells(width_most.min(SENSOR.0)));
    let height = setup.height.unwrap_or(whole_cells(height_most.min(SENSOR.1)));

    let fits = |side: i32, most: i32| side > 0 && side <= most && side == whole_cells(side);
    if !fits(width, width_most) || !fits(height, height_most) {
        return Err(DeviceError::Unsuitable(format!(
            "{width}x{height} cannot be used: sides must be multiples of {CELL}, at most {width_most}x{height_most}"
        )));
    }

    camera.set_region(0, 0, width, height)?;
    let (_, _, width, height) = camera.region()?;
    Ok((usize::try_from(width).unwrap_or_default(), usize::try_from(height).unwrap_or_default()))
}

/// The longest side of whole mosaic cells that fits into `most` pixels.
const fn whole_cells(most: i32) -> i32 {
    most - most % CELL as i32
}

/// Sets the rate nearest to `fps` that the camera offers.
fn set_frame_rate(camera: &::aravis::Camera, fps: f64) {
    let nearest = camera.frame_rate_bounds().map_or(fps, |(min, max)| fps.clamp(min, max.max(min)));
    if let Err(error) = camera.set_frame_rate(nearest) {
        tracing::warn!(%error, "the camera keeps its own frame rate");
    }
}

/// Sets the packet size. Large packets cost less, so by default Aravis finds the largest that gets through.
fn negotiate_packet(camera: &::aravis::Camera, wanted: Option<i32>) -> Result<Option<u32>, DeviceError> {
    if !camera.is_gv_device() {
        return Ok(None);
    }

    match wanted {
        Some(bytes) => camera.gv_set_packet_size(bytes)?,
        None => camera.gv_auto_packet_size()?,
    }
    Ok(Some(camera.gv_get_packet_size()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_is_cut_to_whole_cells() {
        assert_eq!([2048, 1088, 2046, 5, 3].map(whole_cells), [2048, 1088, 2044, 4, 0]);
    }
}
