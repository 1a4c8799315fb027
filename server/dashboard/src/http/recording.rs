//! Starts and stops the operator's recordings, and reports their state.

use axum::Json;
use axum::extract::State;
use serde::Deserialize;
use utoipa::ToSchema;

use super::AppState;
use super::error::Error;
use super::json::JsonBody;
use super::roles::Operator;
use parfocal_session::recorder::{RecordingStatus, StartError};

/// The state of recording, and how long the disk will last.
#[utoipa::path(get, path = "/api/operator/recording", tag = "operator", responses(
    (status = 200, body = RecordingStatus),
))]
pub(super) async fn status(_: Operator, State(app): State<AppState>) -> Json<RecordingStatus> {
    Json(app.recordings.status().await)
}

/// Whether to start or to stop recording.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct RecordingOrder {
    /// True to start recording mosaics, false to stop.
    record: bool,
}

/// Starts or stops recording. Stopping again changes nothing. Answers with the new state of recording.
#[utoipa::path(post, path = "/api/operator/recording", tag = "operator", request_body = RecordingOrder, responses(
    (status = 200, body = RecordingStatus),
    (status = 409, description = "A recording is under way, or the camera has no mosaics"),
    (status = 507, description = "The disk has no room, or cannot be written")))]
pub(super) async fn order(
    _: Operator,
    State(app): State<AppState>,
    JsonBody(order): JsonBody<RecordingOrder>,
) -> Result<Json<RecordingStatus>, Error> {
    if order.record {
        app.recordings.start().await?;
    } else {
        app.recordings.stop().await;
    }
    Ok(Json(app.recordings.status().await))
}

impl From<StartError> for Error {
    fn from(error: StartError) -> Self {
        match error {
            StartError::NoMosaics | StartError::UnderWay => Self::Conflict(error.to_string()),
            StartError::NoRoom(_) | StartError::Failed(_) => Self::Storage(error.to_string()),
        }
    }
}
