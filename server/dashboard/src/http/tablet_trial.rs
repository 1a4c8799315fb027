//! The page that a tablet opens once, and that tries what a trial needs of it. The operator's page tells the result.
//! It is open to tablets that are let in: on others the live connection fails, whatever the network does.

use askama::Template;
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::USER_AGENT;
use axum::response::{Html, IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::error::Error;
use super::json::JsonBody;
use super::roles::Surgeon;
use super::security::{Nonce, PERMISSIONS_POLICY, WITH_MICROPHONE};
use super::{AppState, tongue};
use crate::doctor::{TabletPart, TriedTablet};
use parfocal_base::ids::DeviceId;
use parfocal_language::Language;

#[derive(Template)]
#[template(path = "tablet.html")]
struct Page {
    language: Language,
    nonce: String,
}

/// The page that tries a tablet.
#[utoipa::path(get, path = "/tablet", tag = "surgeon",
    responses((status = 200, description = "The page", content_type = "text/html")))]
pub(super) async fn tablet_page(
    _: Surgeon,
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let language = tongue::of_page(&app, &headers);
    let html = Page { language, nonce }.render().map_err(|_| Error::Internal)?;
    let mut response = Html(language.fill(&html)).into_response();
    response.headers_mut().insert(PERMISSIONS_POLICY, WITH_MICROPHONE);
    Ok(response)
}

/// What a tablet found out about itself.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct TabletTrial {
    /// The tablet.
    device: DeviceId,
    /// What was tried.
    tried: Vec<TriedPart>,
}

/// One thing that was tried on a tablet.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, ToSchema)]
struct TriedPart {
    /// What was tried.
    part: TabletPart,
    /// Whether it works.
    works: bool,
}

/// Notes what works on a surgeon's tablet, for the operator's page. It is forgotten when the server ends.
#[utoipa::path(post, path = "/api/surgeon/tablet-trials", tag = "surgeon", request_body = TabletTrial, responses(
    (status = 200, description = "Noted", body = bool),
    (status = 422, description = "The body is malformed")))]
pub(super) async fn tried(
    _: Surgeon,
    State(app): State<AppState>,
    headers: HeaderMap,
    JsonBody(trial): JsonBody<TabletTrial>,
) -> Json<bool> {
    let user_agent = headers.get(USER_AGENT).and_then(|agent| agent.to_str().ok()).unwrap_or_default().to_owned();
    let failing = trial.tried.iter().filter(|tried| !tried.works).map(|tried| tried.part).collect();
    app.tablet_trials.note(trial.device, TriedTablet { user_agent, at: app.clock.wall(), failing });
    Json(true)
}
