//! A frame as it is sent to clients: made once, in each version that somebody speaks.

use std::sync::OnceLock;
use std::time::Duration;

use bytes::Bytes;
use jiff::Timestamp;

use super::message::{self, Envelope, Version};
use parfocal_imaging::RgbImage;

/// Name of the pictures' device.
const PICTURES: &str = "Exoscope";
/// Name of the focal power's device.
const FOCAL_POWER: &str = "FocalPower";
/// Name of the status's device.
const STATUS: &str = "ExoscopeStatus";

/// A frame.
pub struct FrameMessages {
    content: Vec<u8>,
    stamp: u64,
    id: u32,
    /// Focal power at which it was exposed; `None` in a blinded session, or if it is unknown.
    focal_power: Option<f64>,
    /// The picture's message in each version, made when somebody speaks it.
    made: [OnceLock<Bytes>; 2],
}

impl FrameMessages {
    /// The frame whose picture is `picture`, exposed at `at`.
    pub fn new(picture: &RgbImage, spacing: f32, at: Timestamp, id: u32, focal_power: Option<f64>) -> Self {
        Self { content: message::image(picture, spacing), stamp: stamp(at), id, focal_power, made: Default::default() }
    }

    /// Whether it says more than the picture.
    pub const fn tells_focal_power(&self) -> bool {
        self.focal_power.is_some()
    }

    /// The picture's message. In version 3 its metadata has the focal power.
    pub fn picture(&self, version: Version) -> Bytes {
        let make = || {
            let metadata: Vec<_> = self.focal_power.iter().map(|value| (FOCAL_POWER, value.to_string())).collect();
            self.envelope("IMAGE", PICTURES).seal(version, &self.content, &metadata)
        };
        self.made[version as usize].get_or_init(make).clone()
    }

    /// The focal power's message, if it is told.
    pub fn focal_power(&self, version: Version) -> Option<Bytes> {
        let value = self.focal_power?;
        Some(self.envelope("NDARRAY", FOCAL_POWER).seal(version, &message::number(value), &[]))
    }

    const fn envelope(&self, kind: &'static str, device: &'static str) -> Envelope<'static> {
        Envelope { kind, device, stamp: self.stamp, id: self.id }
    }
}

/// The message about how the devices are.
pub fn status(version: Version, at: Timestamp, (code, name, words): (u16, &str, &str)) -> Bytes {
    let envelope = Envelope { kind: "STATUS", device: STATUS, stamp: stamp(at), id: 0 };
    envelope.seal(version, &message::status(code, name, words), &[])
}

/// A time as the protocol writes it.
fn stamp(at: Timestamp) -> u64 {
    let since = Duration::try_from(at.duration_since(Timestamp::UNIX_EPOCH)).unwrap_or_default();
    let fraction = (u64::from(since.subsec_nanos()) << 32) / 1_000_000_000;
    (since.as_secs() << 32) | fraction
}
