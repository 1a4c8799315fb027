//! `/healthz`: how the server is, for monitoring. Says nothing that a surgeon must not know.
//!
//! A monitor restarts a service that answers 503. So only a server that cannot do its work answers so: in a session a
//! loose cable must not cost a restart.

use std::sync::Arc;

use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::AppState;
use super::error::OwnBody;
use crate::health::{Condition, Problem};

/// How the server is.
#[derive(Debug, Serialize, ToSchema)]
struct Health {
    /// Whether all is well.
    status: Condition,
    /// The program's version.
    version: &'static str,
    /// Whether the camera delivers frames.
    camera: bool,
    /// Whether the lens takes commands.
    lens: bool,
    /// Whether the picture or the lens is not of the real world.
    simulated: bool,
    /// What is wrong, the worst first.
    problems: Vec<Problem>,
}

/// How the server is, and what is wrong.
///
/// Answers at once, also while the disk hangs.
#[utoipa::path(get, path = "/healthz", tag = "service", responses(
    (status = 200, description = "It does its work: `ok`, or `degraded` where something needs a person", body = Health),
    (status = 503, description = "It cannot do its work: `failing`", body = Health)))]
async fn healthz(State(app): State<AppState>) -> (StatusCode, Extension<OwnBody>, Json<Health>) {
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

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(healthz))
}
