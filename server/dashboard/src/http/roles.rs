//! Roles: which roles a request holds, and the links that let a browser in.
//!
//! A request proves a role by the role's cookie, or by its key as a bearer token (programs). Each role has its own
//! cookie, so one laptop can be operator and researcher at the same time. Somebody who is signed in also has the roles
//! of the account. Nothing else proves a role: the address of a request may be only that of a proxy.

use axum::extract::{FromRequestParts, Query, State};
use axum::http::header::SET_COOKIE;
use axum::http::request::Parts;
use axum::response::{AppendHeaders, IntoResponse, Redirect};
use serde::Deserialize;
use utoipa::IntoParams;

use super::AppState;
use super::admission::{Ground, admit};
use super::credentials::{Pass, cookie_name, holds, pass, set_cookie};
use super::error::{Error, role_name};
use super::keys::ROLES;
use super::people::{Acting, Person};
use parfocal_records::store::Access;
use parfocal_trial::account::Account;
use parfocal_trial::role::Role;

/// Proof that the request comes from the surgeon of the session on the screens.
#[derive(Debug, Clone, Copy)]
pub struct Surgeon;

/// Proof that the request comes from a surgeon's tablet, whichever session it was let in to: comments and answers are
/// accepted even after their session has ended.
#[derive(Debug, Clone, Copy)]
pub struct SurgeonsTablet;

/// Proof that the request holds the operator's role, with the account if somebody is signed in.
#[derive(Debug, Clone)]
pub struct Operator(Option<Account>);

/// Proof that the request holds the researcher's role, with the account if somebody is signed in.
#[derive(Debug, Clone)]
pub struct Researcher(Option<Account>);

/// Proof that the request comes from somebody who may read what researchers read. It is for requests that change no
/// records, whatever their method: monitors may make them too.
#[derive(Debug, Clone)]
pub struct ResearchReader(Option<Account>);

/// The roles that the request holds, at least one.
#[derive(Debug, Clone)]
pub struct Roles {
    held: Vec<Role>,
    /// The surgeon's link that the request holds, if any.
    pass: Option<Pass>,
    /// The roles among `held` that are proven by a link.
    by_link: Vec<Role>,
}

impl Roles {
    /// Returns `wanted` if it is held; if nothing is wanted, the held role that may see least.
    ///
    /// # Errors
    /// If `wanted` is not held.
    pub fn choose(&self, wanted: Option<Role>) -> Result<Role, Error> {
        match wanted {
            Some(role) if self.held.contains(&role) => Ok(role),
            Some(role) => Err(Error::NeedsRole(role)),
            None => self.held.first().copied().ok_or(Error::NoRole),
        }
    }

    /// The role in which the request's person is here: somebody who holds more than the surgeon's works here, and is not
    /// a participant of the trial.
    pub(super) fn own(&self) -> Role {
        self.held.iter().copied().find(|role| *role != Role::Surgeon).unwrap_or(Role::Surgeon)
    }

    /// What lets a page stay that is served as `role`, one of those held; `None` if it may stay as long as it likes.
    /// `person` is who is signed in.
    pub(super) fn ground(&self, role: Role, person: Option<Person>) -> Option<Ground> {
        if role == Role::Surgeon {
            return self.pass.map(Ground::Link);
        }
        let person = person.filter(|_| !self.by_link.contains(&role))?;
        Some(Ground::SignIn(person.token, role))
    }
}

impl FromRequestParts<AppState> for Surgeon {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, Error> {
        let pass = pass(&parts.headers, &app.keys).ok_or(Error::NeedsRole(Role::Surgeon))?;
        admit(app, pass).map(|()| Self)
    }
}

impl FromRequestParts<AppState> for SurgeonsTablet {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, Error> {
        pass(&parts.headers, &app.keys).map(|_| Self).ok_or(Error::NeedsRole(Role::Surgeon))
    }
}

