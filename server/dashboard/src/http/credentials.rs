//! The credentials in a request's headers: a role's cookie or key, the surgeon's link to one session, an account's
//! token.

use axum::http::HeaderMap;
use axum::http::header::{AUTHORIZATION, COOKIE};
use cookie::time::Duration;
use cookie::{Cookie, SameSite};
use sha2::{Digest, Sha256};

use super::keys::Keys;
use parfocal_base::ids::SessionId;
use parfocal_trial::role::Role;

/// The cookie of a browser that is signed in under a personal account. It outlives the sign-in, so that its pages are
/// asked to sign in again.
pub(super) const ACCOUNT_COOKIE: &str = "parfocal-account";

/// Lifetime of each cookie: it outlives a study day, but not a study.
const COOKIE_LIFETIME: Duration = Duration::days(30);

/// Whether a request with these headers holds `role`, by its cookie or its bearer token.
pub(super) fn holds(headers: &HeaderMap, keys: &Keys, role: Role) -> bool {
    if role == Role::Surgeon {
        return pass(headers, keys).is_some();
    }
    cookie(headers, cookie_name(role)).is_some_and(|token| keys.opens(role, token))
        || bearer(headers).is_some_and(|key| keys.role_of(key) == Some(role))
}

/// The link by which a tablet acts as the surgeon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pass {
    /// The link of the role, for sessions outside studies.
    Shared,
    /// The link to one session of a study.
    Session(SessionId),
}

/// The surgeon's link that a request with these headers holds, even if its session has ended.
pub(super) fn pass(headers: &HeaderMap, keys: &Keys) -> Option<Pass> {
    let by_cookie = cookie(headers, cookie_name(Role::Surgeon)).and_then(|token| {
        let shared = keys.opens(Role::Surgeon, token).then_some(Pass::Shared);
        shared.or_else(|| keys.session_of_token(token).map(Pass::Session))
    });
    by_cookie.or_else(|| {
        let key = bearer(headers)?;
        let shared = (keys.role_of(key) == Some(Role::Surgeon)).then_some(Pass::Shared);
        shared.or_else(|| keys.session_of(key).map(Pass::Session))
    })
}

/// A name for the link of `pass`. It grants no access, and is different for each link.
pub(super) fn link_name(pass: Pass, keys: &Keys) -> String {
    let token = match pass {
        Pass::Shared => keys.token(Role::Surgeon),
        Pass::Session(session) => keys.session_token(session),
    };
    let digest = Sha256::new().chain_update(b"parfocal link 1:").chain_update(token).finalize();
    hex::encode(&digest[..8])
}

/// Name of the cookie for `role`.
pub(super) const fn cookie_name(role: Role) -> &'static str {
    match role {
        Role::Surgeon => "parfocal-surgeon",
        Role::Operator => "parfocal-operator",
        Role::Researcher => "parfocal-researcher",
        Role::System => "parfocal-none",
    }
}

/// The header that sets cookie `name`. Browsers send it only with this site's own requests, and if the server is
/// `encrypted` only over TLS.
pub(super) fn set_cookie(name: &str, value: &str, encrypted: bool) -> String {
    let cookie =
        Cookie::build((name, value)).path("/").max_age(COOKIE_LIFETIME).http_only(true).same_site(SameSite::Strict);
    let cookie = if encrypted { cookie.secure(true) } else { cookie };
    cookie.to_string()
}

pub(super) fn cookie<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let sent = headers.get_all(COOKIE).iter().filter_map(|header| header.to_str().ok());
    let mut cookies = sent.flat_map(Cookie::split_parse).filter_map(Result::ok);
    cookies.find(|cookie| cookie.name() == name)?.value_raw()
}

pub(super) fn bearer(headers: &HeaderMap) -> Option<&str> {
    // Programs may write the scheme in any case (RFC 9110, 11.1).
    let (scheme, token) = headers.get(AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then_some(token)
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    #[test]
    fn a_key_is_read_whatever_the_case_of_its_scheme() {
        let key_in = |value: &'static str| {
            let headers = HeaderMap::from_iter([(AUTHORIZATION, HeaderValue::from_static(value))]);
            bearer(&headers).map(str::to_owned)
        };
        assert_eq!(key_in("Bearer 0f"), Some("0f".to_owned()));
        assert_eq!(key_in("bearer 0f"), Some("0f".to_owned()));
        assert_eq!((key_in("Basic 0f"), key_in("Bearer")), (None, None));
    }
}
