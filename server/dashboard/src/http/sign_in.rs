//! Signing in and out under a personal account.

use askama::Template;
use axum::Json;
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::http::header::SET_COOKIE;
use axum::response::{AppendHeaders, Html, IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::AppState;
use super::credentials::{ACCOUNT_COOKIE, set_cookie};
use super::error::Error;
use super::json::JsonBody;
use super::people::{PeerAddress, SignedIn};
use super::roles::home;
use super::security::Nonce;
use parfocal_records::accounts::Passphrase;
use parfocal_trial::account::{Account, AccountRole};
use parfocal_trial::role::Role;

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct SignInQuery {
    /// Path of the page to open after signing in.
    next: Option<String>,
}

#[derive(Template)]
#[template(path = "sign_in.html")]
struct Page {
    nonce: String,
    /// Path of the page to open after signing in; empty for the page of the account's role.
    next: String,
    /// The account that is signed in now, if any.
    person: Option<Account>,
}

/// The page to sign in.
#[utoipa::path(get, path = "/sign-in", params(SignInQuery), tag = "accounts", responses(
    (status = 200, description = "The page", content_type = "text/html")))]
pub(super) async fn page(
    Query(query): Query<SignInQuery>,
    SignedIn(person): SignedIn,
    Nonce(nonce): Nonce,
) -> Result<Html<String>, Error> {
    let next = query.next.filter(|path| is_own_path(path)).unwrap_or_default();
    let person = person.map(|person| person.account);
    Page { nonce, next, person }.render().map(Html).map_err(|_| Error::Internal)
}

/// Whether `path` leads to a page of this server: a link must not send somebody to another site after signing in.
fn is_own_path(path: &str) -> bool {
    // Browsers read a backslash as a slash, and drop tabs and line breaks: `/<tab>/host` is another site to them.
    path.starts_with('/') && !path.starts_with("//") && !path.contains(|c: char| c == '\\' || c.is_control())
}

/// A request to sign in.
#[derive(Deserialize, ToSchema)]
pub(super) struct SignIn {
    /// The account's name.
    name: String,
    /// The account's passphrase.
    passphrase: String,
    /// A new passphrase that replaces it: needed if a lead set the current one.
    #[serde(default)]
    new_passphrase: Option<String>,
    /// Whether the answer contains the token, for a program, instead of setting a cookie.
    #[serde(default)]
    as_bearer: bool,
}

/// The answer after signing in.
#[derive(Serialize, ToSchema)]
struct SignedInAs {
    /// The account.
    #[serde(flatten)]
    account: Account,
    /// The page of the account's role.
    home: &'static str,
    /// The token, to be sent as `Authorization: Bearer`, if it was asked for.
    token: Option<String>,
}

/// Signs in. The answer takes longer after failed attempts.
#[utoipa::path(post, path = "/api/sign-in", tag = "accounts", request_body = SignIn, responses(
    (status = 200, description = "Signed in: a cookie, or a token if the request asked for it", body = SignedInAs),
    (status = 403, description = "The name or passphrase is wrong, the account is disabled, or another site made \
                                  the request"),
    (status = 409, description = "A lead set this passphrase; the person has to choose another"),
    (status = 422, description = "The new passphrase is too short, or the same as before"),
    (status = 429, description = "Too many attempts failed"),
    (status = 507, description = "The disk failed")))]
pub(super) async fn sign_in(
    State(app): State<AppState>,
    PeerAddress(peer): PeerAddress,
    JsonBody(wanted): JsonBody<SignIn>,
) -> Result<Response, Error> {
    let chosen = wanted.new_passphrase.as_deref().map(Passphrase::new).transpose()?;
    let (account, token) = app.accounts.sign_in(&wanted.name, &wanted.passphrase, chosen, peer).await?;
    // The log names nobody; the database records who it was.
    tracing::info!(role = page_role(account.role).name(), "somebody signed in");

    let home = home(page_role(account.role));
    if wanted.as_bearer {
        let token = Some(token.as_str().to_owned());
        return Ok(Json(SignedInAs { account, home, token }).into_response());
    }
    let cookie = set_cookie(ACCOUNT_COOKIE, token.as_str(), app.address.encrypted());
    Ok((AppendHeaders([(SET_COOKIE, cookie)]), Json(SignedInAs { account, home, token: None })).into_response())
}

/// Signs out: the token is no longer valid. Signing out again changes nothing.
#[utoipa::path(post, path = "/api/sign-out", tag = "accounts", responses(
    (status = 204, description = "Signed out"),
    (status = 507, description = "The disk failed")))]
pub(super) async fn sign_out(
    State(app): State<AppState>,
    SignedIn(person): SignedIn,
) -> Result<impl IntoResponse, Error> {
    if let Some(person) = person {
        app.accounts.sign_out(&person.token).await?;
    }
    // Without a token, but not removed: the browser's other pages are asked to sign in again.
    let cookie = set_cookie(ACCOUNT_COOKIE, "", app.address.encrypted());
    Ok((StatusCode::NO_CONTENT, AppendHeaders([(SET_COOKIE, cookie)])))
}

/// The role whose page an account opens first, by the account's role.
pub(super) const fn page_role(role: AccountRole) -> Role {
    match role {
        AccountRole::Operator => Role::Operator,
        AccountRole::Lead | AccountRole::Researcher | AccountRole::Monitor => Role::Researcher,
    }
}

#[cfg(test)]
mod tests {
    use super::is_own_path;

    #[test]
    fn a_sign_in_leads_only_to_a_path_of_this_server() {
        assert!(is_own_path("/researcher/studies/scope-2026"));
        for elsewhere in
            ["", "researcher", "//evil.example", "https://evil.example", "/\\evil.example", "/\t/evil.example"]
        {
            assert!(!is_own_path(elsewhere), "{elsewhere}");
        }
    }
}
