//! Errors as people and programs get them: for a browser a page that says what to do next, for a program
//! `{"error": "…"}`.

use std::fmt;

use askama::Template;
use axum::Json;
use axum::body::to_bytes;
use axum::extract::Request;
use axum::http::header::{ACCEPT, CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::Next;
use axum::response::{Html, IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::credentials::{ACCOUNT_COOKIE, cookie};
use super::tongue::of_tablet;
use parfocal_language::{Language, Message};
use parfocal_records::accounts::AccountError;
use parfocal_records::store::StoreError;
use parfocal_session::conductor::ConductError;
use parfocal_trial::refusal::{Refusal, RefusalKind};
use parfocal_trial::role::Role;

/// The reason why a request was not done. The text is written for people.
#[derive(Debug, Clone)]
pub enum Error {
    /// What was asked for does not exist.
    NotFound(String),
    /// The request does not fit the current state; nothing was changed.
    Conflict(String),
    /// The request is invalid.
    Invalid(String),
    /// What was asked for does not exist, does not fit the current state, or is invalid. A surgeon reads it in the
    /// session's language.
    Said(RefusalKind, Message),
    /// The browser does not hold this role.
    NeedsRole(Role),
    /// The browser holds no role.
    NoRole,
    /// The key in the link is not one of this server's.
    WrongKey,
    /// The surgeon's link is to a session that has ended.
    SessionOver,
    /// The surgeon's shared link was used in a session of a study.
    NeedsSessionLink,
    /// In a study, this needs a sign-in under an account with this role.
    NeedsAccount(Role),
    /// Too many attempts to sign in failed.
    TooMany(String),
    /// This role or account may not do this.
    Forbidden(String),
    /// The request was made by another site.
    CrossSite,
    /// The server was asked for by a name that it does not accept.
    WrongHost,
    /// A request that changes something was sent unencrypted to this host.
    Unencrypted(String),
    /// Members have no place left.
    Busy,
    /// The disk or the database failed; nothing was acknowledged.
    Storage(String),
    /// Something in the database comes from another version of parfocal.
    Unreadable(String),
    /// The server itself failed.
    Internal,
}

/// An error as programs get it.
#[derive(Debug, Serialize, ToSchema)]
pub struct ErrorBody {
    /// What happened and what to do.
    pub error: String,
    /// Whether signing in under a personal account would help.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub sign_in: bool,
}

impl Error {
    /// The HTTP status of this error.
    pub const fn status(&self) -> StatusCode {
        match self {
            Self::NotFound(_) | Self::Said(RefusalKind::Unknown, _) => StatusCode::NOT_FOUND,
            Self::Conflict(_) | Self::Said(RefusalKind::Conflict, _) => StatusCode::CONFLICT,
            Self::Invalid(_) | Self::Said(RefusalKind::Invalid, _) => StatusCode::UNPROCESSABLE_ENTITY,
            Self::NeedsRole(_)
            | Self::NoRole
            | Self::NeedsAccount(_)
            | Self::SessionOver
            | Self::NeedsSessionLink
            | Self::Forbidden(_)
            | Self::WrongKey
            | Self::Unencrypted(_)
            | Self::CrossSite => StatusCode::FORBIDDEN,
            Self::TooMany(_) => StatusCode::TOO_MANY_REQUESTS,
            Self::WrongHost => StatusCode::MISDIRECTED_REQUEST,
            Self::Busy => StatusCode::SERVICE_UNAVAILABLE,
            Self::Storage(_) => StatusCode::INSUFFICIENT_STORAGE,
            Self::Unreadable(_) | Self::Internal => StatusCode::INTERNAL_SERVER_ERROR,
        }
    }

    /// The error in `language`, as far as a surgeon can meet it; otherwise in English.
    pub fn say_in(&self, language: Language) -> String {
        match self {
            Self::Said(_, message) => message.say_in(language),
            Self::NeedsRole(Role::Surgeon) => language.say("error-needs-surgeon"),
            Self::NoRole => language.say("error-no-role"),
            Self::WrongKey => language.say("error-wrong-key"),
            Self::SessionOver => language.say("error-session-over"),
            Self::NeedsSessionLink => language.say("error-needs-session-link"),
            Self::CrossSite => language.say("error-cross-site"),
            Self::Busy => language.say("error-busy"),
            Self::Storage(reason) => Message::new("error-storage").words("reason", reason).say_in(language),
            Self::Internal => language.say("error-internal"),
            Self::NotFound(text)
            | Self::Conflict(text)
            | Self::Invalid(text)
            | Self::TooMany(text)
            | Self::Forbidden(text)
            | Self::Unreadable(text) => text.clone(),
            Self::NeedsRole(role) => format!(
                "This page is for the {role}. Open it with the {role}'s link, which the server prints when it starts.",
                role = role_name(*role)
            ),
            Self::NeedsAccount(role) => format!(
                "This belongs to a study, where everybody but the surgeon acts under a personal account. The link of \
                 the {role} is not enough: sign in at /sign-in with an account that may act as {role}.",
                role = role_name(*role)
            ),
            Self::WrongHost => {
                "This server is reached as localhost or 127.0.0.1. To reach it from elsewhere, start it with --bind \
                 0.0.0.0:8080 --tls."
                    .to_owned()
            }
            Self::Unencrypted(host) => format!(
                "This server takes encrypted requests alone. Send this one to https://{host} instead. A key or \
                 passphrase in it could be read on the way: change it if others use this network."
            ),
        }
    }
}

impl std::error::Error for Error {}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.say_in(Language::English))
    }
}

