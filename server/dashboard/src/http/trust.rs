//! Helps a tablet or laptop to trust the server's local authority, and checks whether it does. Open to everyone, and
//! also served unencrypted: a device that does not trust the server yet must be able to read it. All of it is public.

use askama::Template;
use axum::extract::State;
use axum::http::header::{ACCESS_CONTROL_ALLOW_ORIGIN, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{Html, IntoResponse};
use uuid::Uuid;

use super::error::Error;
use super::links::asked_host;
use super::security::Nonce;
use super::{App, AppState};
use crate::tls::PublicAuthority;

#[derive(Template)]
#[template(path = "trust.html")]
struct Page<'a> {
    nonce: String,
    /// Scheme and host of the encrypted pages.
    encrypted: String,
    /// The authority's name, as devices show it.
    name: &'a str,
    fingerprint: &'a str,
}

/// An Apple configuration profile that contains the authority.
#[derive(Template)]
#[template(path = "trust.mobileconfig.xml")]
struct Profile<'a> {
    name: &'a str,
    /// The certificate, DER in base 64.
    certificate: String,
    /// Identifiers of the profile and (`content_id`) of its content. They are the same each time, so that a device
    /// installs the authority only once.
    own_id: Uuid,
    content_id: Uuid,
}

fn authority(app: &App) -> Result<&PublicAuthority, Error> {
    app.address.authority().ok_or_else(|| {
        let why = if app.address.encrypted() {
            "the site's own authority signed this server's certificate"
        } else {
            "this server does not encrypt; start it with --tls"
        };
        Error::NotFound(format!("There is no local authority to trust: {why}."))
    })
}

/// The page that explains how to trust the server on this device.
#[utoipa::path(get, path = "/trust", tag = "trust", responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 404, description = "The server has no local authority")))]
pub(super) async fn page(
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
    headers: HeaderMap,
) -> Result<Html<String>, Error> {
    let authority = authority(&app)?;
    let host = asked_host(&headers).map_or_else(|| app.address.host(), str::to_owned);
    let page = Page {
        nonce,
        encrypted: format!("https://{host}"),
        name: &authority.name,
        fingerprint: &authority.fingerprint,
    };
    page.render().map(Html).map_err(|_| Error::Internal)
}

/// The authority's certificate, PEM.
#[utoipa::path(get, path = "/trust/authority.crt", tag = "trust", responses(
    (status = 200, description = "The certificate", content_type = "application/x-x509-ca-cert"),
    (status = 404, description = "The server has no local authority")))]
pub(super) async fn certificate(State(app): State<AppState>) -> Result<impl IntoResponse, Error> {
    let authority = authority(&app)?;
    let headers = [
        (CONTENT_TYPE, "application/x-x509-ca-cert"),
        (CONTENT_DISPOSITION, "attachment; filename=\"parfocal-authority.crt\""),
    ];
    Ok((headers, authority.pem.clone()))
}

/// The authority as a profile for Apple's devices.
#[utoipa::path(get, path = "/trust/authority.mobileconfig", tag = "trust", responses(
    (status = 200, description = "The profile", content_type = "application/x-apple-aspen-config"),
    (status = 404, description = "The server has no local authority")))]
pub(super) async fn profile(State(app): State<AppState>) -> Result<impl IntoResponse, Error> {
    let authority = authority(&app)?;
    let [own_id, content_id] = [0, 16].map(|from| identifier(&authority.digest[from..from + 16]));
    let body = Profile { name: &authority.name, certificate: base64_of(&authority.pem), own_id, content_id };

    let headers = [
        (CONTENT_TYPE, "application/x-apple-aspen-config"),
        (CONTENT_DISPOSITION, "attachment; filename=\"parfocal-authority.mobileconfig\""),
    ];
    Ok((headers, body.render().map_err(|_| Error::Internal)?))
}

/// Requested over TLS by the trust page, which was loaded unencrypted: a device that gets the answer trusts the server.
#[utoipa::path(get, path = "/trust/check", tag = "trust", responses(
    (status = 204, description = "The connection works; the answer is empty")))]
pub(super) async fn check() -> impl IntoResponse {
    // While the page is not encrypted, it has another origin.
    (StatusCode::NO_CONTENT, [(ACCESS_CONTROL_ALLOW_ORIGIN, "*")])
}

/// An identifier made from 16 bytes of a digest (RFC 9562, version 8).
fn identifier(digest: &[u8]) -> Uuid {
    let bytes = digest.try_into().unwrap_or_default();
    uuid::Builder::from_custom_bytes(bytes).into_uuid()
}

/// The lines of `pem` between its first and last: DER in base 64.
fn base64_of(pem: &str) -> String {
    pem.lines().filter(|line| !line.starts_with("-----")).collect()
}
