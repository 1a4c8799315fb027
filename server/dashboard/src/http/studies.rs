//! The researcher's pages of studies, and their requests: plan, open, close, lock, unblind, withdrawals.

use askama::Template;
use axum::Json;
use axum::extract::{Path, State};
use axum::response::Html;
use serde::Deserialize;
use utoipa::ToSchema;

use super::error::Error;
use super::json::JsonBody;
use super::people::{Acting, PeerAddress, SignedIn, confirmed_lead};
use super::roles::Researcher;
use super::security::Nonce;
use super::{AppState, now};
use parfocal_session::reports::{StudyDetail, StudyLine};
use parfocal_trial::account::Account;
use parfocal_trial::allocation::Order;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::role::Role;
use parfocal_trial::study::definition::{Repetition, Replacement};
use parfocal_trial::study::places::Enrolled;
use parfocal_trial::study::signature::{Channel, Signature};
use parfocal_trial::study::stage::Stage;
use parfocal_trial::study::state::Change;

#[derive(Template)]
#[template(path = "studies.html")]
struct ListPage {
    nonce: String,
    /// The account that is signed in, if any.
    person: Option<Account>,
    has_accounts: bool,
    studies: Vec<StudyLine>,
    /// A definition to start from; none without a protocol for studies.
    template: Option<String>,
}

impl ListPage {
    const fn now(&self) -> &'static str {
        now::on_studies(self.has_accounts, self.person.is_some())
    }
}

/// The list of studies, and a form to plan one.
#[utoipa::path(get, path = "/researcher/studies", tag = "researcher",
    responses((status = 200, description = "The page", content_type = "text/html")))]
pub(super) async fn studies_page(
    _: Researcher,
    SignedIn(person): SignedIn,
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
) -> Result<Html<String>, Error> {
    let studies = StudyLine::all(app.conductor.studies()).await?;
    let person = person.map(|person| person.account);
    let has_accounts = !app.accounts.all().await?.is_empty();
    let lead = person.as_ref().map_or("Dr Lead", |account| account.display.as_str());
    let template = app.library.study_template(lead);
    ListPage { nonce, person, has_accounts, studies, template }.render().map(Html).map_err(|_| Error::Internal)
}

#[derive(Template)]
#[template(path = "study.html")]
struct StudyPage {
    nonce: String,
    /// The account that is signed in, if any.
    person: Option<Account>,
    chain: String,
    detail: StudyDetail,
}

impl StudyPage {
    /// Whether the reader is a lead, who may lock and unblind.
    fn leads(&self) -> bool {
        self.person.as_ref().is_some_and(|account| account.role.leads())
    }

    /// Whether the reader may change the study.
    fn may_change(&self) -> bool {
        self.person.as_ref().is_some_and(|account| account.role.may_act_as(Role::Researcher, true))
    }

    fn now(&self) -> &'static str {
        now::on_study(self.detail.line.stage, self.leads())
    }

    /// The stage's name, for the page's script.
    const fn stage(&self) -> &'static str {
        self.detail.line.stage.name()
    }

    /// The stage in words.
    const fn stage_words(&self) -> &'static str {
        match self.detail.line.stage {
            Stage::Planned => "Planned. Opening it draws the orders; then sessions can be made.",
            Stage::Open => "Open. The operator can make sessions in it.",
            Stage::Closed => "Closed. No sessions can be made. It can be opened again, or locked permanently.",
            Stage::Locked => "Locked. Nothing can be changed. It can be unblinded.",
            Stage::Unblinded => "Unblinded. Each session shows which policy ran in which setting.",
        }
    }

    const fn may_open(&self) -> bool {
        matches!(self.detail.line.stage, Stage::Planned | Stage::Closed)
    }

    const fn may_withdraw(&self) -> bool {
        matches!(self.detail.line.stage, Stage::Open | Stage::Closed)
    }

    /// Whether there is a session to export.
    fn may_export(&self) -> bool {
        self.detail.study_sessions.iter().any(|session| !session.withdrawn)
    }

    const fn order(&self) -> &'static str {
        match self.detail.order {
            Order::Balanced => "balanced, in sets",
            Order::Shuffled => "shuffled, each session by itself",
        }
    }
}

/// What happens to the place of an aborted or withdrawn session, in words.
pub(super) const fn replacement(rule: Replacement) -> &'static str {
    match rule {
        Replacement::Keep => "its place stays used; nobody is added",
        Replacement::SamePlace => "the next session takes its place and order",
        Replacement::NextSpare => "its place stays used; a spare place opens",
    }
}

/// What happens if a surgeon comes for a second session, in words.
pub(super) const fn repetition(rule: Repetition) -> &'static str {
    match rule {
        Repetition::Refuse => "refused",
        Repetition::NextSpare => "takes the next place; a spare place opens",
    }
}

/// Where a change of a study was made. The person, who may be a lead, an operator or a researcher, is named beside it.
pub(super) fn channel(by: &str) -> &'static str {
    if by == Channel::CommandLine.name() { "by a command" } else { "on a page" }
}

