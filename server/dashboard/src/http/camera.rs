//! The camera settings that an operator may change while the camera runs: exposure, gain, frame rate.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde::Deserialize;
use utoipa::ToSchema;

use super::error::Error;
use super::json::JsonBody;
use super::roles::Operator;
use super::{App, AppState};
use parfocal_devices::camera::{CameraOffer, ControlError, Setting};
use parfocal_records::store::DeviceEvent;

/// What can be changed now, with the camera's own bounds. Empty for a camera without such settings, or one that is
/// disconnected.
#[utoipa::path(get, path = "/api/operator/camera", tag = "operator", responses((status = 200, body = CameraOffer)))]
pub(super) async fn offer(_: Operator, State(app): State<AppState>) -> Json<CameraOffer> {
    Json(app.control.camera.as_ref().map(parfocal_devices::camera::Controls::offered).unwrap_or_default())
}

/// A setting to change.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct Change {
    /// The setting.
    setting: Setting,
    /// The new value: microseconds, the camera's unit of gain, or frames a second.
    value: f64,
}

/// Changes a setting before the next frame.
///
/// `/api/operator/camera` and the live status show the value that the camera then uses.
#[utoipa::path(post, path = "/api/operator/camera", tag = "operator", request_body = Change, responses(
    (status = 204, description = "The camera received the request"),
    (status = 409, description = "The camera does not offer this setting now"),
    (status = 422, description = "The value is outside the camera's bounds"),
    (status = 507, description = "The camera received the request, but the log could not be written")))]
pub(super) async fn change(
    _: Operator,
    State(app): State<AppState>,
    JsonBody(change): JsonBody<Change>,
) -> Result<StatusCode, Error> {
    let Change { setting, value } = change;

    let asked = app.control.camera.as_ref().map_or(Err(ControlError::NotOffered), |camera| camera.ask(setting, value));
    asked.map_err(|error| match error {
        ControlError::NotOffered => Error::Conflict("The camera does not offer this setting now.".into()),
        ControlError::OutOfBounds { .. } => Error::Invalid(format!("{} {error}.", setting.label())),
    })?;

    record(&app, format!("the operator asked for {} {value:.6}", setting.label().to_lowercase())).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Logs the change, so that a change in the picture can be explained later.
async fn record(app: &App, message: String) -> Result<(), Error> {
    let working = app.control.status.borrow().camera.working;
    let wall = app.clock.wall();
    let at = app.clock.now();

    let event = DeviceEvent { wall, at, device: "camera".into(), working, message };
    Ok(app.store.device_event(&event).await?)
}
