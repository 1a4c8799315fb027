//! The operator's page and its requests: focus, participants, sessions.

use std::sync::Arc;

use askama::Template;
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Html;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::error::Error;
use super::json::JsonBody;
use super::people::{Acting, SignedIn};
use super::roles::{Operator, Roles};
use super::security::Nonce;
use super::surgeon::Act;
use super::{App, AppState};
use parfocal_autofocus::PolicyEntry;
use parfocal_base::ids::SessionId;
use parfocal_session::conductor::{ProtocolSummary, StudyPlace};
use parfocal_session::reports::OpenStudy;
use parfocal_trial::account::Account;
use parfocal_trial::action::Focus;
use parfocal_trial::consent::NewConsent;
use parfocal_trial::pointing::NewChoice;
use parfocal_trial::role::Role;
use parfocal_trial::view::OperatorView;

/// What [`check_code`](parfocal_trial::participant::check_code) accepts, for browsers to check while typing.
const CODE_PATTERN: &str = r"[A-Z0-9\-]{2,16}";
const CODE_HINT: &str = "2 to 16 capital letters, digits and dashes, such as S-01";

#[derive(Template)]
#[template(path = "operator.html")]
struct Page {
    nonce: String,
    chain: String,
    /// The account that is signed in, if any.
    person: Option<Account>,
    /// Whether this browser also holds the researcher's role.
    researcher: bool,
    surgeon_link: String,
    /// Whether that link works only on this machine.
    loopback_only: bool,
    /// The link as a QR code in SVG.
    qr: String,
    /// The page that helps a device to trust the server, if that is needed.
    trust: Option<Trust>,
    code_pattern: &'static str,
    code_hint: &'static str,
}

/// The page that helps a device to trust the server.
struct Trust {
    link: String,
    /// The link as a QR code in SVG.
    qr: String,
    /// The authority's fingerprint, to be compared on the device.
    fingerprint: String,
}

impl Trust {
    fn of(app: &App, headers: &HeaderMap) -> Result<Option<Self>, Error> {
        let (Some(link), Some(authority)) = (super::links::trust_page(app, headers), app.address.authority()) else {
            return Ok(None);
        };
        let qr = super::links::qr_svg(&link)?;
        Ok(Some(Self { link, qr, fingerprint: authority.fingerprint.clone() }))
    }
}

/// The operator's page.
#[utoipa::path(get, path = "/operator", tag = "operator", responses(
    (status = 200, description = "The page", content_type = "text/html"),
))]
pub(super) async fn page(
    by: Operator,
    SignedIn(person): SignedIn,
    roles: Roles,
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
    headers: HeaderMap,
) -> Result<Html<String>, Error> {
    let surgeon_link = super::links::surgeon_link(&app, &headers, by.account().is_some());
    let qr = super::links::qr_svg(&surgeon_link)?;
    let trust = Trust::of(&app, &headers)?;
    let researcher = roles.choose(Some(Role::Researcher)).is_ok();
    let page = Page {
        nonce,
        person: person.map(|person| person.account),
        chain: super::researcher::chain_words(&app).await,
        researcher,
        surgeon_link,
        loopback_only: app.address.loopback_only(),
        trust,
        qr,
        code_pattern: CODE_PATTERN,
        code_hint: CODE_HINT,
    };

    page.render().map(Html).map_err(|_| Error::Internal)
}

/// The surgeon's link, as text and as a QR code.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct SurgeonLink {
    /// The link.
    link: String,
    /// The link as a QR code in SVG.
    qr: String,
    /// The session in a study that the link is for; none for the link to every session outside studies.
    session: Option<SessionId>,
}

/// The surgeon's link. In a session of a study it is valid only for that session, and ends with it.
#[utoipa::path(get, path = "/api/operator/surgeon-link", tag = "operator", responses(
    (status = 200, body = SurgeonLink)))]
pub(super) async fn link(
    by: Operator,
    State(app): State<AppState>,
    headers: HeaderMap,
) -> Result<Json<SurgeonLink>, Error> {
    let session = app.linked_session();
    if session.is_some() {
        by.personally()?;
    }
    let link = super::links::surgeon_link(&app, &headers, session.is_some());
    let qr = super::links::qr_svg(&link)?;
    Ok(Json(SurgeonLink { link, qr, session }))
}

/// What the operator can choose from.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Choices {
    /// Codes of the participants.
    participants: Vec<String>,
    /// The protocols.
    protocols: Vec<ProtocolSummary>,
    /// Studies in which sessions can be made now.
    studies: Vec<OpenStudy>,
    /// The policies.
    #[schema(value_type = Vec<Object>)]
    policies: Vec<PolicyEntry>,
}

/// What the operator can choose from.
#[utoipa::path(get, path = "/api/operator/choices", tag = "operator", responses((status = 200, body = Choices)))]
pub(super) async fn choices(_: Operator, State(app): State<AppState>) -> Result<Json<Choices>, Error> {
    Ok(Json(Choices {
        participants: app.store.reader().participants().await?,
        protocols: app.library.summaries(),
        studies: OpenStudy::all(app.conductor.studies()).await?,
        policies: app.registry.entries(),
    }))
}

/// Puts a policy in charge of the focus, or sets the focal power by hand. While a session is under way only the latter,
/// and only while it is paused or after an abort; that is recorded in the session.
#[utoipa::path(post, path = "/api/operator/focus", tag = "operator", request_body = Focus, responses(
    (status = 204, description = "Done"),
    (status = 404, description = "No such policy"),
    (status = 409, description = "A session is under way, or the policy cannot run")))]