impl From<ConductError> for Error {
    fn from(error: ConductError) -> Self {
        match error {
            ConductError::NotFound(text) => Self::NotFound(text),
            ConductError::Forbidden(text) => Self::Forbidden(text),
            ConductError::Conflict(text) => Self::Conflict(text),
            ConductError::Invalid(text) => Self::Invalid(text),
            ConductError::Storage(text) => Self::Storage(text),
            ConductError::Said(kind, message) => Self::Said(kind, message),
            ConductError::Damaged(text) => Self::Unreadable(text),
            unreadable @ ConductError::Unreadable { .. } => Self::Unreadable(unreadable.to_string()),
        }
    }
}

impl From<Refusal> for Error {
    fn from(refusal: Refusal) -> Self {
        ConductError::from(refusal).into()
    }
}

impl From<StoreError> for Error {
    fn from(error: StoreError) -> Self {
        Self::Storage(error.to_string())
    }
}

impl From<AccountError> for Error {
    fn from(error: AccountError) -> Self {
        let text = error.to_string();
        match error {
            AccountError::WrongPassphrase | AccountError::WrongConfirmation => Self::Forbidden(text),
            AccountError::TooMany { .. } => Self::TooMany(text),
            AccountError::Taken(_) | AccountError::ChooseAnother => Self::Conflict(text),
            AccountError::Unknown(_) => Self::NotFound(text),
            AccountError::Refused(refusal) => refusal.into(),
            AccountError::Storage(_) => Self::Storage(text),
        }
    }
}

impl IntoResponse for Error {
    /// Attaches the error to the response. [`render`] makes the body, because it knows whether a browser or a program
    /// asked.
    fn into_response(self) -> Response {
        let mut response = self.status().into_response();
        response.extensions_mut().insert(self);
        response
    }
}

#[derive(Template)]
#[template(path = "error.html")]
struct ErrorPage<'a> {
    language: Language,
    title: &'a str,
    message: &'a str,
    /// Whether to load the page again: a browser that followed another site's link does not send strict cookies with
    /// the first request, but sends them when our own page asks.
    reload: bool,
    /// Address to sign in, which leads back here; `None` if signing in does not help.
    sign_in: Option<String>,
}

/// Marks a failed response that keeps the body from its handler.
#[derive(Debug, Clone, Copy)]
pub struct OwnBody;

