//! The surgeon's page without a network: a service worker keeps the page and its files in the browser.
//!
//! The worker is given the addresses of all files of one version of the program. It is another worker with each
//! version, so that a browser that comes back to a newer server takes the newer worker and forgets the older files. What
//! the browser keeps is the page as it is for everyone: nothing of a session, and nothing that another role sees.

use axum::http::HeaderName;
use axum::http::header::{CONTENT_TYPE, HeaderValue};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::error::Error;
use super::roles::SurgeonsTablet;
use super::{AppState, assets};

/// Tells the worker that an answer is the surgeon's page, and of which version. Nothing else may be kept.
pub(super) const PAGE_VERSION: HeaderName = HeaderName::from_static("parfocal-page-version");

/// How far a worker may reach beyond its own folder.
const ALLOWED: HeaderName = HeaderName::from_static("service-worker-allowed");

/// The one address that the worker is for.
const PAGE: &str = "/surgeon";

/// What the worker has to know.
#[derive(Serialize)]
struct Offline {
    version: &'static str,
    files: Vec<String>,
}

/// The service worker of the surgeon's page, which opens the page where there is no network.
#[utoipa::path(get, path = "/surgeon/worker.js", tag = "surgeon",
    responses((status = 200, description = "The script", content_type = "text/javascript")))]
async fn worker(_: SurgeonsTablet) -> Result<Response, Error> {
    let files = ["surgeon", "shared"].into_iter().flat_map(assets::urls_in).collect();
    let offline = Offline { version: assets::version(), files };
    let offline = serde_json::to_string(&offline).map_err(|_| Error::Internal)?;

    let script = assets::body("offline/worker.js").ok_or(Error::Internal)?;
    let mut text = format!("self.offline = {offline};\n").into_bytes();
    text.extend_from_slice(script);

    let headers = [
        (CONTENT_TYPE, HeaderValue::from_static("text/javascript; charset=utf-8")),
        (ALLOWED, HeaderValue::from_static(PAGE)),
    ];
    Ok((headers, text).into_response())
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(worker))
}
