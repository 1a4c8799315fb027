//! Exports for the researcher's browser, and the data dictionary that describes them.

use std::fmt::Display;

use askama::Template;
use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{Html, IntoResponse, Response};
use serde::Deserialize;
use tokio::runtime::Handle;
use tokio::task::spawn_blocking;
use utoipa::IntoParams;

use super::AppState;
use super::error::Error;
use super::people::{Acting, SignedIn};
use super::roles::Researcher;
use parfocal_base::ids::SessionId;
use parfocal_records::store::export::{Export, ExportError, TABLES, TEXTS_IN_CSV, Table, ZipStream, folder_name};
use parfocal_trial::account::Account;

impl From<ExportError> for Error {
    fn from(error: ExportError) -> Self {
        let text = error.to_string();
        match error {
            ExportError::NoSession { .. } => Self::NotFound(text),
            ExportError::StillBlinded(_) | ExportError::Withdrawn { .. } => Self::Conflict(text),
            ExportError::Exists(_) | ExportError::Busy | ExportError::Unwritable { .. } | ExportError::Store(_) => {
                Self::Storage(text)
            }
        }
    }
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ExportQuery {
    /// Whether to include which policy ran in which setting; only after unblinding.
    #[serde(default)]
    unblinded: bool,
}

/// A session's export as one ZIP file: CSV, JSON, a data dictionary, checksums. The same as `parfocal export` writes.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}/export.zip", tag = "researcher",
    params(("session" = SessionId, Path), ExportQuery), responses(
    (status = 200, description = "The file", content_type = "application/zip"),
    (status = 404, description = "No such session"),
    (status = 409, description = "The session is not unblinded, or its participant withdrew")))]
pub(super) async fn zip(
    by: Researcher,
    State(app): State<AppState>,
    Path(session): Path<SessionId>,
    Query(query): Query<ExportQuery>,
) -> Result<Response, Error> {
    let by = by.for_session(&app, session).await?;
    app.settle().await;
    let export = Export::prepare(&app.access_log(by), session, query.unblinded).await?;
    Ok(zip_download(folder_name(session, query.unblinded), async move |zip| export.into_zip(zip).await))
}

/// Answers with a ZIP file while `fill` fills it, with one folder in it. Both go by `name`.
pub(super) fn zip_download<E: Display>(
    name: String,
    fill: impl AsyncFnOnce(ZipStream) -> Result<(), E> + Send + 'static,
) -> Response {
    let (zip, bytes) = ZipStream::new(name.clone());
    let disposition = format!("attachment; filename=\"{name}.zip\"");

    // On a separate thread: compressing would delay the streams.
    spawn_blocking(move || {
        if let Err(error) = Handle::current().block_on(fill(zip)) {
            tracing::warn!(%error, "the download of {name} was cut off");
        }
    });

    let headers = [(CONTENT_TYPE, "application/zip".to_owned()), (CONTENT_DISPOSITION, disposition)];
    (headers, Body::from_stream(bytes)).into_response()
}

#[derive(Template)]
#[template(path = "dictionary.html")]
struct Dictionary {
    /// The account that is signed in, if any.
    person: Option<Account>,
    tables: &'static [Table],
    texts: &'static str,
}

/// The data dictionary: every table and column of an export, with its unit.
#[utoipa::path(get, path = "/researcher/dictionary", tag = "researcher",
    responses((status = 200, description = "The page", content_type = "text/html")))]
pub(super) async fn dictionary(_: Researcher, SignedIn(person): SignedIn) -> Result<Html<String>, Error> {
    let person = person.map(|person| person.account);
    Dictionary { person, tables: &TABLES, texts: TEXTS_IN_CSV }.render().map(Html).map_err(|_| Error::Internal)
}