/// Gives every failed response its body: a page if a browser asked for a page, otherwise JSON.
pub async fn render(request: Request, next: Next) -> Response {
    let language = of_tablet(&request);
    let page = wants_page(request.headers());
    let from_elsewhere = request.headers().get("sec-fetch-site").is_some_and(|site| site == "cross-site");
    let path = request.uri().path().to_owned();
    let was_signed_in = cookie(request.headers(), ACCOUNT_COOKIE).is_some();
    let response = next.run(request).await;

    let status = response.status();
    if !status.is_client_error() && !status.is_server_error() {
        return response;
    }
    if response.extensions().get::<OwnBody>().is_some() {
        return response;
    }

    let (mut parts, body) = response.into_parts();
    let error = parts.extensions.remove::<Error>();
    let message = match &error {
        Some(error @ (Error::NeedsRole(_) | Error::NoRole)) if !page => format!("{error} {FOR_PROGRAMS}"),
        Some(error) => error.say_in(language),
        // A parser's message about an address is for programmers.
        None if page && status == StatusCode::BAD_REQUEST => language.say("error-misspelled"),
        None => message_of(status, &parts.headers, body, language).await,
    };

    // The cookie outlives its sign-in. Somebody who held a role only by that sign-in is asked to sign in again.
    let sign_in = matches!(error, Some(Error::NeedsAccount(_))) || was_signed_in && may_sign_in(error.as_ref());
    parts.headers.remove(CONTENT_LENGTH);
    parts.headers.remove(CONTENT_TYPE);
    if !page {
        return (parts, Json(ErrorBody { error: message, sign_in })).into_response();
    }

    let title = language.say(title_of(status));
    let html = ErrorPage {
        language,
        title: &title,
        message: &message,
        sign_in: may_sign_in(error.as_ref()).then(|| format!("/sign-in?next={path}")),
        reload: from_elsewhere && matches!(error, Some(Error::NeedsRole(_) | Error::NoRole)),
    };

    match html.render() {
        Ok(html) => (parts, Html(language.fill(&html))).into_response(),
        Err(_) => (parts, message).into_response(),
    }
}

/// Whether a page offers to sign in. It also does if the role's link was expected, because an account is accepted too.
const fn may_sign_in(error: Option<&Error>) -> bool {
    matches!(error, Some(Error::NeedsAccount(_) | Error::NeedsRole(Role::Operator | Role::Researcher) | Error::NoRole))
}

const FOR_PROGRAMS: &str = "A program sends the key that stands in that link, as 'Authorization: Bearer KEY'.";

fn wants_page(headers: &HeaderMap) -> bool {
    headers.get(ACCEPT).and_then(|accept| accept.to_str().ok()).is_some_and(|accept| accept.contains("text/html"))
}

/// The message of an error that another layer made: its own text if it has any, otherwise the meaning of the status.
async fn message_of(status: StatusCode, headers: &HeaderMap, body: axum::body::Body, language: Language) -> String {
    let is_text = status != StatusCode::PAYLOAD_TOO_LARGE
        && headers.get(CONTENT_TYPE).is_some_and(|kind| kind.as_bytes().starts_with(b"text/plain"));
    if is_text
        && let Ok(bytes) = to_bytes(body, 4096).await
        && let Ok(text) = String::from_utf8(bytes.into())
        && !text.is_empty()
    {
        return text;
    }

    match status {
        StatusCode::NOT_FOUND => language.say("error-no-address"),
        StatusCode::METHOD_NOT_ALLOWED => "This address does not take this kind of request.".into(),
        StatusCode::PAYLOAD_TOO_LARGE => language.say("text-too-long"),
        StatusCode::REQUEST_TIMEOUT => language.say("error-timeout"),
        other => other.canonical_reason().unwrap_or("The request failed.").into(),
    }
}

/// The message that heads the page of an error.
fn title_of(status: StatusCode) -> &'static str {
    match status {
        StatusCode::NOT_FOUND => "error-nothing-here",
        StatusCode::FORBIDDEN | StatusCode::MISDIRECTED_REQUEST => "error-not-open",
        StatusCode::CONFLICT => "error-not-now",
        status if status.is_server_error() => "error-server-failed",
        _ => "error-did-not-work",
    }
}

/// A role's name in a sentence.
pub const fn role_name(role: Role) -> &'static str {
    match role {
        Role::Surgeon => "surgeon",
        Role::Operator => "operator",
        Role::Researcher => "researcher",
        Role::System => "server",
    }
}
