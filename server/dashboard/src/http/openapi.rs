//! `/api/openapi.json`: the description of every endpoint, derived from the code that serves it.

use std::sync::{Arc, OnceLock};

use axum::Extension;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use serde::ser::Error as _;
use utoipa::OpenApi;
use utoipa::openapi::path::Operation;
use utoipa::openapi::security::{ApiKey, ApiKeyValue, Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Components, Content, Ref, RefOr, Response, ResponseBuilder};

use super::credentials::cookie_name;
use super::error::{Error, ErrorBody, role_name};
use super::keys::ROLES;
use super::roles::Roles;

/// The part of the document that describes the server as a whole.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "parfocal",
        description = "Live view, autofocus control and blinded usability trials of a hyperspectral video exoscope. \
                       A role is shown by the cookie that /enter gives, or by its key as a bearer token. In a study \
                       everybody but the surgeon signs in under a personal account: by the cookie that /api/sign-in \
                       gives, or by the token that it answers with as a bearer token."
    ),
    components(schemas(ErrorBody))
)]
pub struct Document;

/// The finished document, filled in once every route is known.
pub type Finished = Arc<OnceLock<String>>;

/// Paths that answer without a key.
const OPEN: [&str; 10] = [
    "/api/sign-in",
    "/api/sign-out",
    "/enter",
    "/healthz",
    "/sign-in",
    "/static/{version}/{folder}/{name}",
    "/trust",
    "/trust/authority.crt",
    "/trust/authority.mobileconfig",
    "/trust/check",
];

/// Failures that any request may get: status and description.
const ALWAYS: [(&str, &str); 5] = [
    ("400", "The request cannot be read"),
    ("408", "The request took too long"),
    ("421", "The server listens on a loopback address, and the request names another host"),
    ("500", "The server failed; see its log"),
    ("503", "Too many pages are open at once"),
];

/// Failures that a request with a body may get: status and description.
const WITH_BODY: [(&str, &str); 3] = [
    ("413", "The body is too long"),
    ("415", "The Content-Type is not application/json"),
    ("422", "The body is JSON, but not as described"),
];

const JSON: &str = "application/json";

/// Name of the security scheme for keys and tokens that programs send.
const KEY: &str = "key";

/// Limits that a derived schema cannot express: place in the schemas, keyword, value.
const LIMITS: [(&str, &str, Limit); 10] = [
    ("Focus/oneOf/0", "additionalProperties", Limit::None),
    ("Focus/oneOf/1", "additionalProperties", Limit::None),
    ("Focus/oneOf/0/properties/focal_power", "minimum", Limit::Number(0)),
    ("Focus/oneOf/0/properties/focal_power", "maximum", Limit::Number(1)),
    ("CommentContent/oneOf/0/properties/text", "pattern", Limit::Text(NOT_BLANK)),
    ("CommentContent/oneOf/1/properties/text", "pattern", Limit::Text(NOT_BLANK)),
    // The last two kinds have no text. Words that are sent with them by mistake must be refused, not lost.
    ("CommentContent/oneOf/2/properties", "text", Limit::None),
    ("CommentContent/oneOf/3/properties", "text", Limit::None),
    ("AnswerValue/oneOf/0", "maximum", Limit::Number(u8::MAX)),
    ("AnswerValue/oneOf/1/items", "maximum", Limit::Number(u8::MAX)),
];

/// Pattern of a text that is not blank.
const NOT_BLANK: &str = r"\S";

