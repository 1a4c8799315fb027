//! A session's recordings for the researcher's page: the times of their frames, and the frames as pictures.

use axum::Json;
use axum::extract::{Path, Query, State};
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};

use super::AppState;
use super::error::Error;
use super::people::Acting;
use super::roles::Researcher;
use parfocal_base::ids::SessionId;
use parfocal_imaging::{Circle, Size};
use parfocal_records::store::Access;
use parfocal_session::playback::{PlaceSpectrum, SessionRecordings};
use parfocal_trial::role::Role;

/// The recordings of an unblinded session, with the times of their frames. Each access is recorded.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}/recordings", tag = "researcher",
    params(("session" = SessionId, Path)), responses(
    (status = 200, body = SessionRecordings),
    (status = 404, description = "No such session"),
    (status = 409, description = "The session is not unblinded, or its participant withdrew")))]
pub(super) async fn recordings(
    by: Researcher,
    State(app): State<AppState>,
    Path(session): Path<SessionId>,
) -> Result<Json<SessionRecordings>, Error> {
    let by = by.for_session(&app, session).await?;
    app.recordings.settle().await;
    let found = app.player.recordings(Role::Researcher, session).await?;
    if !found.recordings.is_empty() {
        let access_log = app.access_log(by);
        access_log.record(&Access::RecordingViewed(session)).await?;
    }
    Ok(Json(found))
}

/// A frame of a session's recording.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct FramePath {
    session: SessionId,
    /// The recording's name
    recording: String,
    /// The frame's place in the recording, from 0
    frame: usize,
}

/// The resolution at which a mosaic is developed.
#[derive(Debug, Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum PictureSize {
    /// One pixel per mosaic cell.
    #[default]
    Cell,
    /// Two by two pixels per mosaic cell.
    Half,
}

impl From<PictureSize> for Size {
    fn from(size: PictureSize) -> Self {
        match size {
            PictureSize::Cell => Self::Cell,
            PictureSize::Half => Self::Half,
        }
    }
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct PictureQuery {
    /// The resolution at which mosaics are developed. Pictures of a recording of the view are sent as they were
    /// recorded.
    #[serde(default)]
    #[param(inline)]
    size: PictureSize,
}

/// A frame of a recording of an unblinded session. Frames count from 0.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}",
    tag = "researcher",
    params(FramePath, PictureQuery),
    responses(
    (status = 200, description = "The picture", content_type = "image/jpeg"),
    (status = 404, description = "No such session, recording or frame"),
    (status = 409, description = "The session is not unblinded, or its participant withdrew"),
    (status = 500, description = "The frame is damaged")))]
pub(super) async fn frame(
    by: Researcher,
    State(app): State<AppState>,
    Path(FramePath { session, recording, frame }): Path<FramePath>,
    Query(query): Query<PictureQuery>,
) -> Result<impl IntoResponse, Error> {
    by.for_session(&app, session).await?;
    let size = query.size.into();
    let jpeg = app.player.picture(Role::Researcher, session, &recording, frame, size).await?;
    Ok(([(CONTENT_TYPE, "image/jpeg")], jpeg))
}

/// A circle in a mosaic.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct PlaceQuery {
    /// Centre: samples of the mosaic from its left edge.
    x: f64,
    /// Centre: samples of the mosaic from its upper edge.
    y: f64,
    /// All cells whose middle is this near to the centre are taken, in samples. With 0, the cell there.
    #[serde(default)]
    radius: f64,
}

/// The spectrum at a place of a recorded mosaic of an unblinded session. Frames count from 0.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}/spectrum",
    tag = "researcher",
    params(FramePath, PlaceQuery),
    responses(
    (status = 200, body = PlaceSpectrum),
    (status = 404, description = "No such session, recording or frame, or it has no bands"),
    (status = 409, description = "The session is not unblinded, or its participant withdrew"),
    (status = 422, description = "No such place in the picture"),
    (status = 500, description = "The frame is damaged")))]
pub(super) async fn spectrum(
    by: Researcher,
    State(app): State<AppState>,
    Path(FramePath { session, recording, frame }): Path<FramePath>,
    Query(PlaceQuery { x, y, radius }): Query<PlaceQuery>,
) -> Result<Json<PlaceSpectrum>, Error> {
    by.for_session(&app, session).await?;
    let circle = Circle { x, y, radius };
    Ok(Json(app.player.spectrum(Role::Researcher, session, &recording, frame, circle).await?))
}
