//! The state of recording, as the operator sees it.

use serde::Serialize;
use utoipa::ToSchema;

use parfocal_trial::protocol::Record;

/// State of recording. Sizes depend only on the picture, which the operator sees anyway.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct RecordingStatus {
    /// Why the operator cannot record; none if recording is possible.
    pub unavailable: Option<String>,
    /// What is being recorded, if anything.
    pub recording: Option<Record>,
    /// Name of its folder, below `recordings` in the data folder.
    pub folder: Option<String>,
    /// Whether the session's protocol asked for it.
    pub by_protocol: bool,
    /// Seconds since it began.
    pub seconds: Option<f64>,
    /// Frames recorded.
    pub frames: u64,
    /// Frames lost, because this machine or its disk was too slow.
    pub lost: u64,
    /// Bytes recorded.
    pub bytes: u64,
    /// Bytes a second, as measured; while nothing is recorded, what recording mosaics would take.
    pub bytes_per_second: Option<f64>,
    /// Bytes free on the disk.
    pub free_bytes: Option<u64>,
    /// Bytes of these that recordings leave free.
    pub reserve_bytes: Option<u64>,
    /// Seconds after which a recording would stop by itself.
    pub seconds_left: Option<f64>,
    /// How the last recording ended, or why it did not start.
    pub notice: Option<String>,
    /// Whether `notice` is a warning: frames were lost, or a recording did not begin or ended by itself.
    pub notice_warns: bool,
}
