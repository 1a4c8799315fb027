//! The export of a whole study for the researcher's browser: starts it, reports its progress, and sends the file.

use axum::Json;
use axum::extract::{Path, State};
use axum::response::Response;
use serde::Deserialize;
use utoipa::ToSchema;

use super::AppState;
use super::error::Error;
use super::export::zip_download;
use super::json::JsonBody;
use super::people::Acting;
use super::roles::{ResearchReader, Researcher};
use parfocal_records::store::Access;
use parfocal_results::study_export::{StudyExportError, StudyExportState, check};

impl From<StudyExportError> for Error {
    fn from(error: StudyExportError) -> Self {
        let text = error.to_string();
        match error {
            StudyExportError::NoStudy { .. } => Self::NotFound(text),
            StudyExportError::Refused(_) => Self::Conflict(text),
            StudyExportError::Session(error) => error.into(),
            StudyExportError::Failed(_) => Self::Storage(text),
        }
    }
}

/// What to export.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct ExportStudy {
    /// Whether to include which policy ran in which setting; only after unblinding.
    #[serde(default)]
    unblinded: bool,
}

/// Begins to export all sessions of a study as one package, in the background. If an export is already being made, no
/// other begins, and the answer gives the progress of that one.
#[utoipa::path(post, path = "/api/researcher/studies/{study}/export", tag = "researcher",
    params(("study" = String, Path)), request_body = ExportStudy, responses(
    (status = 200, body = StudyExportState),
    (status = 404, description = "No such study"),
    (status = 409, description = "The study has no session to export, or is not unblinded")))]
pub(super) async fn start_study_export(
    by: ResearchReader,
    State(app): State<AppState>,
    Path(study): Path<String>,
    JsonBody(wanted): JsonBody<ExportStudy>,
) -> Result<Json<StudyExportState>, Error> {
    by.personally()?;
    check(app.store.reader(), &study, wanted.unblinded).await?;
    app.settle().await;
    Ok(Json(app.study_exports.start(app.access_log(by.actor()), &study, wanted.unblinded)))
}

/// The state of the latest export of a study. A finished export is kept for an hour, unless a surgeon withdraws or
/// words are erased.
#[utoipa::path(get, path = "/api/researcher/studies/{study}/export", tag = "researcher",
    params(("study" = String, Path)), responses((status = 200, body = StudyExportState)))]
pub(super) async fn study_export(
    by: Researcher,
    State(app): State<AppState>,
    Path(study): Path<String>,
) -> Result<Json<StudyExportState>, Error> {
    by.personally()?;
    let state = app.study_exports.state(app.store.reader(), &study).await;
    Ok(Json(state?))
}

/// The finished export of a study as one ZIP file: the same as `parfocal export --study` writes.
#[utoipa::path(get, path = "/api/researcher/studies/{study}/export.zip", tag = "researcher",
    params(("study" = String, Path)), responses(
    (status = 200, description = "The file", content_type = "application/zip"),
    (status = 404, description = "No export of the study is finished")))]
pub(super) async fn study_export_zip(
    by: Researcher,
    State(app): State<AppState>,
    Path(study): Path<String>,
) -> Result<Response, Error> {
    let person = by.personally()?;
    let missing = || Error::NotFound("No export of this study is ready. Start one on the study's page.".to_owned());
    let made = app.study_exports.made(app.store.reader(), &study).await?;
    let made = made.ok_or_else(missing)?;

    // Whoever started the export is already recorded as having exported each session.
    if made.by.as_ref() != Some(&person.account) {
        let access_log = app.access_log(by.actor());
        for &session in &made.sessions {
            access_log.record(&Access::Exported { session, unblinded: made.unblinded }).await?;
        }
    }

    let name = format!("parfocal-{study}{}", if made.unblinded { "-unblinded" } else { "" });
    // The closure holds `made`, so its files stay until all of them are sent.
    Ok(zip_download(name, async move |zip| Box::pin(zip.send_folder(made.folder())).await))
}
