//! Finds a session's recordings, and provides their pictures.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use serde::Serialize;
use tokio::task::spawn_blocking;
use utoipa::ToSchema;

use super::projector::Projector;
use super::spectrum::PlaceSpectrum;
use crate::conductor::ConductError;
use crate::reports::{Played, Reports};
use parfocal_base::ids::SessionId;
use parfocal_imaging::{Circle, Size};
use parfocal_recording::{AnyRecording, FOLDER, FoundRecording, RecordingError, RecordingKind, belonging, of_session};
use parfocal_trial::protocol::Record;
use parfocal_trial::role::Role;

/// The recordings of a session that can be played.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SessionRecordings {
    /// Recordings that can be played, in the order in which they were made.
    pub recordings: Vec<RecordingCourse>,
    /// Problems with other recordings, and parts missing from these, in sentences.
    pub problems: Vec<String>,
}

/// A recording, with the times at which its frames were exposed.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct RecordingCourse {
    /// Name of the recording.
    pub name: String,
    /// Whether it consists of mosaics or of the view's pictures.
    pub kind: RecordingKind,
    /// Time of the first frame, in seconds of the session's timeline; negative before the session's start.
    pub from: f64,
    /// Time of each frame, in whole milliseconds since the first. A frame's index in this list, from 0, identifies it.
    pub times_ms: Vec<i64>,
}

/// Plays the recordings of unblinded sessions. Cheap to clone.
#[derive(Clone)]
pub struct Player(Arc<Shared>);

struct Shared {
    reports: Reports,
    /// Folder that holds the recordings.
    folder: PathBuf,
    projector: Projector,
    /// Unblinded sessions, which the researcher may play. Unblinding is never undone, so it is checked only once.
    playable: Mutex<BTreeSet<SessionId>>,
}

impl Player {
    /// Makes a player of the recordings in `folder`.
    ///
    /// # Errors
    /// If the system cannot start another thread.
    pub fn new(reports: Reports, folder: PathBuf) -> std::io::Result<Self> {
        let projector = Projector::start()?;
        Ok(Self(Arc::new(Shared { reports, folder, projector, playable: Mutex::default() })))
    }

    /// The recordings of `session`, with the times of their frames.
    ///
    /// # Errors
    /// If `by` may not play them (yet), there is no such session, or the database failed.
    pub async fn recordings(&self, by: Role, session: SessionId) -> Result<SessionRecordings, ConductError> {
        let played = self.0.reports.to_play(by, session).await?;
        let folder = self.0.folder.clone();
        let found = spawn_blocking(move || {
            of_session(&folder, &session.to_string()).map(|found| session_recordings(found, &played))
        });

        let found = found.await.map_err(|_| ConductError::ending())?;
        Ok(found.unwrap_or_else(|error| SessionRecordings {
            recordings: Vec::new(),
            problems: vec![format!("The recordings could not be listed: {error}.")],
        }))
    }

    /// Frame `number` of recording `name` of `session` as a JPEG. A recording of the view gives the picture as it was
    /// recorded. A recording of mosaics is developed at `size`.
    ///
    /// # Errors
    /// If `by` may not play it (yet), there is no such recording or frame, or it is damaged.
    pub async fn picture(
        &self,
        by: Role,
        session: SessionId,
        name: &str,
        number: usize,
        size: Size,
    ) -> Result<Bytes, ConductError> {
        let folder = self.folder(by, session, name).await?;
        self.0.projector.ask(folder, move |open| open.picture(number, size)).await
    }

    /// The spectrum within `circle` of frame `number` of recording `name` of `session`.
    ///
    /// # Errors
    /// If `by` may not play it (yet), there is no such recording, frame or place, it has no bands, or it is damaged.
    pub async fn spectrum(
        &self,
        by: Role,
        session: SessionId,
        name: &str,
        number: usize,
        circle: Circle,
    ) -> Result<PlaceSpectrum, ConductError> {
        let folder = self.folder(by, session, name).await?;
        self.0.projector.ask(folder, move |open| open.spectrum(number, circle)).await
    }

    /// The folder of recording `name` of `session`, if `by` may play it.
    async fn folder(&self, by: Role, session: SessionId, name: &str) -> Result<PathBuf, ConductError> {
        self.check(by, session).await?;

        let recordings = self.0.folder.clone();
        let named = name.to_owned();
        let folder = spawn_blocking(move || belonging(&recordings, &named, &session.to_string())).await;
        folder.map_err(|_| ConductError::ending())?.ok_or_else(|| {
            ConductError::NotFound(format!("the session has no recording {name} in the folder {FOLDER} any more"))
        })
    }

    async fn check(&self, by: Role, session: SessionId) -> Result<(), ConductError> {
        let known = by == Role::Researcher && self.playable().contains(&session);
        if known {
            // The participant may have withdrawn since, even while the recording is playing.
            self.0.reports.check_reading(session).await?;
        } else {
            self.0.reports.to_play(by, session).await?;
            self.playable().insert(session);
        }
        Ok(())
    }

    fn playable(&self) -> std::sync::MutexGuard<'_, BTreeSet<SessionId>> {
        self.0.playable.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Describes the recordings that were found, and their problems.
fn session_recordings(found: Vec<FoundRecording>, played: &Played) -> SessionRecordings {
    let mut listed = SessionRecordings { recordings: Vec::new(), problems: Vec::new() };
    if found.is_empty() && played.asked != Record::None {
        listed.problems.push(format!(
            "The protocol asked for a recording, but there is none of this session in the folder {FOLDER} of the data \
             folder. It was moved or removed, or never begun."
        ));
    }

    for (name, opened) in found {
        match opened {
            Ok(recording) => add_recording(&name, &recording, played, &mut listed),
            Err(error) => listed.problems.push(format!("The recording {name} cannot be played. {}", sentence(&error))),
        }
    }
    listed.recordings.sort_by(|a, b| a.from.total_cmp(&b.from));
    listed
}

fn add_recording(name: &str, recording: &AnyRecording, played: &Played, listed: &mut SessionRecordings) {
    if recording.ended().is_none() && played.ended {
        listed.problems.push(format!("The recording {name} was cut short. What was stored before can be played."));
    }

    let times = recording.times();
    let Some(&first) = times.first() else {
        // Frames are stored many at once.
        let advice = if played.ended { "" } else { " yet. If it is under way, load this page again in a moment" };
        listed.problems.push(format!("The recording {name} holds no frame{advice}."));
        return;
    };

    // Uses the monotonic clock if the recording has it. Then setting the wall clock has not shifted the pictures.
    let from = match recording.clock() {
        Some((run, monotonic_ns)) => played.seconds_at(run, monotonic_ns.saturating_add(first)),
        None => played.seconds_of(recording.started()) + nanoseconds(first),
    };
    listed.recordings.push(RecordingCourse {
        name: name.to_owned(),
        kind: recording.kind(),
        from,
        times_ms: times.iter().map(|time| time.saturating_sub(first) / 1_000_000).collect(),
    });
}

/// Converts nanoseconds to seconds.
fn nanoseconds(count: i64) -> f64 {
    count as f64 / 1e9
}

/// An error as a sentence, with a capital letter and a full stop.
fn sentence(error: &RecordingError) -> String {
    let text = error.to_string();
    let mut letters = text.chars();
    let first = letters.next().map(|letter| letter.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", letters.as_str())
}
