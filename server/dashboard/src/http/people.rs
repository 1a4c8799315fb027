//! Finds out who is signed in, and under which account a request acts.
//!
//! Outside studies a role's link is enough. In a study everybody except the surgeon acts under a personal account:
//! [`Acting::for_session`] and [`Acting::personally`] require it.

use std::convert::Infallible;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

use axum::extract::FromRequestParts;
use axum::http::HeaderMap;
use axum::http::request::Parts;

use super::App;
use super::credentials::{ACCOUNT_COOKIE, bearer, cookie};
use super::error::Error;
use super::permits::Permit;
use parfocal_base::ids::SessionId;
use parfocal_records::accounts::Token;
use parfocal_trial::account::{Account, Actor};
use parfocal_trial::role::Role;

/// Somebody who is signed in.
#[derive(Clone)]
pub(super) struct Person {
    /// The account.
    pub(super) account: Account,
    /// The token of the sign-in.
    pub(super) token: Token,
}

/// The person who is signed in, if there is one.
pub(super) struct SignedIn(pub(super) Option<Person>);

impl<S: Sync> FromRequestParts<S> for SignedIn {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        Ok(Self(parts.extensions.get::<Person>().cloned()))
    }
}

/// The address that a request came from.
pub(super) struct PeerAddress(pub(super) IpAddr);

impl<S: Sync> FromRequestParts<S> for PeerAddress {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        let permit = parts.extensions.get::<Arc<Permit>>();
        Ok(Self(permit.map_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED), |permit| permit.host)))
    }
}

/// The token in these headers, whether or not anybody is signed in with it.
pub(super) fn token(headers: &HeaderMap) -> Option<Token> {
    let sent = |shown: Option<&str>| shown.and_then(Token::sent);
    sent(bearer(headers)).or_else(|| sent(cookie(headers, ACCOUNT_COOKIE)))
}

/// The person who made a request with these headers.
pub(super) async fn find(app: &App, headers: &HeaderMap) -> Option<Person> {
    let token = token(headers)?;
    match app.accounts.signed_in(&token).await {
        Ok(account) => account.map(|account| Person { account, token }),
        Err(error) => {
            tracing::error!("could not look up who is signed in: {error}");
            None
        }
    }
}

/// Proof that a request holds a role, and under which account.
pub(super) trait Acting {
    /// The role.
    const ROLE: Role;

    /// The account, if somebody is signed in whose account may act in this role.
    fn account(&self) -> Option<&Account>;

    /// The person who acts, for actions that need no more than a role's link.
    fn actor(&self) -> Actor {
        Actor { role: Self::ROLE, account: self.account().map(|account| account.account.clone()) }
    }

    /// The account, for actions for which a role's link is not enough.
    fn personally(&self) -> Result<&Account, Error> {
        self.account().ok_or(Error::NeedsAccount(Self::ROLE))
    }

    /// The person who acts on `session`. If it belongs to a study, the person must be signed in.
    async fn for_session(&self, app: &App, session: SessionId) -> Result<Actor, Error> {
        if app.conductor.study_of(session).await?.is_some() {
            self.personally()?;
        }
        Ok(self.actor())
    }
}

/// The account, if it is that of a lead.
pub(super) fn lead(by: &impl Acting) -> Result<&Account, Error> {
    let account = by.personally()?;
    if account.role.leads() {
        return Ok(account);
    }
    Err(Error::Forbidden(format!(
        "Only a lead may do this; you are signed in as {}, {}. Ask a lead of the study.",
        account.display, account.role
    )))
}

/// The account of a lead who has confirmed with the passphrase, as needed for actions that affect everybody.
pub(super) async fn confirmed_lead<'a>(
    app: &App,
    by: &'a impl Acting,
    passphrase: Option<&str>,
    peer: IpAddr,
) -> Result<&'a Account, Error> {
    let account = lead(by)?;
    let missing = || Error::Invalid("Give your own passphrase once more (passphrase).".to_owned());
    let passphrase = passphrase.filter(|passphrase| !passphrase.is_empty()).ok_or_else(missing)?;
    app.accounts.confirm(account, passphrase, peer).await?;
    Ok(account)
}
