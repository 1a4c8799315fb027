//! The surgeon's page.

use askama::Template;
use axum::response::Html;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::error::Error;
use super::roles::Surgeon;
use super::security::Nonce;
use super::{AppState, assets};

#[derive(Template)]
#[template(path = "surgeon.html")]
struct Page {
    nonce: String,
    stylesheet: String,
    viewer: String,
}

/// The surgeon's page.
#[utoipa::path(get, path = "/surgeon", tag = "surgeon", responses((status = 200, description = "The page", content_type = "text/html")))]
async fn page(_: Surgeon, Nonce(nonce): Nonce) -> Result<Html<String>, Error> {
    let page = Page { nonce, stylesheet: assets::url("style.css"), viewer: assets::url("viewer.js") };
    page.render().map(Html).map_err(|_| Error::Internal)
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(page))
}