pub(super) async fn focus(
    by: Operator,
    State(app): State<AppState>,
    JsonBody(focus): JsonBody<Focus>,
) -> Result<StatusCode, Error> {
    let by = match app.study_session() {
        Some(session) => by.for_session(&app, session).await?,
        None => by.actor(),
    };
    app.conductor.focus(by, &focus).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Points the focus at a place in the picture, or back at the centre. In a session it is recorded, and only while a
/// setting is inspected whose protocol lets the surgeon point.
#[utoipa::path(post, path = "/api/operator/patch", tag = "operator", request_body = NewChoice, responses(
    (status = 204, description = "The next frame is focused there"),
    (status = 404, description = "No such session"),
    (status = 409, description = "The protocol or the state of the session does not allow it"),
    (status = 422, description = "The place lies outside the picture")))]
pub(super) async fn patch(
    by: Operator,
    State(app): State<AppState>,
    JsonBody(new): JsonBody<NewChoice>,
) -> Result<StatusCode, Error> {
    let by = match new.session {
        Some(session) => by.for_session(&app, session).await?,
        None => by.actor(),
    };
    app.conductor.choose(by, new).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// A participant to add.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct NewParticipant {
    /// 2 to 16 capital letters, digits and dashes; never a name.
    #[schema(pattern = r"^[A-Z0-9\-]{2,16}$")]
    code: String,
}

/// Adds a participant; one that exists already stays as it is. Answers with all codes.
#[utoipa::path(post, path = "/api/operator/participants", tag = "operator", request_body = NewParticipant, responses(
    (status = 200, body = Vec<String>), (status = 422, description = "No such code")))]
pub(super) async fn add_participant(
    _: Operator,
    State(app): State<AppState>,
    JsonBody(new): JsonBody<NewParticipant>,
) -> Result<Json<Vec<String>>, Error> {
    app.conductor.add_participant(Role::Operator, &new.code).await?;
    Ok(Json(app.store.reader().participants().await?))
}

/// A session to prepare.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct NewSession {
    /// Code of the participant.
    participant: String,
    /// Name of the protocol.
    protocol: String,
    /// The study that the session belongs to; none outside studies.
    #[serde(default)]
    study: Option<StudyPlace>,
}

type View = Json<Option<Arc<OperatorView>>>;

/// The session under way; null if there is none.
#[utoipa::path(get, path = "/api/operator/session", tag = "operator", responses(
    (status = 200, body = Option<OperatorView>),
))]
pub(super) async fn session(_: Operator, State(app): State<AppState>) -> View {
    Json(app.operator_view.borrow().clone())
}

/// Prepares a session: draws its order, or takes the next place of its study's list, and waits for its start.
#[utoipa::path(post, path = "/api/operator/sessions", tag = "operator", request_body = NewSession, responses(
    (status = 200, body = Option<OperatorView>),
    (status = 404, description = "No such participant, protocol or study"),
    (status = 409, description = "A session is under way, or the study allows no such session"),
    (status = 422, description = "The study has no such site or protocol")))]
pub(super) async fn create(
    by: Operator,
    State(app): State<AppState>,
    JsonBody(new): JsonBody<NewSession>,
) -> Result<View, Error> {
    if new.study.is_some() {
        by.personally()?;
    }
    app.conductor.create(by.actor(), &new.participant, &new.protocol, new.study).await?;
    Ok(Json(app.operator_view.borrow().clone()))
}

/// Advances the session; repeating an action changes nothing. Returns the session after the action.
#[utoipa::path(post, path = "/api/operator/actions", tag = "operator", request_body = Act, responses(
    (status = 200, body = Option<OperatorView>),
    (status = 403, description = "The action belongs to another role"),
    (status = 404, description = "No such session or segment"),
    (status = 422, description = "No reason was given"),
    (status = 409, description = "The action does not fit the state of the session")))]
pub(super) async fn act(
    by: Operator,
    State(app): State<AppState>,
    JsonBody(act): JsonBody<Act>,
) -> Result<View, Error> {
    let by = by.for_session(&app, act.session).await?;
    app.conductor.act(by, act.session, act.action).await?;
    Ok(Json(app.operator_view.borrow().clone()))
}

/// Records a participant's consent. Returns the session after that.
#[utoipa::path(post, path = "/api/operator/consents", tag = "operator", request_body = NewConsent, responses(
    (status = 200, body = Option<OperatorView>),
    (status = 404, description = "No such session"),
    (status = 422, description = "Something is missing, the day is in the future, or the protocol requires another \
                                  version of the text")))]
pub(super) async fn consent(
    by: Operator,
    State(app): State<AppState>,
    JsonBody(new): JsonBody<NewConsent>,
) -> Result<View, Error> {
    let by = by.for_session(&app, new.session).await?;
    app.conductor.record_consent(by, new).await?;
    Ok(Json(app.operator_view.borrow().clone()))
}

/// A session to take off the screens.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct Dismissal {
    /// The session.
    session: SessionId,
}

/// Takes an ended session off the screens, so that the next can be prepared.
#[utoipa::path(post, path = "/api/operator/dismissals", tag = "operator", request_body = Dismissal, responses(
    (status = 200, body = Option<OperatorView>),
    (status = 409, description = "The session is under way")))]
pub(super) async fn dismiss(
    by: Operator,
    State(app): State<AppState>,
    JsonBody(gone): JsonBody<Dismissal>,
) -> Result<View, Error> {
    by.for_session(&app, gone.session).await?;
    app.conductor.dismiss(Role::Operator, gone.session)?;
    Ok(Json(app.operator_view.borrow().clone()))
}
