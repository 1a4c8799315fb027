//! The researcher's pages: the list of sessions, one session with its time line, unblinding.

use std::collections::BTreeMap;

use askama::Template;
use axum::Json;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::Html;
use jiff::Timestamp;
use jiff::tz::TimeZone;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::error::Error;
use super::json::JsonBody;
use super::people::{Acting, PeerAddress, SignedIn, confirmed_lead};
use super::roles::{Researcher, Roles};
use super::security::Nonce;
use super::{AppState, now};
use parfocal_base::PolicyName;
use parfocal_base::ids::SessionId;
use parfocal_records::store::{Access, SessionLine};
use parfocal_session::conductor::ConductError;
use parfocal_session::reports::{AnswerLine, SessionDetail, Timeline};
use parfocal_trial::account::Account;
use parfocal_trial::action::Action;
use parfocal_trial::instruments::Measure;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::refusal::RefusalKind;
use parfocal_trial::role::Role;
use parfocal_trial::study::signature::Signature;

/// Points of the focal path per setting: about as many as there are pixels to draw them.
const POINTS: u32 = 600;

/// When a session was made, in local time.
pub(super) fn made(line: &SessionLine) -> String {
    local(&line.created, "%Y-%m-%d %H:%M")
}

/// Whether any of `lines` belongs to a study.
pub(super) fn in_studies(lines: &[SessionLine]) -> bool {
    lines.iter().any(|line| line.study.is_some())
}

/// State and progress of a session, in words.
pub(super) fn state(line: &SessionLine) -> String {
    match line.status {
        SessionStatus::UnderWay => format!("under way, {} of {} settings", line.finished_settings, line.settings),
        SessionStatus::Completed => "completed".to_owned(),
        SessionStatus::Aborted => format!("aborted after {} of {} settings", line.finished_settings, line.settings),
    }
}

pub(super) fn local(at: &Timestamp, format: &str) -> String {
    at.to_zoned(TimeZone::system()).strftime(format).to_string()
}

#[derive(Template)]
#[template(path = "researcher.html")]
struct ListPage {
    nonce: String,
    /// The account that is signed in, if any.
    person: Option<Account>,
    chain: String,
    sessions: Vec<SessionLine>,
    practice: Vec<SessionLine>,
}

impl ListPage {
    fn now(&self) -> &'static str {
        let under_way = self.sessions.iter().any(|line| line.status == SessionStatus::UnderWay);
        now::on_sessions(!self.sessions.is_empty(), under_way)
    }
}

/// The list of sessions, with practice sessions listed separately.
#[utoipa::path(get, path = "/researcher", tag = "researcher",
    responses((status = 200, description = "The page", content_type = "text/html")))]
pub(super) async fn list_page(
    _: Researcher,
    SignedIn(person): SignedIn,
    Nonce(nonce): Nonce,
    State(app): State<AppState>,
) -> Result<Html<String>, Error> {
    let lines = app.store.reader().sessions(true).await?;
    let (practice, sessions) = lines.into_iter().partition(|line| line.practice);
    let chain = chain_words(&app).await;
    let person = person.map(|person| person.account);
    ListPage { nonce, person, chain, sessions, practice }.render().map(Html).map_err(|_| Error::Internal)
}

#[derive(Template)]
#[template(path = "session.html")]
struct SessionPage {
    nonce: String,
    /// The account that is signed in, if any.
    person: Option<Account>,
    chain: String,
    detail: SessionDetail,
    /// Questions after a setting that are not answered in words, each with its answer in every setting.
    questions: Vec<QuestionRow>,
    /// Questions after a setting that are answered in words, which do not fit into a column.
    written: Vec<QuestionRow>,
    closing: Vec<AnswerLine>,
    /// Codes of all participants, to choose from when the session's participant is corrected.
    participants: Vec<String>,
}

/// A question with its answer in each setting.
struct QuestionRow {
    text: String,
    answers: Vec<Option<AnswerLine>>,
    /// Whether the answers are words.
    written: bool,
}

impl QuestionRow {
    /// The settings in which the question was answered, from 1, each with the answer.
    fn given(&self) -> impl Iterator<Item = (usize, &AnswerLine)> {
        (1..).zip(&self.answers).filter_map(|(setting, answer)| Some((setting, answer.as_ref()?)))
    }
}

