//! Voice over HTTP: the surgeon's page sends a recording in pieces while the surgeon speaks; the researcher's page
//! plays it.

use axum::body::Bytes;
use axum::extract::{Path, Query, State};
use axum::http::header::{CONTENT_TYPE, HeaderValue};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use serde::Deserialize;
use utoipa::IntoParams;

use super::AppState;
use super::error::Error;
use super::people::Acting;
use super::ranges;
use super::roles::{Researcher, SurgeonsTablet};
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_results::package::playable::with_duration;
use parfocal_trial::voice::{Ending, NewPiece};

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct PieceQuery {
    /// Session in which the comment was spoken.
    session: SessionId,
    /// Length of the recording up to the end of this piece, milliseconds.
    #[param(minimum = 0, maximum = 3_600_000)]
    through_ms: i64,
    /// Why the recording ended; only with its last piece.
    #[serde(default)]
    #[param(inline)]
    ended: Option<Ending>,
}

/// Stores a piece of a recording: once this has answered, it is on disk. The comment (of kind voice) must come first;
/// its pieces may then come late, repeatedly, and in any order.
#[utoipa::path(post, path = "/api/surgeon/voice/{comment}/{piece}", tag = "surgeon",
    params(
        ("comment" = IdempotencyKey, Path, description = "The comment's key"),
        ("piece" = u32, Path, description = "The piece's place in the recording, from 1", minimum = 1, maximum = 600),
        PieceQuery,
    ),
    request_body(content(
        (Vec<u8> = "audio/webm;codecs=opus"), (Vec<u8> = "audio/mp4"), (Vec<u8> = "audio/ogg;codecs=opus"))),
    responses(
    (status = 204, description = "Kept"),
    (status = 404, description = "The session has no such voice comment"),
    (status = 409, description = "The recording has another piece in this place"),
    (status = 422, description = "The sound is of an unknown kind, or too large"),
    (status = 507, description = "The disk failed; send it again")))]
pub(super) async fn keep_piece(
    _: SurgeonsTablet,
    State(app): State<AppState>,
    Path((comment, piece)): Path<(IdempotencyKey, u32)>,
    Query(PieceQuery { session, through_ms, ended }): Query<PieceQuery>,
    headers: HeaderMap,
    audio: Bytes,
) -> Result<StatusCode, Error> {
    let media_type = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default().to_owned();
    let audio = audio.into();
    app.conductor.voice_piece(NewPiece { comment, session, piece, media_type, through_ms, ended, audio }).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The sound of a voice comment, as far as it has arrived, for a player: with its duration, which browsers do not write
/// into what they record. Exports have it as it arrived. A request for a range of bytes gets that range.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}/voice/{comment}", tag = "researcher",
    params(("session" = SessionId, Path), ("comment" = IdempotencyKey, Path, description = "The comment's key")),
    responses(
    (status = 200, description = "The recording", content(
        (Vec<u8> = "audio/webm;codecs=opus"), (Vec<u8> = "audio/mp4"), (Vec<u8> = "audio/ogg;codecs=opus"))),
    (status = 206, description = "A part of the recording"),
    (status = 404, description = "No such session or recording, or the recording was erased"),
    (status = 409, description = "The participant withdrew"),
    (status = 416, description = "The recording has no such part")))]
pub(super) async fn recording(
    by: Researcher,
    State(app): State<AppState>,
    Path((session, comment)): Path<(SessionId, IdempotencyKey)>,
    headers: HeaderMap,
) -> Result<Response, Error> {
    by.for_session(&app, session).await?;
    let (media_type, audio) = app.reports.voice_audio(session, comment).await?;
    let mut response = ranges::answer(&headers, with_duration(media_type, audio));
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(media_type.name()));
    Ok(response)
}
