//! A backup of the database for a lead's browser: starts it, tells whether it is ready, and sends the file. A backup
//! holds the policies of all sessions, so a lead confirms with the passphrase, and nobody else gets the file.

use std::sync::Arc;

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_LENGTH, CONTENT_TYPE};
use axum::response::IntoResponse;
use futures_util::stream;
use serde::Deserialize;
use tokio::io::AsyncReadExt;
use utoipa::ToSchema;

use super::AppState;
use super::error::Error;
use super::json::JsonBody;
use super::people::{Acting, PeerAddress, confirmed_lead, lead};
use super::roles::Researcher;
use parfocal_records::store::{BackupState, FinishedBackup};

/// Bytes of a backup that are read and sent at a time.
const BLOCK: usize = 256 * 1024;

/// A request for a backup.
#[derive(Deserialize, ToSchema)]
pub(super) struct MakeBackup {
    /// The lead's own passphrase, entered again.
    #[schema(min_length = 1)]
    passphrase: String,
}

/// Begins to make a backup in the background, and records that. If one is being made already, no other begins.
#[utoipa::path(post, path = "/api/researcher/backup", tag = "accounts", request_body = MakeBackup, responses(
    (status = 200, body = BackupState),
    (status = 403, description = "No lead is signed in, or the lead's passphrase is wrong"),
    (status = 422, description = "The passphrase is missing"),
    (status = 429, description = "Too many attempts failed")))]
pub(super) async fn start_backup(
    by: Researcher,
    State(app): State<AppState>,
    PeerAddress(peer): PeerAddress,
    JsonBody(wanted): JsonBody<MakeBackup>,
) -> Result<Json<BackupState>, Error> {
    let lead = confirmed_lead(&app, &by, Some(&wanted.passphrase), peer).await?;
    Ok(Json(app.backups.start(app.access_log(by.actor()), lead.account.clone())))
}

/// The state of the latest backup that the lead who is signed in asked for. It is kept for 15 minutes, unless words are
/// erased.
#[utoipa::path(get, path = "/api/researcher/backup", tag = "accounts", responses(
    (status = 200, body = BackupState),
    (status = 403, description = "No lead is signed in")))]
pub(super) async fn backup_state(by: Researcher, State(app): State<AppState>) -> Result<Json<BackupState>, Error> {
    let lead = lead(&by)?;
    let state = app.backups.state(app.store.reader(), &lead.account).await;
    Ok(Json(state?))
}

/// The backup as a file for `parfocal restore`.
#[utoipa::path(get, path = "/api/researcher/backup.db", tag = "accounts", responses(
    (status = 200, description = "The file", content_type = "application/vnd.sqlite3"),
    (status = 403, description = "No lead is signed in"),
    (status = 404, description = "The lead has no backup that is ready")))]
pub(super) async fn backup_file(by: Researcher, State(app): State<AppState>) -> Result<impl IntoResponse, Error> {
    let lead = lead(&by)?;
    let made = app.backups.made(app.store.reader(), &lead.account).await?;
    let made = made.ok_or_else(|| Error::NotFound("No backup is ready. Make one on the page People.".to_owned()))?;

    let name = format!("parfocal-{}.db", app.clock.wall().strftime("%Y%m%dT%H%M%SZ"));
    let headers = [
        (CONTENT_TYPE, "application/vnd.sqlite3".to_owned()),
        (CONTENT_LENGTH, made.bytes.to_string()),
        (CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    Ok((headers, content(made).await?))
}

/// The file's content, no faster than the download takes it. The file stays until all of it is sent.
async fn content(made: FinishedBackup) -> Result<Body, Error> {
    let file = tokio::fs::File::open(&*made.file).await;
    let file = file.map_err(|error| Error::Storage(format!("the backup cannot be read: {error}; make another")))?;
    let kept = Arc::clone(&made.file);

    let blocks = stream::try_unfold((file, kept), |(mut file, kept)| async move {
        let mut block = vec![0; BLOCK];
        let read = file.read(&mut block).await?;
        block.truncate(read);
        Ok::<_, std::io::Error>((read > 0).then(|| (Bytes::from(block), (file, kept))))
    });
    Ok(Body::from_stream(blocks))
}
