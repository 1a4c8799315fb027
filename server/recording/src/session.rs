//! The recordings of a trial session, of either kind, among those in a folder.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::error::RecordingError;
use super::header::Ended;
use super::layout::DESCRIPTION;
use super::reading::Recording;
use super::view::HEADER;
use super::view_reading::ViewRecording;
use parfocal_base::files::is_systems_own;

/// What a recording is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, utoipa::ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RecordingKind {
    /// Mosaics.
    Mosaic,
    /// Pictures of the view.
    View,
}

impl RecordingKind {
    /// Its name, as in protocols.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mosaic => "mosaic",
            Self::View => "view",
        }
    }

    /// The file that describes a recording of this kind.
    const fn description(self) -> &'static str {
        match self {
            Self::Mosaic => DESCRIPTION,
            Self::View => HEADER,
        }
    }
}

/// A recording of either kind.
pub enum AnyRecording {
    /// Mosaics.
    Mosaic(Box<Recording>),
    /// Pictures of the view.
    View(Box<ViewRecording>),
}

impl AnyRecording {
    /// Opens the recording in `folder`, whichever kind it is.
    ///
    /// # Errors
    /// If there is none, it has another version, or its description is invalid or damaged.
    pub fn open(folder: &Path) -> Result<Self, RecordingError> {
        match Recording::open(folder) {
            Err(RecordingError::View(_)) => ViewRecording::open(folder).map(Box::new).map(Self::View),
            opened => opened.map(Box::new).map(Self::Mosaic),
        }
    }

    /// Its kind.
    pub const fn kind(&self) -> RecordingKind {
        match self {
            Self::Mosaic(_) => RecordingKind::Mosaic,
            Self::View(_) => RecordingKind::View,
        }
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        match self {
            Self::Mosaic(recording) => recording.folder(),
            Self::View(recording) => recording.folder(),
        }
    }

    /// Wall-clock time from which the frames' times count.
    pub const fn started(&self) -> Timestamp {
        match self {
            Self::Mosaic(recording) => recording.header().started,
            Self::View(recording) => recording.header().started,
        }
    }

    /// The number of the server's start that recorded it, and the monotonic clock at [`AnyRecording::started`],
    /// nanoseconds. `None` for recordings that were made without a server.
    pub fn clock(&self) -> Option<(i64, i64)> {
        match self {
            Self::Mosaic(recording) => recording.header().run.zip(recording.header().monotonic_ns),
            Self::View(recording) => recording.header().run.zip(recording.header().monotonic_ns),
        }
    }

    /// Ends of the exposures of its frames, nanoseconds since it started.
    pub fn times(&self) -> Vec<i64> {
        match self {
            Self::Mosaic(recording) => recording.rows().iter().map(|row| row.time).collect(),
            Self::View(recording) => recording.rows().iter().map(|row| row.time.cast_signed()).collect(),
        }
    }

    /// Frames that the recorder was too slow for; `None` if they are not counted.
    pub const fn lost(&self) -> Option<u64> {
        match self {
            Self::Mosaic(recording) => Some(recording.header().frames_lost),
            Self::View(_) => None,
        }
    }

    /// How it ended; `None` while it is under way, or if it was cut short.
    pub const fn ended(&self) -> Option<&Ended> {
        match self {
            Self::Mosaic(recording) => recording.header().ended.as_ref(),
            Self::View(recording) => recording.header().ended.as_ref(),
        }
    }

    /// SHA-256, hexadecimal, of the file that describes it: `zarr.json` or `view.json`.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn description_sha256(&self) -> Result<String, RecordingError> {
        let path = self.folder().join(self.kind().description());
        let content = fs::read(&path).map_err(RecordingError::unreadable(&path))?;
        Ok(hex::encode(Sha256::digest(&content)))
    }
}

/// A recording found for a session: its name, and the recording if it could be opened.
pub type FoundRecording = (String, Result<AnyRecording, RecordingError>);

/// The recordings of `session` in the folder `recordings`, by name. A recording belongs to a session if its description
/// says so, or if it is named after the session. Empty if the folder does not exist.
///
/// # Errors
/// If the folder cannot be read.
pub fn of_session(recordings: &Path, session: &str) -> Result<Vec<FoundRecording>, RecordingError> {
    let entries = match fs::read_dir(recordings) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(RecordingError::unreadable(recordings)(error)),
    };

    let mut names: Vec<String> = Vec::new();
    for entry in entries {
        let entry = entry.map_err(RecordingError::unreadable(recordings))?;
        if !is_systems_own(&entry.file_name()) {
            names.extend(entry.file_name().into_string());
        }
    }
    // In the order in which they were made: SESSION, SESSION-2, …, SESSION-10.
    names.sort_by(|a, b| a.len().cmp(&b.len()).then_with(|| a.cmp(b)));

    let open = |name: String| {
        let folder = belonging(recordings, &name, session)?;
        Some((name, AnyRecording::open(&folder)))
    };
    Ok(names.into_iter().filter_map(open).collect())
}

/// The folder of recording `name` in `recordings`, if it belongs to `session`. `name` may be any text: the result is
/// `None` if it is not the name of a folder directly in `recordings`.
pub fn belonging(recordings: &Path, name: &str, session: &str) -> Option<PathBuf> {
    let mut parts = Path::new(name).components();
    let plain = matches!(parts.next(), Some(std::path::Component::Normal(part)) if part == name);
    let folder = recordings.join(name);
    if !plain || parts.next().is_some() || !folder.is_dir() {
        return None;
    }

    let belongs = is_named_after(name, session) || said_session(&folder).as_deref() == Some(session);
    belongs.then_some(folder)
}

/// Whether `name` is `session`, or `session` followed by a dash and a number.
fn is_named_after(name: &str, session: &str) -> bool {
    let number = |rest: &str| rest.strip_prefix('-').is_some_and(|number| number.parse::<u32>().is_ok());
    name.strip_prefix(session).is_some_and(|rest| rest.is_empty() || number(rest))
}

/// The session that the recording in `folder` says it was made in.
fn said_session(folder: &Path) -> Option<String> {
    let read = |kind: RecordingKind| fs::read(folder.join(kind.description())).ok();
    let described = |text: Vec<u8>| serde_json::from_slice::<Value>(&text).ok();

    let mosaic = read(RecordingKind::Mosaic).and_then(described).map(|group| group["attributes"]["session"].clone());
    let view = || read(RecordingKind::View).and_then(described).map(|header| header["session"].clone());
    mosaic.or_else(view)?.as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_named_after_its_session_with_or_without_a_number() {
        let session = "6a2f41d3-0000-4000-8000-000000000001";
        for ours in ["", "-2", "-10"] {
            assert!(is_named_after(&format!("{session}{ours}"), session), "{ours}");
        }
        for other in ["-", "-x", "2", "-2/.."] {
            assert!(!is_named_after(&format!("{session}{other}"), session), "{other}");
        }
    }

    #[test]
    fn a_name_leads_to_no_folder_outside() {
        let folder = tempfile::tempdir().unwrap();
        let recordings = folder.path().join("recordings");
        fs::create_dir_all(recordings.join("session")).unwrap();
        assert_eq!(belonging(&recordings, "session", "session"), Some(recordings.join("session")));
        for outside in ["", ".", "..", "../recordings/session", "session/", "/etc", "session/../session"] {
            assert_eq!(belonging(&recordings, outside, "session"), None, "{outside}");
        }
    }
}
