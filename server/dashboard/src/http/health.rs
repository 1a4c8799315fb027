//! `/healthz`: the server's health, for monitoring. Says nothing that a surgeon must not know.
//!
//! A monitor restarts a service that answers 503. So the server answers 503 only if it cannot do its work: a loose
//! cable during a session must not cause a restart.

use std::sync::Arc;

use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};
use serde::Serialize;
use utoipa::ToSchema;

use super::AppState;
use super::error::OwnBody;
use crate::health::{Condition, Problem};

/// The server's health.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Health {
    /// The server's condition.
    status: Condition,
    /// The program's version.
    version: &'static str,
    /// Whether the camera delivers frames.
    camera: bool,
    /// Whether the lens takes commands.
    lens: bool,
    /// Whether the camera or the lens is simulated.
    simulated: bool,
    /// Problems, the most severe first.
    problems: Vec<Problem>,
}

/// The server's health, and what is wrong.
///
/// Answers at once, even while the disk hangs.
#[utoipa::path(get, path = "/healthz", tag = "service", responses(
    (status = 200, description = "The server works: `ok`, or `degraded` if a person has to act", body = Health),
    (status = 503, description = "The server cannot do its work: `failing`", body = Health)))]
pub(super) async fn healthz(State(app): State<AppState>) -> (StatusCode, Extension<OwnBody>, Json<Health>) {
    let status = Arc::clone(&app.control.status.borrow());
    let (condition, problems) = app.health.now();
    let code = if condition == Condition::Failing { StatusCode::SERVICE_UNAVAILABLE } else { StatusCode::OK };

    let health = Health {
        status: condition,
        version: env!("CARGO_PKG_VERSION"),
        camera: status.camera.working,
        lens: status.lens.working,
        simulated: status.camera.simulated || status.lens.simulated,
        problems,
    };
    (code, Extension(OwnBody), Json(health))
}
