//! Roles: who a request speaks for, and the links that let a browser in.
//!
//! A role is shown by its cookie, or by its key as a bearer token (programs). One cookie a role, so that one laptop can
//! be operator and researcher at a time. On a server that listens on loopback alone, whoever sits at the machine is its
//! operator without a key.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::extract::{ConnectInfo, FromRequestParts, Query, State};
use axum::http::header::{AUTHORIZATION, COOKIE, HOST, SET_COOKIE};
use axum::http::request::Parts;
use axum::response::{AppendHeaders, IntoResponse, Redirect};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::error::{Error, role_name};
use super::keys::ROLES;
use super::security::is_loopback_name;
use super::{App, AppState};
use crate::trial::view::Role;

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
            None => self.0.first().copied().ok_or(Error::NeedsRole(Role::Surgeon)),
        }
    }
}

macro_rules! proof {
    ($proof:ident) => {
        impl FromRequestParts<AppState> for $proof {
            type Rejection = Error;

            async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, Error> {
                if holds(parts, app, Role::$proof) { Ok(Self) } else { Err(Error::NeedsRole(Role::$proof)) }
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
        let held: Vec<_> = ROLES.into_iter().filter(|role| holds(parts, app, *role)).collect();
        if held.is_empty() { Err(Error::NeedsRole(Role::Operator)) } else { Ok(Self(held)) }
    }
}

fn holds(parts: &Parts, app: &App, role: Role) -> bool {
    shows_key(parts, app, role) || (role == Role::Operator && app.loopback_only && sits_at_the_machine(parts))
}

/// By its cookie or its bearer token.
fn shows_key(parts: &Parts, app: &App, role: Role) -> bool {
    cookie(parts, cookie_name(role)).is_some_and(|token| app.keys.opens(role, token))
        || bearer(parts).is_some_and(|key| app.keys.role_of(key) == Some(role))
}

const fn cookie_name(role: Role) -> &'static str {
    match role {
        Role::Surgeon => "parfocal-surgeon",
        Role::Operator => "parfocal-operator",
        Role::Researcher => "parfocal-researcher",
        Role::System => "parfocal-none",
    }
}

fn cookie<'a>(parts: &'a Parts, name: &str) -> Option<&'a str> {
    let cookies = parts.headers.get_all(COOKIE).iter().filter_map(|header| header.to_str().ok());
    cookies.flat_map(|header| header.split(';')).find_map(|pair| pair.trim().strip_prefix(name)?.strip_prefix('='))
}

fn bearer(parts: &Parts) -> Option<&str> {
    parts.headers.get(AUTHORIZATION)?.to_str().ok()?.strip_prefix("Bearer ")
}

/// From this machine, by one of this machine's own names, and not handed on by a proxy, behind which anyone may be.
fn sits_at_the_machine(parts: &Parts) -> bool {
    let from_here = parts.extensions.get::<ConnectInfo<SocketAddr>>().is_some_and(|peer| peer.0.ip().is_loopback());
    let by_our_name = parts.headers.get(HOST).and_then(|host| host.to_str().ok()).is_some_and(is_loopback_name);
    let handed_on = ["forwarded", "x-forwarded-for", "x-real-ip"].iter().any(|name| parts.headers.contains_key(*name));
    from_here && by_our_name && !handed_on
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
    tracing::info!(role = role_name(role), "a browser was let in");
    Ok((AppendHeaders([(SET_COOKIE, cookie)]), Redirect::to(home(role))))
}

/// The start page: on to the page of the role that the browser holds.
#[utoipa::path(get, path = "/", tag = "roles", responses(
    (status = 303, description = "On to the role's page"),
    (status = 403, description = "No role is held", body = super::error::ErrorBody)))]
async fn start(roles: Roles, State(app): State<AppState>, parts: Parts) -> Redirect {
    // Whoever sits at the machine is its operator, also who was let in there by the surgeon's link: the link counts.
    let by_key: Vec<_> = roles.0.iter().copied().filter(|role| shows_key(&parts, &app, *role)).collect();
    let held = if by_key.is_empty() { roles.0 } else { by_key };
    // Whoever holds more than one role works here rather than being a subject of the trial.
    Redirect::to(home(held.into_iter().find(|role| *role != Role::Surgeon).unwrap_or(Role::Surgeon)))
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(enter)).routes(routes!(start))
}
