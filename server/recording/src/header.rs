//! A recording's description of itself: the attributes of its Zarr group.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// Value of [`Header::format`].
pub const FORMAT: &str = "parfocal-recording";
/// Value of [`Header::version`].
pub const VERSION: u64 = 1;
/// Folder of the calibration, below the recording's own.
pub const CALIBRATION: &str = "calibration";

/// How a recording was made. The group's attributes, beside those that Zarr readers need.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Always [`FORMAT`].
    pub format: String,
    /// Always [`VERSION`].
    pub version: u64,
    /// The program that made it, and its version.
    pub software: String,
    /// Wall-clock time (UTC) from which `time` counts.
    pub started: Timestamp,
    /// Name of the camera, for people.
    pub camera: String,
    /// Name of the lens, for people.
    pub lens: String,
    /// Whether camera or lens are simulated.
    pub simulated: bool,
    /// Name and version of the sensor's calibration, which lies in the folder `calibration`.
    pub calibration: String,
    /// The camera's settings when the recording began, by name, if it has any: `exposure` in microseconds, `gain`,
    /// `frame-rate` in frames per second.
    pub camera_settings: BTreeMap<String, f64>,
    /// The trial session that it was made in, if one was under way.
    pub session: Option<String>,
    /// Number of the server's start that recorded it, as in exports; `None` if it was made without a server.
    pub run: Option<i64>,
    /// The monotonic clock at `started`, nanoseconds; comparable with the times of an export within a run.
    pub monotonic_ns: Option<i64>,
    /// Frames that the camera delivered but the recorder was too slow for.
    pub frames_lost: u64,
    /// How it ended; `None` while it is under way, or if it was cut short.
    pub ended: Option<Ended>,
}

/// Why a recording ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "why", content = "problem", rename_all = "kebab-case")]
pub enum Ended {
    /// It was stopped, as intended.
    Stopped,
    /// The disk's reserve was reached.
    DiskNearlyFull,
    /// Something failed; holds the problem in words.
    Failed(String),
}

impl std::fmt::Display for Ended {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Stopped => out.write_str("stopped"),
            Self::DiskNearlyFull => out.write_str("the disk is nearly full"),
            Self::Failed(problem) => out.write_str(problem),
        }
    }
}