impl SessionPage {
    fn new(
        nonce: String,
        person: Option<Account>,
        chain: String,
        detail: SessionDetail,
        participants: Vec<String>,
    ) -> Self {
        let (asked, closing): (Vec<_>, _) = detail.answers.iter().cloned().partition(|answer| answer.setting.is_some());
        let all = questions(&asked, detail.settings_detail.len());
        let (written, questions) = all.into_iter().partition(|question| question.written);
        Self { nonce, person, chain, detail, questions, written, closing, participants }
    }

    /// The policy of `setting` (from 1); `None` until the session is unblinded.
    fn policy(&self, setting: usize) -> Option<&PolicyName> {
        self.detail.unblinding.as_ref()?.policies.get(setting.wrapping_sub(1))
    }

    fn now(&self) -> &'static str {
        let line = &self.detail.line;
        now::on_session(now::Session {
            status: line.status,
            withdrawn: line.withdrawn,
            unblinded: line.unblinded,
            study_locked: line.study.as_ref().map(|_| self.detail.study_locked),
        })
    }

    /// Whether there are answers that can be corrected. A surgeon's own words cannot.
    fn has_correctable_answers(&self) -> bool {
        let line = &self.detail.line;
        !line.withdrawn && self.detail.answers.iter().any(|answer| !matches!(answer.value, AnswerValue::Text(_)))
    }

    fn ended(&self) -> bool {
        self.detail.line.status != SessionStatus::UnderWay
    }
}

/// One row per question, in the order of the first answers.
fn questions(answers: &[AnswerLine], settings: usize) -> Vec<QuestionRow> {
    let mut places = BTreeMap::new();
    let mut rows: Vec<QuestionRow> = Vec::new();

    for answer in answers {
        let place = *places.entry(&answer.question).or_insert_with(|| {
            let written = matches!(answer.value, AnswerValue::Text(_));
            rows.push(QuestionRow { text: answer.text.clone(), answers: vec![None; settings], written });
            rows.len() - 1
        });

        let cell = answer.setting.and_then(|setting| rows[place].answers.get_mut(setting.wrapping_sub(1)));
        if let Some(cell) = cell {
            *cell = Some(answer.clone());
        }
    }

    rows
}

/// A score's name and value, rounded to one decimal.
pub(super) fn score_words(score: &Measure) -> String {
    let value = score.value.map_or_else(|| "–".to_owned(), |value| tenths(value).to_string());
    format!("{} {value}", score.label)
}

fn tenths(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

/// An answer for a table cell: its scores if it has any, otherwise the answer itself.
pub(super) fn cell(answer: &AnswerLine) -> String {
    if answer.scores.is_empty() {
        return answer.words.clone();
    }
    answer.scores.iter().map(score_words).collect::<Vec<_>>().join(", ")
}

/// When something happened, in words and local time.
pub(super) fn day_and_time(at: &Timestamp) -> String {
    local(at, "%Y-%m-%d at %H:%M")
}

/// One session.
#[utoipa::path(get, path = "/researcher/sessions/{session}", tag = "researcher",
    params(("session" = SessionId, Path)), responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 404, description = "No such session")))]
pub(super) async fn session_page(
    by: Researcher,
    SignedIn(person): SignedIn,
    State(app): State<AppState>,
    Nonce(nonce): Nonce,
    Path(id): Path<SessionId>,
) -> Result<Html<String>, Error> {
    by.for_session(&app, id).await?;
    let detail = app.reports.session_detail(id).await.map_err(|error| match error {
        ConductError::NotFound(_) | ConductError::Said(RefusalKind::Unknown, _) => {
            Error::NotFound("There is no such session here.".to_owned())
        }
        error => error.into(),
    })?;

    let participants = app.store.reader().participants().await?;
    let chain = chain_words(&app).await;
    let person = person.map(|person| person.account);
    SessionPage::new(nonce, person, chain, detail, participants).render().map(Html).map_err(|_| Error::Internal)
}

/// The sessions, newest first, including practice sessions, which are marked.
#[utoipa::path(get, path = "/api/researcher/sessions", tag = "researcher",
    responses((status = 200, body = Vec<SessionLine>)))]
pub(super) async fn list(_: Researcher, State(app): State<AppState>) -> Result<Json<Vec<SessionLine>>, Error> {
    Ok(Json(app.store.reader().sessions(true).await?))
}

/// One session in detail; with its policies once it is unblinded.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}", tag = "researcher",
    params(("session" = SessionId, Path)), responses(
    (status = 200, body = SessionDetail), (status = 404, description = "No such session")))]
