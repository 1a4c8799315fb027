//! `/healthz`: whether the server runs, for monitoring. Says nothing that a surgeon must not know.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::AppState;

/// How the server is.
#[derive(Debug, Serialize, ToSchema)]
struct Health {
    /// Always `ok`: a server that cannot answer does not.
    status: &'static str,
    /// The program's version.
    version: &'static str,
    /// Whether the camera delivers frames.
    camera: bool,
    /// Whether the lens takes commands.
    lens: bool,
    /// Whether the picture or the lens is not of the real world.
    simulated: bool,
}

/// Whether the server, its camera and its lens work.
#[utoipa::path(get, path = "/healthz", tag = "service", responses((status = 200, body = Health)))]
async fn healthz(State(app): State<AppState>) -> Json<Health> {
    let status = Arc::clone(&app.control.status.borrow());
    Json(Health {
        status: "ok",
        version: env!("CARGO_PKG_VERSION"),
        camera: status.camera.working,
        lens: status.lens.working,
        simulated: status.camera.simulated || status.lens.simulated,
    })
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(healthz))
}
