//! `/api/openapi.json`: every endpoint, described from the code that serves it.

use std::sync::{Arc, OnceLock};

use axum::Extension;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use utoipa::OpenApi;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::AppState;
use super::error::Error;
use super::roles::Roles;

/// What the document says of the server as a whole.
#[derive(OpenApi)]
#[openapi(info(
    title = "parfocal",
    description = "Live view, autofocus control and blinded usability trials of a hyperspectral video exoscope. A role \
                   is shown by the cookie that /enter gives, or by its key as a bearer token."
))]
pub struct Document;

/// The finished document, filled in once every route is known.
pub type Finished = Arc<OnceLock<String>>;

/// This document.
#[utoipa::path(get, path = "/api/openapi.json", tag = "service", responses((status = 200, description = "OpenAPI 3.1")))]
async fn openapi(_: Roles, Extension(document): Extension<Finished>) -> Result<impl IntoResponse, Error> {
    let text = document.get().cloned().ok_or(Error::Internal)?;
    Ok(([(CONTENT_TYPE, "application/json")], text))
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(openapi))
}
