//! The surgeon's page and its requests: actions, comments, answers. This file sees only the surgeon's view.

use std::sync::Arc;

use askama::Template;
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{Html, IntoResponse, Response};
use serde::Deserialize;
use utoipa::ToSchema;

use super::credentials::{link_name, pass};
use super::error::Error;
use super::json::JsonBody;
use super::offline::PAGE_VERSION;
use super::roles::{Surgeon, SurgeonsTablet};
use super::security::{Nonce, PERMISSIONS_POLICY, WITH_MICROPHONE};
use super::{AppState, assets, tongue};
use parfocal_base::ids::SessionId;
use parfocal_language::Language;
use parfocal_trial::action::Action;
use parfocal_trial::pointing::NewChoice;
use parfocal_trial::remark::{Holding, NewAnswer, NewComment};
use parfocal_trial::role::Role;
use parfocal_trial::view::SurgeonView;

#[derive(Template)]
#[template(path = "surgeon.html")]
struct Page {
    language: Language,
    nonce: String,
    /// Whether the page may ask for the microphone.
    microphone: bool,
    /// A name for the link by which the tablet was let in. What the browser stores under one link is not shown under
    /// another.
    link: String,
}

#[derive(Template)]
#[template(path = "surgeon_over.html")]
struct OverPage {
    language: Language,
    nonce: String,
    message: String,
}

/// The surgeon's page.
#[utoipa::path(get, path = "/surgeon", tag = "surgeon",
    responses((status = 200, description = "The page", content_type = "text/html")))]
pub(super) async fn page(
    _: SurgeonsTablet,
    surgeon: Result<Surgeon, Error>,
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
    headers: HeaderMap,
) -> Result<Response, Error> {
    // A tablet that is no longer let in still sends what it holds.
    if let Err(error) = surgeon {
        let language = tongue::of_former_tablet(&app, &headers);
        let message = error.say_in(language);
        let html = OverPage { language, nonce, message }.render().map_err(|_| Error::Internal)?;
        return Ok(Html(language.fill(&html)).into_response());
    }

    let microphone = app.surgeon_view.borrow().as_ref().is_some_and(|view| view.voice);
    let link = pass(&headers, &app.keys).map(|pass| link_name(pass, &app.keys)).unwrap_or_default();
    let language = tongue::of_page(&app, &headers);
    let html = Page { language, nonce, microphone, link }.render().map_err(|_| Error::Internal)?;
    let mut response = Html(language.fill(&html)).into_response();
    response.headers_mut().insert(PAGE_VERSION, HeaderValue::from_static(assets::version()));
    if microphone {
        response.headers_mut().insert(PERMISSIONS_POLICY, WITH_MICROPHONE);
    }
    Ok(response)
}

type View = Json<Option<Arc<SurgeonView>>>;

/// The session under way; null if there is none.
#[utoipa::path(get, path = "/api/surgeon/session", tag = "surgeon",
    responses((status = 200, body = Option<SurgeonView>)))]
pub(super) async fn session(_: Surgeon, State(app): State<AppState>) -> View {
    Json(app.surgeon_view.borrow().clone())
}

/// An action on a session.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct Act {
    /// The session that the page was showing.
    pub(super) session: SessionId,
    /// What to do.
    #[serde(flatten)]
    pub(super) action: Action,
}

/// Advances the session; repeating an action changes nothing. Returns the session after the action.
#[utoipa::path(post, path = "/api/surgeon/actions", tag = "surgeon", request_body = Act, responses(
    (status = 200, body = Option<SurgeonView>),
    (status = 403, description = "The action belongs to another role"),
    (status = 404, description = "No such session or segment"),
    (status = 409, description = "The action does not fit the state of the session")))]
pub(super) async fn act(_: Surgeon, State(app): State<AppState>, JsonBody(act): JsonBody<Act>) -> Result<View, Error> {
    app.conductor.act(Role::Surgeon, act.session, act.action).await?;
    Ok(Json(app.surgeon_view.borrow().clone()))
}

/// Points the focus at a place in the picture, or back at the centre. In a session it is recorded, and only while a
/// setting is inspected whose protocol lets the surgeon point.
#[utoipa::path(post, path = "/api/surgeon/patch", tag = "surgeon", request_body = NewChoice, responses(
    (status = 204, description = "The next frame is focused there"),
    (status = 404, description = "No such session"),
    (status = 409, description = "The protocol or the state of the session does not allow it"),
    (status = 422, description = "The place lies outside the picture")))]
pub(super) async fn patch(
    _: Surgeon,
    State(app): State<AppState>,
    JsonBody(new): JsonBody<NewChoice>,
) -> Result<StatusCode, Error> {
    app.conductor.choose(Role::Surgeon, new).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Stores a comment: once this has answered, it is on disk. A comment sent again with the same key is stored once.
#[utoipa::path(post, path = "/api/surgeon/comments", tag = "surgeon", request_body = NewComment, responses(
    (status = 204, description = "Kept"),
    (status = 404, description = "No such session"),
    (status = 409, description = "The key belongs to another comment"),
    (status = 422, description = "Empty or too long"),
    (status = 507, description = "The disk failed; send it again")))]
pub(super) async fn comment(
    _: SurgeonsTablet,
    State(app): State<AppState>,
    JsonBody(comment): JsonBody<NewComment>,
) -> Result<StatusCode, Error> {
    app.conductor.comment(comment).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Stores an answer: once this has answered, it is on disk. If a question has several, the one given last counts. One
/// that arrives too long after the session's end is stored, but never counts.
#[utoipa::path(post, path = "/api/surgeon/answers", tag = "surgeon", request_body = NewAnswer, responses(
    (status = 204, description = "Kept"),
    (status = 404, description = "No such session or question"),
    (status = 409, description = "The question is not asked yet, or the key belongs to another answer"),
    (status = 422, description = "The value does not fit the question"),
    (status = 507, description = "The disk failed; send it again")))]
pub(super) async fn answer(
    _: SurgeonsTablet,
    State(app): State<AppState>,
    JsonBody(answer): JsonBody<NewAnswer>,
) -> Result<StatusCode, Error> {
    app.conductor.answer(answer).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Notes how much of a session a surgeon's device still holds, so that nobody unblinds it without being warned.
#[utoipa::path(post, path = "/api/surgeon/holding", tag = "surgeon", request_body = Holding, responses(
    (status = 204, description = "Noted"),
    (status = 404, description = "No such session"),
    (status = 507, description = "The disk failed; send it again")))]
pub(super) async fn holding(
    _: SurgeonsTablet,
    State(app): State<AppState>,
    JsonBody(holding): JsonBody<Holding>,
) -> Result<StatusCode, Error> {
    app.conductor.holding(holding).await?;
    Ok(StatusCode::NO_CONTENT)
}
