//! The recordings of a session, as an export lists them. Nothing in a row reveals a policy: the protocol decides what
//! is recorded, and the frames stay in the data folder.

use std::path::Path;

use tokio::task::spawn_blocking;

use super::description::RecordingRow;
use parfocal_base::ids::SessionId;
use parfocal_recording::{FOLDER, FoundRecording, of_session};

/// A row for each recording of `session` in the data folder `data`. A recording that cannot be read has a row that says
/// so. A broken recording must not prevent the export of comments.
pub async fn rows(data: &Path, session: SessionId) -> Vec<RecordingRow> {
    let folder = data.join(FOLDER);
    let look = move || {
        of_session(&folder, &session.to_string()).map(|found| found.into_iter().map(|one| row(session, one)).collect())
    };

    match spawn_blocking(look).await {
        Ok(Ok(rows)) => rows,
        Ok(Err(error)) => vec![unreadable(session, String::new(), error.to_string())],
        Err(error) => vec![unreadable(session, String::new(), error.to_string())],
    }
}

fn row(session: SessionId, (name, opened): FoundRecording) -> RecordingRow {
    let read = opened.and_then(|recording| Ok((recording.description_sha256()?, recording)));
    let (description_sha256, recording) = match read {
        Ok(read) => read,
        Err(error) => return unreadable(session, name, error.to_string()),
    };

    let times = recording.times();
    RecordingRow {
        session,
        path: format!("{FOLDER}/{name}"),
        name,
        kind: Some(recording.kind().name()),
        run: recording.clock().map(|(run, _)| run),
        started: Some(recording.started()),
        monotonic_ns: recording.clock().map(|(_, monotonic_ns)| monotonic_ns),
        first_ns: times.first().copied(),
        last_ns: times.last().copied(),
        frames: Some(times.len()),
        lost: recording.lost(),
        ended: recording.ended().map(ToString::to_string),
        description_sha256: Some(description_sha256),
        problem: None,
    }
}

fn unreadable(session: SessionId, name: String, problem: String) -> RecordingRow {
    RecordingRow {
        session,
        path: format!("{FOLDER}/{name}"),
        name,
        kind: None,
        run: None,
        started: None,
        monotonic_ns: None,
        first_ns: None,
        last_ns: None,
        frames: None,
        lost: None,
        ended: None,
        description_sha256: None,
        problem: Some(problem),
    }
}
