//! The surgeon's page without a network: a service worker keeps the page and its files in the browser.
//!
//! The worker's script contains the addresses of all files of one version of the program, so each version is another
//! worker. A browser that comes back to a newer server takes the newer worker and drops the older files. It keeps the
//! page as it is for everyone: nothing of a session, and nothing that another role sees.

use axum::http::HeaderName;
use axum::http::header::{CONTENT_TYPE, HeaderValue};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::assets;
use super::error::Error;
use super::roles::SurgeonsTablet;

/// Header that tells the worker that an answer is the surgeon's page, and its version. Nothing else may be kept.
pub(super) const PAGE_VERSION: HeaderName = HeaderName::from_static("parfocal-page-version");

/// Header that allows a worker a scope beyond its own folder.
const ALLOWED: HeaderName = HeaderName::from_static("service-worker-allowed");

/// The scope of the worker: the surgeon's page only.
const PAGE: &str = "/surgeon";

/// What the worker must know: its version and the addresses of its files.
#[derive(Serialize)]
struct Offline {
    version: &'static str,
    files: Vec<String>,
}

/// The service worker of the surgeon's page, which opens the page if there is no network.
#[utoipa::path(get, path = "/surgeon/worker.js", tag = "surgeon",
    responses((status = 200, description = "The script", content_type = "text/javascript")))]
pub(super) async fn worker(_: SurgeonsTablet) -> Result<Response, Error> {
    let files = assets::surgeon_urls().collect();
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