/// The state of a session, in words.
pub(super) const fn session_state(session: &Enrolled) -> &'static str {
    match session.status {
        SessionStatus::UnderWay => "under way",
        SessionStatus::Completed => "completed",
        SessionStatus::Aborted => "aborted",
    }
}

/// One study.
#[utoipa::path(get, path = "/researcher/studies/{study}", tag = "researcher",
    params(("study" = String, Path)), responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 404, description = "No such study")))]
pub(super) async fn study_page(
    by: Researcher,
    SignedIn(person): SignedIn,
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
    Path(name): Path<String>,
) -> Result<Html<String>, Error> {
    by.personally()?;
    let person = person.map(|person| person.account);
    let detail = StudyDetail::read(app.conductor.studies(), &name).await?;
    let chain = super::researcher::chain_words(&app).await;
    StudyPage { nonce, person, chain, detail }.render().map(Html).map_err(|_| Error::Internal)
}

/// The studies, in the order in which they were planned.
#[utoipa::path(get, path = "/api/researcher/studies", tag = "researcher",
    responses((status = 200, body = Vec<StudyLine>)))]
pub(super) async fn list_studies(_: Researcher, State(app): State<AppState>) -> Result<Json<Vec<StudyLine>>, Error> {
    Ok(Json(StudyLine::all(app.conductor.studies()).await?))
}

/// One study in detail, without the orders.
#[utoipa::path(get, path = "/api/researcher/studies/{study}", tag = "researcher",
    params(("study" = String, Path)), responses(
    (status = 200, body = StudyDetail), (status = 404, description = "No such study")))]
pub(super) async fn study(
    by: Researcher,
    State(app): State<AppState>,
    Path(name): Path<String>,
) -> Result<Json<StudyDetail>, Error> {
    by.personally()?;
    Ok(Json(StudyDetail::read(app.conductor.studies(), &name).await?))
}

/// A study to plan.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct PlanStudy {
    /// The definition in TOML, as docs/study.md describes it.
    definition: String,
    /// The sites of the study that this database runs; all sites if none are named.
    #[serde(default)]
    sites: Vec<String>,
    /// The reason, which is signed.
    #[schema(pattern = r"\S")]
    reason: String,
}

/// Plans a study.
#[utoipa::path(post, path = "/api/researcher/studies", tag = "researcher", request_body = PlanStudy, responses(
    (status = 200, body = StudyDetail),
    (status = 409, description = "A study of this name exists"),
    (status = 422, description = "The definition is malformed, or a reason is missing")))]
pub(super) async fn plan_study(
    by: Researcher,
    State(app): State<AppState>,
    JsonBody(plan): JsonBody<PlanStudy>,
) -> Result<Json<StudyDetail>, Error> {
    let PlanStudy { definition, sites, reason } = plan;
    let signature = Signature::of_account(by.personally()?, &reason)?;
    let name = app.conductor.plan_study(Role::Researcher, definition, sites, signature).await?;
    Ok(Json(StudyDetail::read(app.conductor.studies(), name.as_str()).await?))
}

/// A signed change of a study.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct ChangeStudy {
    /// The change.
    #[serde(flatten)]
    change: Change,
    /// The passphrase of the lead who is signed in, entered again: needed to lock and to unblind.
    #[serde(default)]
    #[schema(min_length = 1)]
    passphrase: Option<String>,
    /// The reason, which is signed.
    #[schema(pattern = r"\S")]
    reason: String,
}

/// Opens, closes, locks or unblinds a study, or records that a surgeon withdrew.
#[utoipa::path(post, path = "/api/researcher/studies/{study}/changes", tag = "researcher",
    params(("study" = String, Path)), request_body = ChangeStudy, responses(
    (status = 200, body = StudyDetail),
    (status = 403, description = "Nobody with the right is signed in, the passphrase is wrong, or the study lets \
                                  other people unblind"),
    (status = 429, description = "Too many attempts failed"),
    (status = 404, description = "No such study"),
    (status = 409, description = "The change does not fit the stage of the study"),
    (status = 422, description = "A reason or the passphrase is missing, or the reason names a policy")))]
pub(super) async fn change_study(
    by: Researcher,
    State(app): State<AppState>,
    Path(name): Path<String>,
    PeerAddress(peer): PeerAddress,
    JsonBody(wanted): JsonBody<ChangeStudy>,
) -> Result<Json<StudyDetail>, Error> {
    let account = match wanted.change {
        Change::Lock { .. } | Change::Unblind => confirmed_lead(&app, &by, wanted.passphrase.as_deref(), peer).await?,
        Change::Open { .. } | Change::Close | Change::Withdraw { .. } => by.personally()?,
    };
    let signature = Signature::of_account(account, &wanted.reason)?;
    app.conductor.change_study(Role::Researcher, name.clone(), wanted.change, signature).await?;
    Ok(Json(StudyDetail::read(app.conductor.studies(), &name).await?))
}
