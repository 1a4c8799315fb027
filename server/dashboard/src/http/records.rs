//! A researcher's changes to a session's records: corrections, erasures, and a withdrawal.

use axum::extract::{Path, State};
use axum::http::StatusCode;
use serde::Deserialize;
use utoipa::ToSchema;

use super::AppState;
use super::error::Error;
use super::json::JsonBody;
use super::people::Acting;
use super::roles::Researcher;
use parfocal_base::ids::SessionId;
use parfocal_trial::action::Action;
use parfocal_trial::correction::NewCorrection;
use parfocal_trial::erasure::NewErasure;

/// Corrects a record of a session that has ended. The original stays; the correction is kept beside it.
#[utoipa::path(post, path = "/api/researcher/sessions/{session}/corrections", tag = "researcher",
    params(("session" = SessionId, Path)),
    request_body = NewCorrection, responses(
    (status = 204, description = "Recorded"),
    (status = 404, description = "No such session or record"),
    (status = 409, description = "The session is under way, its participant withdrew, its study is locked, what a \
                                  surgeon wrote cannot be corrected, or somebody has corrected the same meanwhile"),
    (status = 422, description = "The correction does not fit the record, or no reason was given")))]
pub(super) async fn correct(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
    JsonBody(correction): JsonBody<NewCorrection>,
) -> Result<StatusCode, Error> {
    let by = by.for_session(&app, id).await?;
    app.conductor.correct(by, id, correction).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Erases words permanently. Once this has answered, they are nowhere in the database. Their record and its hash stay.
#[utoipa::path(post, path = "/api/researcher/sessions/{session}/erasures", tag = "researcher",
    params(("session" = SessionId, Path)),
    request_body = NewErasure, responses(
    (status = 204, description = "Erased"),
    (status = 404, description = "No such session or record"),
    (status = 409, description = "A session is under way, or the record has no words"),
    (status = 422, description = "No reason was given")))]
pub(super) async fn erase(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
    JsonBody(erasure): JsonBody<NewErasure>,
) -> Result<StatusCode, Error> {
    let by = by.for_session(&app, id).await?;
    app.conductor.erase(by, id, erasure).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// An erasure of all words of a session.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct EraseAll {
    /// Why; stored with each erasure. It must not repeat the words.
    #[schema(pattern = r"\S")]
    reason: String,
}

/// Erases all words of a withdrawn session permanently: comments with their sound, answers in words, and notes. Once
/// this has answered, they are nowhere in the database. Their records and hashes stay.
#[utoipa::path(post, path = "/api/researcher/sessions/{session}/erasures/all", tag = "researcher",
    params(("session" = SessionId, Path)),
    request_body = EraseAll, responses(
    (status = 204, description = "Erased"),
    (status = 404, description = "No such session"),
    (status = 409, description = "The participant has not withdrawn, a session is under way, or no words are left"),
    (status = 422, description = "No reason was given")))]
pub(super) async fn erase_all(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
    JsonBody(EraseAll { reason }): JsonBody<EraseAll>,
) -> Result<StatusCode, Error> {
    let by = by.for_session(&app, id).await?;
    app.conductor.erase_all_words(by, id, reason).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// A participant's withdrawal.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct Withdraw {
    /// Why the participant withdrew; stored in the audit trail.
    #[schema(pattern = r"\S")]
    reason: String,
}

/// Records that the participant withdrew: from now on the session's data are not shown, analysed or exported.
#[utoipa::path(post, path = "/api/researcher/sessions/{session}/withdraw", tag = "researcher",
    params(("session" = SessionId, Path)),
    request_body = Withdraw, responses(
    (status = 204, description = "Withdrawn"),
    (status = 404, description = "No such session"),
    (status = 409, description = "The session is under way"),
    (status = 422, description = "No reason was given")))]
pub(super) async fn withdraw(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
    JsonBody(Withdraw { reason }): JsonBody<Withdraw>,
) -> Result<StatusCode, Error> {
    let by = by.for_session(&app, id).await?;
    app.conductor.act(by, id, Action::Withdraw { reason }).await?;
    Ok(StatusCode::NO_CONTENT)
}
