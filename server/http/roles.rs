//! Roles: who a request speaks for, and the links that let a browser in.
//!
//! A role is shown by its cookie, or by its key as a bearer token (programs). One cookie a role, so that one laptop can
//! be operator and researcher at a time. Nothing else shows a role: where a request comes from tells only which proxy
//! handed it on.

use std::sync::Arc;

use axum::extract::{FromRequestParts, Query, State};
use axum::http::HeaderMap;
use axum::http::header::{AUTHORIZATION, COOKIE, SET_COOKIE};
use axum::http::request::Parts;
use axum::response::{AppendHeaders, IntoResponse, Redirect};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::error::{Error, role_name};
use super::keys::{Keys, ROLES};
use super::{App, AppState};
use crate::store::Access;
use crate::trial::role::Role;

/// A cookie outlives a study day, not a study.
const COOKIE_SECONDS: u32 = 30 * 24 * 3600;

/// Proof that the request speaks for the surgeon.
#[derive(Debug, Clone, Copy)]
pub struct Surgeon;

/// Proof that the request speaks for the operator.
#[derive(Debug, Clone, Copy)]
pub struct Operator;

/// Proof that the request speaks for the researcher.
#[derive(Debug, Clone, Copy)]
pub struct Researcher;

/// The roles that the request speaks for, at least one.
#[derive(Debug, Clone)]
pub struct Roles(Vec<Role>);

impl Roles {
    /// `wanted` if it is held; without a wish, the one that may see least.
    ///
    /// # Errors
    /// When `wanted` is not held.
    pub fn choose(&self, wanted: Option<Role>) -> Result<Role, Error> {
        match wanted {
            Some(role) if self.0.contains(&role) => Ok(role),
            Some(role) => Err(Error::NeedsRole(role)),
            None => self.0.first().copied().ok_or(Error::NoRole),
        }
    }
}

macro_rules! proof {
    ($proof:ident) => {
        impl FromRequestParts<AppState> for $proof {
            type Rejection = Error;

            async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, Error> {
                if holds(&parts.headers, &app.keys, Role::$proof) {
                    Ok(Self)
                } else {
                    Err(Error::NeedsRole(Role::$proof))
                }
            }
        }
    };
}

proof!(Surgeon);
proof!(Operator);
proof!(Researcher);

impl FromRequestParts<AppState> for Roles {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, Error> {
        let held: Vec<_> = ROLES.into_iter().filter(|role| holds(&parts.headers, &app.keys, *role)).collect();
        if held.is_empty() { Err(Error::NoRole) } else { Ok(Self(held)) }
    }
}

/// Whether a request with these headers speaks for `role`: by its cookie or its bearer token.
pub(super) fn holds(headers: &HeaderMap, keys: &Keys, role: Role) -> bool {
    cookie(headers, cookie_name(role)).is_some_and(|token| keys.opens(role, token))
        || bearer(headers).is_some_and(|key| keys.role_of(key) == Some(role))
}

/// The cookie that shows `role`.
pub(super) const fn cookie_name(role: Role) -> &'static str {
    match role {
        Role::Surgeon => "parfocal-surgeon",
        Role::Operator => "parfocal-operator",
        Role::Researcher => "parfocal-researcher",
        Role::System => "parfocal-none",
    }
}

fn cookie<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let cookies = headers.get_all(COOKIE).iter().filter_map(|header| header.to_str().ok());
    cookies.flat_map(|header| header.split(';')).find_map(|pair| pair.trim().strip_prefix(name)?.strip_prefix('='))
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    headers.get(AUTHORIZATION)?.to_str().ok()?.strip_prefix("Bearer ")
}

/// The page of `role`.
#[must_use]
pub const fn home(role: Role) -> &'static str {
    match role {
        Role::Surgeon => "/surgeon",
        Role::Operator => "/operator",
        Role::Researcher => "/researcher",
        Role::System => "/",
    }
}

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct EnterQuery {
    /// The role's key.
    key: String,
}

/// Lets a browser in: takes the key of a role's link, sets the role's cookie and goes to the role's page.
#[utoipa::path(get, path = "/enter", params(EnterQuery), tag = "roles", responses(
    (status = 303, description = "Let in: the role's cookie, and on to its page"),
    (status = 403, description = "Not a key of this server", body = super::error::ErrorBody)))]
async fn enter(State(app): State<AppState>, Query(query): Query<EnterQuery>) -> Result<impl IntoResponse, Error> {
    let role = app.keys.role_of(query.key.trim()).ok_or(Error::WrongKey)?;
    let cookie = format!(
        "{}={}; Path=/; Max-Age={COOKIE_SECONDS}; HttpOnly; SameSite=Strict",
        cookie_name(role),
        app.keys.token(role)
    );

    // The door opens on a full disk, too: the log then tells of it alone.
    match app.conductor.recorder(role).record(&Access::Entered).await {
        Ok(_) => tracing::info!(role = role_name(role), "a browser was let in"),
        Err(error) => {
            tracing::error!(role = role_name(role), "a browser was let in and could not be recorded: {error}");
        }
    }
    Ok((AppendHeaders([(SET_COOKIE, cookie)]), Redirect::to(home(role))))
}

/// The start page: on to the page of the role that the browser holds.
#[utoipa::path(get, path = "/", tag = "roles", responses(
    (status = 303, description = "On to the role's page"),
    (status = 403, description = "No role is held", body = super::error::ErrorBody)))]
async fn start(Roles(held): Roles) -> Redirect {
    // Whoever holds more than one role works here rather than being a subject of the trial.
    Redirect::to(home(held.into_iter().find(|role| *role != Role::Surgeon).unwrap_or(Role::Surgeon)))
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(enter)).routes(routes!(start))
}