/// Value of a limit.
enum Limit {
    /// `false`: nothing is allowed here.
    None,
    Number(u8),
    Text(&'static str),
}

/// The whole document as JSON.
///
/// # Errors
/// If a type no longer has a place that a limit is for.
pub fn document(mut api: utoipa::openapi::OpenApi) -> serde_json::Result<String> {
    complete(&mut api);
    let mut document = serde_json::to_value(api)?;
    for (place, keyword, limit) in &LIMITS {
        let schema = document
            .pointer_mut(&format!("/components/schemas/{place}"))
            .ok_or_else(|| serde_json::Error::custom(format!("no schema has the place '{place}' that LIMITS names")))?;
        schema[*keyword] = match limit {
            Limit::None => false.into(),
            Limit::Number(number) => (*number).into(),
            Limit::Text(text) => (*text).into(),
        };
    }

    serde_json::to_string(&document)
}

/// Adds to every operation what its handler does not decide, and so does not describe: the answers of the
/// layers around it, and the ways to authenticate.
fn complete(api: &mut utoipa::openapi::OpenApi) {
    for (path, item) in &mut api.paths.paths {
        for operation in [&mut item.get, &mut item.post].into_iter().flatten() {
            describe_failures(operation);
            for (status, words) in around(path, operation) {
                let responses = &mut operation.responses.responses;
                responses.entry(status.to_owned()).or_insert_with(|| RefOr::T(failure(words)));
            }

            if !OPEN.contains(&path.as_str()) {
                operation.security = Some(shown_by(operation));
            }

            operation.operation_id = unique_id(operation);
        }
    }

    let components = api.components.get_or_insert_with(Components::new);
    components.add_security_scheme(KEY, SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer)));
    for role in ROLES {
        let cookie = ApiKey::Cookie(ApiKeyValue::new(cookie_name(role)));
        components.add_security_scheme(role_name(role), SecurityScheme::ApiKey(cookie));
    }
}

/// The operation's id, prefixed with its tag: two roles have handlers of the same name, and ids must differ.
fn unique_id(operation: &Operation) -> Option<String> {
    let id = operation.operation_id.as_deref()?;
    let tag = operation.tags.iter().flatten().next();
    Some(tag.map_or_else(|| id.to_owned(), |tag| format!("{tag}_{id}")))
}

/// The failures that the layers around the handler of `operation` may answer with.
fn around(path: &str, operation: &Operation) -> Vec<(&'static str, &'static str)> {
    let mut statuses = ALWAYS.to_vec();
    if !OPEN.contains(&path) {
        statuses.push(("403", "The role is not held, or another site made the request"));
    }
    if operation.request_body.is_some() {
        statuses.extend(WITH_BODY);
    }
    if path.contains("researcher") || path.starts_with("/api/operator") || path.starts_with("/api/surgeon") {
        statuses.push(("507", "The disk or the database failed; nothing was changed"));
    }

    statuses
}

/// Adds what a program gets to the failures that the handler of `operation` names.
fn describe_failures(operation: &mut Operation) {
    for (status, response) in &mut operation.responses.responses {
        if let RefOr::T(failure) = response
            && status.as_str() >= "400"
            // A player that asked for a part that is not there reads no words.
            && status != "416"
            && failure.content.is_empty()
        {
            failure.content.insert(JSON.to_owned(), RefOr::T(error_body()));
        }
    }
}

/// A failure: JSON for a program, a page for a browser.
fn failure(words: &str) -> Response {
    let page = Content::default();
    ResponseBuilder::new().description(words).content(JSON, error_body()).content("text/html", page).build()
}

fn error_body() -> Content {
    Content::new(Some(Ref::from_schema_name("ErrorBody")))
}

/// The ways to authenticate for `operation`: as the role in its tags, or as any role if there is none.
fn shown_by(operation: &Operation) -> Vec<SecurityRequirement> {
    let tags = operation.tags.iter().flatten();
    let its_own = ROLES.into_iter().find(|role| tags.clone().any(|tag| tag == role_name(*role)));

    let roles = its_own.map_or_else(|| ROLES.to_vec(), |role| vec![role]);
    let schemes = std::iter::once(KEY).chain(roles.into_iter().map(role_name));
    schemes.map(|scheme| SecurityRequirement::new(scheme, [] as [&str; 0])).collect()
}

/// This document.
#[utoipa::path(get, path = "/api/openapi.json", tag = "service",
    responses((status = 200, description = "OpenAPI 3.1")))]
pub(super) async fn openapi(_: Roles, Extension(document): Extension<Finished>) -> Result<impl IntoResponse, Error> {
    let text = document.get().cloned().ok_or(Error::Internal)?;
    Ok(([(CONTENT_TYPE, JSON)], text))
}
