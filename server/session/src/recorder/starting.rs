//! Starts a recording: chooses its folder and writes its header.

use std::path::{Path, PathBuf};

use jiff::Timestamp;

use super::parts::RecorderParts;
use super::running::Running;
use super::view::ViewRecorder;
use parfocal_base::SOFTWARE;
use parfocal_base::files::remove;
use parfocal_base::ids::SessionId;
use parfocal_devices::camera::calibration;
use parfocal_recording::{
    CALIBRATION, FORMAT, Header, Recorder, RecordingError, Room, VERSION, VIEW_FORMAT, VIEW_VERSION, ViewHeader,
    ViewWriter, Writer, room,
};
use parfocal_records::store::Stamp;
use parfocal_trial::protocol::Record;

/// Why a recording was not started.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The camera has no mosaics.
    #[error("The camera delivers colour pictures. Only mosaics of a hyperspectral sensor can be recorded.")]
    NoMosaics,
    /// A recording is already under way.
    #[error("A recording is under way already. Stop it first.")]
    UnderWay,
    /// The disk has no room.
    #[error(
        "The disk has {:.1} GB free, and {:.1} GB of it stay free for the trial. Free some space.",
        .0.available as f64 / 1e9,
        .0.reserve as f64 / 1e9
    )]
    NoRoom(Room),
    /// The recording cannot be written, for the reason given.
    #[error("The recording could not be started: {0}.")]
    Failed(String),
}

impl From<RecordingError> for StartError {
    fn from(error: RecordingError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Begins to record into `folder`; `None` if `what` is [`Record::None`]. `session` is the session under way. Times
/// count from `began`.
///
/// # Errors
/// If the camera has no mosaics, the disk has no room, or the recording cannot be written.
pub fn start(
    parts: &RecorderParts,
    what: Record,
    folder: &Path,
    session: Option<SessionId>,
    began: Stamp,
) -> Result<Option<Running>, StartError> {
    let room = room(&parts.folder).map_err(|error| StartError::Failed(error.to_string()))?;
    if room.spare() == 0 {
        return Err(StartError::NoRoom(room));
    }

    let session = session.map(|session| session.to_string());
    match what {
        Record::None => Ok(None),
        Record::Mosaic => record_mosaics(parts, folder, session, began).map(Running::Mosaic).map(Some),
        Record::View => record_view(parts, folder, session, began).map(Running::View).map(Some),
    }
}

/// A folder in `recordings` that no recording has yet, named after the session or, without one, after the time `now`.
pub fn new_folder(recordings: &Path, session: Option<SessionId>, now: Timestamp) -> PathBuf {
    let name = match session {
        Some(session) => session.to_string(),
        None => now.strftime("%Y-%m-%dT%H-%M-%SZ").to_string(),
    };
    let numbered = |number: u32| if number == 1 { name.clone() } else { format!("{name}-{number}") };
    let mut names = (1..u32::MAX).map(|number| recordings.join(numbered(number)));
    names.find(|folder| !folder.exists()).unwrap_or_else(|| recordings.join(&name))
}

fn record_mosaics(
    parts: &RecorderParts,
    folder: &Path,
    session: Option<String>,
    began: Stamp,
) -> Result<Recorder, StartError> {
    let RecorderParts { status, calibration, controls, size, .. } = parts;
    let size = size.ok_or(StartError::NoMosaics)?;
    let status = status.borrow().clone();

    let header = Header {
        format: FORMAT.to_owned(),
        version: VERSION,
        software: SOFTWARE.to_owned(),
        started: began.wall,
        camera: status.camera.name.to_string(),
        lens: status.lens.name.to_string(),
        simulated: status.camera.simulated || status.lens.simulated,
        calibration: calibration.title(),
        camera_settings: controls.as_ref().map(|controls| controls.offered().by_name()).unwrap_or_default(),
        session,
        run: Some(parts.run),
        monotonic_ns: Some(began.at.as_nanos().cast_signed()),
        frames_lost: 0,
        ended: None,
    };

    let writer = Writer::create(folder, header, size, calibration)?;
    calibration::save(&folder.join(CALIBRATION), calibration, &[]).map_err(|error| {
        remove(folder);
        StartError::Failed(error.to_string())
    })?;
    Ok(Recorder::start(writer, began.at)?)
}

fn record_view(
    parts: &RecorderParts,
    folder: &Path,
    session: Option<String>,
    began: Stamp,
) -> Result<ViewRecorder, StartError> {
    let header = ViewHeader {
        format: VIEW_FORMAT.to_owned(),
        version: VIEW_VERSION,
        software: SOFTWARE.to_owned(),
        started: began.wall,
        camera: parts.status.borrow().camera.name.to_string(),
        session,
        run: Some(parts.run),
        monotonic_ns: Some(began.at.as_nanos().cast_signed()),
        ended: None,
    };
    let writer = ViewWriter::create(folder, header)?;
    Ok(ViewRecorder::start(writer, parts.live.follow(), began.at)?)
}