pub(super) async fn session(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
) -> Result<Json<SessionDetail>, Error> {
    by.for_session(&app, id).await?;
    Ok(Json(app.reports.session_detail(id).await?))
}

/// One session over time, without its focal path.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}/course", tag = "researcher",
    params(("session" = SessionId, Path)), responses(
    (status = 200, body = Timeline), (status = 404, description = "No such session"),
    (status = 409, description = "The participant withdrew")))]
pub(super) async fn course(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
) -> Result<Json<Timeline>, Error> {
    let by = by.for_session(&app, id).await?;
    let timeline = app.reports.timeline(by.role, id, POINTS).await?;
    Ok(Json(Timeline { points: Vec::new(), ..timeline }))
}

/// One session over time with its focal path. The path may tell policies apart, so each access is recorded.
#[utoipa::path(get, path = "/api/researcher/sessions/{session}/timeline", tag = "researcher",
    params(("session" = SessionId, Path)), responses(
    (status = 200, body = Timeline), (status = 404, description = "No such session"),
    (status = 409, description = "The participant withdrew")))]
pub(super) async fn timeline(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
) -> Result<Json<Timeline>, Error> {
    let by = by.for_session(&app, id).await?;
    let timeline = app.reports.timeline(Role::Researcher, id, POINTS).await?;
    app.access_log(by).record(&Access::PathViewed(id)).await?;
    Ok(Json(timeline))
}

/// The latest row of the chain of records.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ChainHead {
    /// Its number, from 1.
    number: i64,
    /// Its hash: SHA-256, hexadecimal.
    hash: String,
    /// Number and hash as the pages show them, for `parfocal verify --head`.
    head: String,
}

/// The head of the chain. A note of it can later prove that nothing recorded before it was changed.
#[utoipa::path(get, path = "/api/chain/head", tag = "service", responses(
    (status = 200, body = ChainHead),
    (status = 403, description = "For operator and researcher")))]
pub(super) async fn chain_head(roles: Roles, State(app): State<AppState>) -> Result<Json<ChainHead>, Error> {
    roles.choose(Some(Role::Operator)).or_else(|_| roles.choose(Some(Role::Researcher)))?;
    let head = app.store.reader().head().await?;
    Ok(Json(ChainHead { number: head.number, head: head.to_string(), hash: head.hash }))
}

/// The chain's head as the pages show it, or the error in words: a page also opens if the head cannot be read.
pub(super) async fn chain_words(app: &AppState) -> String {
    app.store.reader().head().await.map_or_else(|error| format!("cannot be read: {error}"), |head| head.to_string())
}

/// A request to unblind a session.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct Unblind {
    /// Why; stored in the audit trail.
    #[schema(pattern = r"\S")]
    reason: String,
    /// Whether to unblind even though something may be outstanding, which would then no longer count.
    #[serde(default)]
    despite_outstanding: bool,
    /// The passphrase of the lead who is signed in, entered again: needed for a session of a study.
    #[serde(default)]
    #[schema(min_length = 1)]
    passphrase: Option<String>,
}

/// Unblinds a session. If it is still under way, or belongs to a study that is still blinded, this is emergency
/// unblinding and permanently marked as such.
#[utoipa::path(post, path = "/api/researcher/sessions/{session}/unblind", tag = "researcher",
    params(("session" = SessionId, Path)),
    request_body = Unblind, responses(
    (status = 204, description = "Unblinded"),
    (status = 404, description = "No such session"),
    (status = 409, description = "The order would reveal that of another session of its balanced set, or \
                                  comments and answers may be outstanding"),
    (status = 422, description = "No reason was given, or no passphrase for a session of a study"),
    (status = 429, description = "Too many attempts failed")))]
pub(super) async fn unblind(
    by: Researcher,
    State(app): State<AppState>,
    Path(id): Path<SessionId>,
    PeerAddress(peer): PeerAddress,
    JsonBody(Unblind { reason, despite_outstanding, passphrase }): JsonBody<Unblind>,
) -> Result<StatusCode, Error> {
    if app.conductor.study_of(id).await?.is_some() {
        let lead = confirmed_lead(&app, &by, passphrase.as_deref(), peer).await?;
        let signature = Signature::of_account(lead, &reason)?;
        app.conductor.unblind_in_emergency(by.actor(), id, signature, despite_outstanding).await?;
    } else {
        app.conductor.act(by.actor(), id, Action::Unblind { reason, despite_outstanding }).await?;
    }
    Ok(StatusCode::NO_CONTENT)
}
