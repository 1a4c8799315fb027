//! Errors as people and programs get them: for a browser a page that says what to do next, for a program
//! `{"error": "…"}`.

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
use parfocal_records::accounts::AccountError;
use parfocal_records::store::StoreError;
use parfocal_session::conductor::ConductError;
use parfocal_trial::role::Role;

/// The reason why a request was not done. The text is written for people.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// What was asked for does not exist.
    #[error("{0}")]
    NotFound(String),
    /// The request does not fit the current state; nothing was changed.
    #[error("{0}")]
    Conflict(String),
    /// The request is invalid.
    #[error("{0}")]
    Invalid(String),
    /// The browser does not hold this role.
    #[error("This page is for the {role}. Open it with the {role}'s link{}.", whence(*.0), role = role_name(*.0))]
    NeedsRole(Role),
    /// The browser holds no role.
    #[error(
        "This browser has not been let in yet. Open it with the link of your role: the server prints all three \
         when it starts; a surgeon gets the link from the operator."
    )]
    NoRole,
    /// The key in the link is not one of this server's.
    #[error(
        "This link is not valid, or no longer valid. A surgeon gets the link from the operator; \
         the server printed all of them when it last started."
    )]
    WrongKey,
    /// The surgeon's link is to a session that has ended.
    #[error(
        "This link was for one session, which has ended. This tablet can still send what it holds from that session. \
         For the next session the operator shows a new code."
    )]
    SessionOver,
    /// The surgeon's shared link was used in a session of a study.
    #[error("The session under way has its own link. Scan the code on the operator's page.")]
    NeedsSessionLink,
    /// In a study, this needs a sign-in under an account with this role.
    #[error(
        "This belongs to a study, where everybody but the surgeon acts under a personal account. The link of the \
         {role} is not enough: sign in at /sign-in with an account that may act as {role}.",
        role = role_name(*.0)
    )]
    NeedsAccount(Role),
    /// Too many attempts to sign in failed.
    #[error("{0}")]
    TooMany(String),
    /// This role or account may not do this.
    #[error("{0}")]
    Forbidden(String),
    /// The request was made by another site.
    #[error("This request came from another site and was not done. Go back to the page and try again from there.")]
    CrossSite,
    /// The server was asked for by a name that it does not accept.
    #[error(
        "This server is reached as localhost or 127.0.0.1. To reach it from elsewhere, \
         start it with --bind 0.0.0.0:8080 --tls."
    )]
    WrongHost,
    /// A request that changes something was sent unencrypted.
    #[error(
        "This server takes encrypted requests alone. Send this one to https://{0} instead. A key or passphrase in it \
         could be read on the way: change it if others use this network."
    )]
    Unencrypted(String),
    /// Members have no place left.
    #[error("Too many pages are open at once. Close some of them, then try again.")]
    Busy,
    /// The disk or the database failed; nothing was acknowledged.
    #[error("Could not be saved: {0}")]
    Storage(String),
    /// Something in the database comes from another version of parfocal.
    #[error("{0}")]
    Unreadable(String),
    /// The server itself failed.
    #[error("The server failed to handle this request. What was saved before is safe. The server's log says more.")]
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
    #[must_use]
    pub const fn status(&self) -> StatusCode {
        match self {
            Self::NotFound(_) => StatusCode::NOT_FOUND,
            Self::Conflict(_) => StatusCode::CONFLICT,
            Self::Invalid(_) => StatusCode::UNPROCESSABLE_ENTITY,
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
}

impl From<ConductError> for Error {
    fn from(error: ConductError) -> Self {
        match error {
            ConductError::NotFound(text) => Self::NotFound(text),
            ConductError::Forbidden(text) => Self::Forbidden(text),
            ConductError::Conflict(text) => Self::Conflict(text),
            ConductError::Invalid(text) => Self::Invalid(text),
            ConductError::Storage(text) => Self::Storage(text),
            unreadable @ ConductError::Unreadable { .. } => Self::Unreadable(unreadable.to_string()),
        }
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
            AccountError::Refused(refusal) => ConductError::from(refusal).into(),
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
        Some(error) => error.to_string(),
        // A parser's message about an address is for programmers.
        None if page && status == StatusCode::BAD_REQUEST => MISSPELLED.to_owned(),
        None => message_of(status, &parts.headers, body).await,
    };

    // The cookie outlives its sign-in. Somebody who held a role only by that sign-in is asked to sign in again.
    let sign_in = matches!(error, Some(Error::NeedsAccount(_))) || was_signed_in && may_sign_in(error.as_ref());
    parts.headers.remove(CONTENT_LENGTH);
    parts.headers.remove(CONTENT_TYPE);
    if !page {
        return (parts, Json(ErrorBody { error: message, sign_in })).into_response();
    }

    let html = ErrorPage {
        title: title_of(status),
        message: &message,
        sign_in: may_sign_in(error.as_ref()).then(|| format!("/sign-in?next={path}")),
        reload: from_elsewhere && matches!(error, Some(Error::NeedsRole(_) | Error::NoRole)),
    };

    match html.render() {
        Ok(html) => (parts, Html(html)).into_response(),
        Err(_) => (parts, message).into_response(),
    }
}

/// Whether a page offers to sign in. It also does if the role's link was expected, because an account is accepted too.
const fn may_sign_in(error: Option<&Error>) -> bool {
    matches!(error, Some(Error::NeedsAccount(_) | Error::NeedsRole(Role::Operator | Role::Researcher) | Error::NoRole))
}

const FOR_PROGRAMS: &str = "A program sends the key that stands in that link, as 'Authorization: Bearer KEY'.";

const MISSPELLED: &str =
    "This address is incomplete or misspelled. Open the link once more as you were given it, or go to the start page.";

fn wants_page(headers: &HeaderMap) -> bool {
    headers.get(ACCEPT).and_then(|accept| accept.to_str().ok()).is_some_and(|accept| accept.contains("text/html"))
}

/// The message of an error that another layer made: its own text if it has any, otherwise the meaning of the status.
async fn message_of(status: StatusCode, headers: &HeaderMap, body: axum::body::Body) -> String {
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
        StatusCode::NOT_FOUND => "There is nothing at this address.".into(),
        StatusCode::METHOD_NOT_ALLOWED => "This address does not take this kind of request.".into(),
        StatusCode::PAYLOAD_TOO_LARGE => "This text is too long. Send it in shorter parts.".into(),
        StatusCode::REQUEST_TIMEOUT => "The server took too long; try again.".into(),
        other => other.canonical_reason().unwrap_or("The request failed.").into(),
    }
}

fn title_of(status: StatusCode) -> &'static str {
    match status {
        StatusCode::NOT_FOUND => "Nothing here",
        StatusCode::FORBIDDEN | StatusCode::MISDIRECTED_REQUEST => "Not open to this browser",
        StatusCode::CONFLICT => "Not possible now",
        status if status.is_server_error() => "The server failed",
        _ => "That did not work",
    }
}

/// Where to get the link of `role`. A surgeon does not see what the server prints at its start.
const fn whence(role: Role) -> &'static str {
    match role {
        Role::Surgeon => ": the operator has it",
        _ => ", which the server prints when it starts",
    }
}

/// A role's name in a sentence.
#[must_use]
pub const fn role_name(role: Role) -> &'static str {
    match role {
        Role::Surgeon => "surgeon",
        Role::Operator => "operator",
        Role::Researcher => "researcher",
        Role::System => "server",
    }
}