/// The account of a request, if somebody is signed in whose account may act as `role` and, if the request `changes`
/// records, may change them.
fn account_as(parts: &Parts, role: Role, changes: bool) -> Option<Account> {
    let person = parts.extensions.get::<Person>()?;
    person.account.role.may_act_as(role, changes).then(|| person.account.clone())
}

/// The proof that a request holds a role, by an account that may act as that role or by the role's key. `$changes`: an
/// account must be one that may change records, if the request's method does.
macro_rules! proof {
    ($proof:ident, $role:expr, $changes:literal) => {
        impl FromRequestParts<AppState> for $proof {
            type Rejection = Error;

            async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, Error> {
                let account = account_as(parts, $role, $changes && !parts.method.is_safe());
                if account.is_some() || holds(&parts.headers, &app.keys, $role) {
                    Ok(Self(account))
                } else {
                    Err(Error::NeedsRole($role))
                }
            }
        }

        impl Acting for $proof {
            const ROLE: Role = $role;

            fn account(&self) -> Option<&Account> {
                self.0.as_ref()
            }
        }
    };
}

proof!(Operator, Role::Operator, true);
proof!(Researcher, Role::Researcher, true);
proof!(ResearchReader, Role::Researcher, false);

impl FromRequestParts<AppState> for Roles {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, Error> {
        let pass = pass(&parts.headers, &app.keys);
        let admitted = pass.map_or(Err(Error::NoRole), |pass| admit(app, pass));
        let shown = |role: &Role| match role {
            Role::Surgeon => admitted.is_ok(),
            role => {
                holds(&parts.headers, &app.keys, *role) || account_as(parts, *role, !parts.method.is_safe()).is_some()
            }
        };
        let held: Vec<_> = ROLES.into_iter().filter(shown).collect();
        match admitted {
            Err(error) if held.is_empty() => Err(error),
            _ => {
                let by_link = held.iter().copied().filter(|role| holds(&parts.headers, &app.keys, *role)).collect();
                Ok(Self { held, pass, by_link })
            }
        }
    }
}

/// Path of the page of `role`.
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
pub(super) struct EnterQuery {
    /// The role's key.
    key: String,
}

/// Lets a browser in: takes the key of a role's link, sets the role's cookie and goes to the role's page.
#[utoipa::path(get, path = "/enter", params(EnterQuery), tag = "roles", responses(
    (status = 303, description = "The role's cookie, and a redirect to its page"),
    (status = 403, description = "The key is not of this server, or its session has ended")))]
pub(super) async fn enter(
    State(app): State<AppState>,
    Query(query): Query<EnterQuery>,
) -> Result<impl IntoResponse, Error> {
    let key = query.key.trim();
    let (role, token) = match (app.keys.role_of(key), app.keys.session_of(key)) {
        (Some(role), _) => (role, app.keys.token(role)),
        (None, Some(session)) if app.session_goes_on(session) => (Role::Surgeon, app.keys.session_token(session)),
        (None, Some(_)) => return Err(Error::SessionOver),
        (None, None) => return Err(Error::WrongKey),
    };
    let cookie = set_cookie(cookie_name(role), &token, app.address.encrypted());

    // A browser is let in even if the disk is full. Then only the log records it.
    match app.access_log(role).record(&Access::Entered).await {
        Ok(_) => tracing::info!(role = role_name(role), "a browser was let in"),
        Err(error) => {
            tracing::error!(role = role_name(role), "a browser was let in and could not be recorded: {error}");
        }
    }
    Ok((AppendHeaders([(SET_COOKIE, cookie)]), Redirect::to(home(role))))
}

/// The start page: redirects to the page of the role that the browser holds.
#[utoipa::path(get, path = "/", tag = "roles", responses(
    (status = 303, description = "Redirect to the role's page"),
    (status = 403, description = "No role is held")))]
pub(super) async fn start(roles: Roles) -> Redirect {
    Redirect::to(home(roles.own()))
}
