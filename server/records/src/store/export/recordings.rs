//! The recordings of a session, as an export lists them. Nothing in a row reveals a policy: the protocol decides what
//! is recorded, and the frames stay in the data folder.

use std::path::Path;

use tokio::task::spawn_blocking;

use super::description::RecordingRow;
use parfocal_base::ids::SessionId;
use parfocal_recording::{AnyRecording, FOLDER, FoundRecording, of_session};

/// A row for each recording of `session` in the data folder `data`. A recording that cannot be read has a row that says
/// so. A broken recording must not prevent the export of comments.
pub async fn rows(data: &Path, session: SessionId) -> Vec<RecordingRow> {
    let folder = data.join(FOLDER);
    let look = move || of_session(&folder, &session.to_string()).map(|found| found.into_iter().map(contents).collect());
    let looked = spawn_blocking(look).await;

    let found: Vec<RecordingContents> = match looked {
        Ok(Ok(found)) => found,
        Ok(Err(error)) => vec![RecordingContents { name: String::new(), read: Err(error.to_string()) }],
        Err(error) => vec![RecordingContents { name: String::new(), read: Err(error.to_string()) }],
    };
    found.into_iter().map(|contents| row(session, contents)).collect()
}

/// What was read from a recording's folder.
struct RecordingContents {
    name: String,
    read: Result<Read, String>,
}

struct Read {
    recording: AnyRecording,
    sha256: String,
}

fn contents((name, opened): FoundRecording) -> RecordingContents {
    let read = opened.and_then(|recording| {
        let sha256 = recording.description_sha256()?;
        Ok(Read { recording, sha256 })
    });
    RecordingContents { name, read: read.map_err(|error| error.to_string()) }
}

fn row(session: SessionId, RecordingContents { name, read }: RecordingContents) -> RecordingRow {
    let path = format!("{FOLDER}/{name}");
    let mut row = RecordingRow {
        session,
        name,
        path,
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
        problem: None,
    };

    match read {
        Ok(Read { recording, sha256 }) => {
            let times = recording.times();
            row.kind = Some(recording.kind().name());
            row.run = recording.clock().map(|(run, _)| run);
            row.started = Some(recording.started());
            row.monotonic_ns = recording.clock().map(|(_, monotonic_ns)| monotonic_ns);
            row.first_ns = times.first().copied();
            row.last_ns = times.last().copied();
            row.frames = Some(times.len());
            row.lost = recording.lost();
            row.ended = recording.ended().map(ToString::to_string);
            row.description_sha256 = Some(sha256);
        }
        Err(problem) => row.problem = Some(problem),
    }
    row
}
