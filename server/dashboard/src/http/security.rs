//! Security of every request and response: security headers with a nonce per response, no requests from other sites,
//! no host names except our own.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{FromRequestParts, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, HOST, HeaderName, HeaderValue, ORIGIN, REFERRER_POLICY, UPGRADE,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::AppState;
use super::error::Error;
use super::people;
use super::permits::Permit;

/// The header that says which features of the device a page may use.
pub const PERMISSIONS_POLICY: HeaderName = HeaderName::from_static("permissions-policy");

/// Value of that header for the surgeon's page if the protocol asks for voice.
pub const WITH_MICROPHONE: HeaderValue =
    HeaderValue::from_static("camera=(), display-capture=(), geolocation=(), microphone=(self)");

/// The nonce that inline scripts and styles of this response must carry.
#[derive(Debug, Clone)]
pub struct Nonce(pub String);

impl<S: Sync> FromRequestParts<S> for Nonce {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Error> {
        parts.extensions.get::<Self>().cloned().ok_or(Error::Internal)
    }
}

/// Makes the nonce, and adds the headers that restrict a page to our own scripts, styles and resources.
pub async fn headers(mut request: Request, next: Next) -> Response {
    let mut bytes = [0; 16];
    if getrandom::fill(&mut bytes).is_err() {
        return Error::Internal.into_response();
    }

    let nonce = hex::encode(bytes);
    request.extensions_mut().insert(Nonce(nonce.clone()));
    let plays_sound = request.uri().path().starts_with(PLAYS_SOUND);
    let opens_offline = request.uri().path() == OPENS_OFFLINE;
    let mut response = next.run(request).await;

    let headers = response.headers_mut();
    if let Ok(policy) = HeaderValue::from_str(&content_security_policy(&nonce, plays_sound, opens_offline)) {
        headers.insert(CONTENT_SECURITY_POLICY, policy);
    }

    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    // We send no Strict-Transport-Security. With it, a device that has forgotten the local authority, or a new one on
    // which somebody skipped the warning, could no longer open the page that explains how to trust the server. Cookies
    // are Secure instead.
    headers.insert(HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static("same-origin"));
    headers.entry(PERMISSIONS_POLICY).or_insert(HeaderValue::from_static(PERMISSIONS));
    headers.entry(CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));

    response
}

/// Beginning of the path of the researcher's page of a session, the only page that plays sound.
const PLAYS_SOUND: &str = "/researcher/sessions/";

/// Path of the surgeon's page, the only page that a service worker keeps.
const OPENS_OFFLINE: &str = "/surgeon";

/// The features of the device that a page may not use. The surgeon's page may use the microphone if the protocol asks
/// for voice.
const PERMISSIONS: &str = "camera=(), display-capture=(), geolocation=(), microphone=()";

fn content_security_policy(nonce: &str, plays_sound: bool, opens_offline: bool) -> String {
    let media = if plays_sound { "media-src 'self'; " } else { "" };
    let worker = if opens_offline { "'self'" } else { "'none'" };
    format!(
        "default-src 'none'; script-src 'self' 'nonce-{nonce}'; style-src 'self' 'nonce-{nonce}'; \
         img-src 'self' blob: data:; font-src 'self'; connect-src 'self'; manifest-src 'self'; \
         {media}worker-src {worker}; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    )
}

/// Gives the connection a member's permit if the request shows a key or a sign-in. Rejects requests from other
/// sites and, on a loopback server, host names that are not this machine's own. A site whose name is made to point
/// here (DNS rebinding) has no role's cookie anyway, and does not even get the page that says so.
pub async fn guard(State(app): State<AppState>, mut request: Request, next: Next) -> Response {
    let person = people::find(&app, request.headers()).await;
    let headers = request.headers();
    let host = headers.get(HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    if app.address.loopback_only() && !is_loopback_name(host) {
        return Error::WrongHost.into_response();
    }

    let permit = request.extensions().get::<Arc<Permit>>();
    if permit.is_some_and(|permit| permit.admit(headers, &app.keys, person.is_some()).is_err()) {
        return Error::Busy.into_response();
    }

    let changes = !matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    if (changes || headers.contains_key(UPGRADE)) && !is_same_origin(headers, host, app.address.encrypted()) {
        return Error::CrossSite.into_response();
    }
    if let Some(person) = person {
        request.extensions_mut().insert(person);
    }

    next.run(request).await
}

/// Judges by `Sec-Fetch-Site` and `Origin`, whichever the browser sends. A client that sends
/// neither is not a browser, so it has no cookies that another site could misuse.
///
/// A page that was loaded unencrypted may have been changed on the way, so an `encrypted` server refuses its requests.
/// A server that does not encrypt itself accepts `https` origins too, because it may be behind a proxy that encrypts.
fn is_same_origin(headers: &HeaderMap, host: &str, encrypted: bool) -> bool {
    let site_fits = headers.get("sec-fetch-site").is_none_or(|site| site == "same-origin");
    let origin_fits = headers.get(ORIGIN).is_none_or(|origin| {
        let origin = origin.to_str().unwrap_or_default();
        let plain = origin.strip_prefix("http://").filter(|_| !encrypted);
        let authority = plain.or_else(|| origin.strip_prefix("https://"));
        authority.is_some_and(|authority| authority.eq_ignore_ascii_case(host))
    });

    site_fits && origin_fits
}

/// Whether `host`, with or without a port, is one of this machine's own names.
pub fn is_loopback_name(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loopback_names_are_recognised() {
        for ours in ["localhost", "LocalHost:8080", "127.0.0.1:8080", "127.1.2.3", "[::1]:8080", "[::1]"] {
            assert!(is_loopback_name(ours), "{ours}");
        }
        for other in
            ["", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example:80", "10.0.0.1", "[fe80::1]"]
        {
            assert!(!is_loopback_name(other), "{other}");
        }
    }

    #[test]
    fn origin_and_fetch_metadata_must_both_fit() {
        let verdict = |pairs: &[(&'static str, &'static str)]| {
            let mut headers = HeaderMap::new();
            for (name, value) in pairs {
                headers.insert(*name, HeaderValue::from_static(value));
            }
            is_same_origin(&headers, "localhost:8080", false)
        };

        assert!(verdict(&[]));
        assert!(verdict(&[("origin", "http://localhost:8080"), ("sec-fetch-site", "same-origin")]));
        assert!(!verdict(&[("origin", "http://localhost:8081")]));
        assert!(!verdict(&[("origin", "null")]));
        assert!(!verdict(&[("sec-fetch-site", "cross-site")]));
        assert!(!verdict(&[("sec-fetch-site", "same-site")]));
        assert!(!verdict(&[("origin", "http://localhost:8080"), ("sec-fetch-site", "cross-site")]));
    }

    #[test]
    fn a_page_that_came_unencrypted_may_ask_nothing_of_an_encrypted_server() {
        let verdict = |origin| {
            let headers = HeaderMap::from_iter([(ORIGIN, HeaderValue::from_static(origin))]);
            [false, true].map(|encrypted| is_same_origin(&headers, "10.0.0.5:8080", encrypted))
        };

        assert_eq!(verdict("http://10.0.0.5:8080"), [true, false]);
        assert_eq!(verdict("https://10.0.0.5:8080"), [true, true]);
    }
}
