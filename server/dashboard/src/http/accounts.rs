//! The leads' page of personal accounts: makes them, and changes what they may do.

use askama::Template;
use axum::Json;
use axum::extract::{Path, State};
use axum::response::Html;
use jiff::Timestamp;
use serde::Deserialize;
use utoipa::ToSchema;

use super::AppState;
use super::error::Error;
use super::json::JsonBody;
use super::now;
use super::people::{PeerAddress, SignedIn, confirmed_lead, lead};
use super::researcher::local;
use super::roles::Researcher;
use super::security::Nonce;
use parfocal_records::accounts::Passphrase;
use parfocal_records::store::AccountLine;
use parfocal_trial::account::{Account, AccountChange, AccountName, AccountRole};

#[derive(Template)]
#[template(path = "accounts.html")]
struct Page {
    nonce: String,
    /// The account that is signed in, if any.
    person: Option<Account>,
    accounts: Vec<AccountLine>,
}

impl Page {
    const ROLES: [AccountRole; 4] = AccountRole::ALL;

    fn now(&self) -> &'static str {
        now::on_people(self.accounts.iter().any(|line| line.set_by_another && !line.account.disabled))
    }

    /// When somebody last signed in, in local time.
    fn last_signed_in(at: Option<&Timestamp>) -> String {
        at.map_or_else(|| "never".to_owned(), |at| local(at, "%Y-%m-%d %H:%M"))
    }

    /// What a role may do, in words.
    const fn duties(role: AccountRole) -> &'static str {
        match role {
            AccountRole::Lead => "does everything, locks, unblinds, and makes accounts",
            AccountRole::Operator => "works at the device",
            AccountRole::Researcher => "plans studies and reads their sessions",
            AccountRole::Monitor => "reads what researchers read, changes nothing",
        }
    }
}

/// The accounts, for leads.
#[utoipa::path(get, path = "/researcher/accounts", tag = "accounts", responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 403, description = "No lead is signed in")))]
pub(super) async fn people_page(
    by: Researcher,
    SignedIn(person): SignedIn,
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
) -> Result<Html<String>, Error> {
    lead(&by)?;
    let person = person.map(|person| person.account);
    let accounts = app.accounts.lines().await?;
    Page { nonce, person, accounts }.render().map(Html).map_err(|_| Error::Internal)
}

/// All accounts, by name.
#[utoipa::path(get, path = "/api/researcher/accounts", tag = "accounts", responses(
    (status = 200, body = Vec<AccountLine>),
    (status = 403, description = "No lead is signed in")))]
pub(super) async fn list(by: Researcher, State(app): State<AppState>) -> Result<Json<Vec<AccountLine>>, Error> {
    lead(&by)?;
    Ok(Json(app.accounts.lines().await?))
}

/// An account to be made.
#[derive(Deserialize, ToSchema)]
pub(super) struct NewAccount {
    /// The name that the person will sign in with: lower-case letters, digits, dots and dashes.
    account: String,
    /// The person's name, as it will appear in signatures.
    display: String,
    /// What the person may do.
    role: AccountRole,
    /// The passphrase for the person's first sign-in, where the person then chooses another.
    first_passphrase: String,
    /// The lead's own passphrase, entered again.
    passphrase: String,
}

/// Makes an account. Its person chooses another passphrase at the first sign-in.
#[utoipa::path(post, path = "/api/researcher/accounts", tag = "accounts", request_body = NewAccount, responses(
    (status = 200, body = Account),
    (status = 403, description = "No lead is signed in, or the lead's passphrase is wrong"),
    (status = 409, description = "An account of this name or display name exists"),
    (status = 422, description = "A name or passphrase is missing or malformed"),
    (status = 429, description = "Too many attempts failed")))]
pub(super) async fn make(
    by: Researcher,
    State(app): State<AppState>,
    PeerAddress(peer): PeerAddress,
    JsonBody(new): JsonBody<NewAccount>,
) -> Result<Json<Account>, Error> {
    let lead = confirmed_lead(&app, &by, Some(&new.passphrase), peer).await?;
    let name = AccountName::new(new.account.trim())?;
    let first = Passphrase::new(&new.first_passphrase)?;
    Ok(Json(app.accounts.add(name, &new.display, new.role, first, Some(&lead.account)).await?))
}

/// A change to make to an account.
#[derive(Deserialize, ToSchema)]
#[serde(tag = "change", rename_all = "kebab-case")]
#[schema(as = AccountAction)]
enum WantedChange {
    /// Gives the account another role.
    Role {
        /// The new role.
        role: AccountRole,
    },
    /// Disables the account: the person can no longer sign in, and all sign-ins end.
    Disable,
    /// Enables the account: the person can sign in again.
    Enable,
    /// Ends all sign-ins.
    SignOut,
    /// Sets a passphrase for one sign-in, where the person then chooses another. All sign-ins end.
    Passphrase {
        /// The passphrase for that sign-in.
        first_passphrase: String,
    },
}

/// A change of an account, confirmed by a lead.
#[derive(Deserialize, ToSchema)]
pub(super) struct ChangeAccount {
    /// The change.
    #[serde(flatten)]
    change: WantedChange,
    /// The lead's own passphrase, entered again.
    passphrase: String,
}

/// Changes an account.
#[utoipa::path(post, path = "/api/researcher/accounts/{account}/changes", tag = "accounts",
    params(("account" = String, Path)), request_body = ChangeAccount, responses(
    (status = 200, body = Vec<AccountLine>),
    (status = 403, description = "No lead is signed in, or the lead's passphrase is wrong"),
    (status = 404, description = "No such account"),
    (status = 409, description = "The account is of the last lead who can sign in"),
    (status = 422, description = "A passphrase is missing or malformed"),
    (status = 429, description = "Too many attempts failed")))]
pub(super) async fn change(
    by: Researcher,
    State(app): State<AppState>,
    Path(name): Path<String>,
    PeerAddress(peer): PeerAddress,
    JsonBody(wanted): JsonBody<ChangeAccount>,
) -> Result<Json<Vec<AccountLine>>, Error> {
    let lead = confirmed_lead(&app, &by, Some(&wanted.passphrase), peer).await?;
    let name = AccountName::new(&name).map_err(|_| Error::NotFound(format!("there is no account '{name}'")))?;
    let by = Some(&lead.account);

    let change = match wanted.change {
        WantedChange::Passphrase { first_passphrase } => {
            app.accounts.replace_passphrase(&name, Passphrase::new(&first_passphrase)?, by).await?;
            return Ok(Json(app.accounts.lines().await?));
        }
        WantedChange::Role { role } => AccountChange::Role(role),
        WantedChange::Disable => AccountChange::Disable,
        WantedChange::Enable => AccountChange::Enable,
        WantedChange::SignOut => AccountChange::SignOut,
    };
    app.accounts.change(&name, &change, by).await?;
    Ok(Json(app.accounts.lines().await?))
}
