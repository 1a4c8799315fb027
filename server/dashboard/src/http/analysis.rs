//! The analysis of an unblinded study: a printable page, JSON, and a ZIP file. Each access is recorded.

use askama::Template;
use axum::Json;
use axum::extract::{Path, State};
use axum::response::{Html, Response};
use jiff::Timestamp;

use super::AppState;
use super::error::Error;
use super::export::zip_download;
use super::people::Acting;
use super::roles::Researcher;
use parfocal_records::store::Access;
use parfocal_results::analysis::{
    Analysis, AnalysisError, Comparison, PolicySummary, ProtocolAnalysis, SettingWords, SiteAnalysis, SurgeonWords,
    analyse, check, decimals, p_words,
};
use parfocal_session::reports::StudyDetail;

impl From<AnalysisError> for Error {
    fn from(error: AnalysisError) -> Self {
        let text = error.to_string();
        match error {
            AnalysisError::NoStudy { .. } => Self::NotFound(text),
            AnalysisError::Refused(_) => Self::Conflict(text),
            AnalysisError::Export(error) => error.into(),
            AnalysisError::Store(_) => Self::Storage(text),
        }
    }
}

/// Records that the analysis of `study` is viewed, then returns it.
async fn looked_at(app: &AppState, by: &Researcher, study: &str) -> Result<Analysis, Error> {
    by.personally()?;
    let reader = app.store.reader();
    // A refused request is not recorded.
    check(reader, study).await?;
    app.settle().await;
    let access = Access::AnalysisViewed { study: study.to_owned() };
    app.access_log(by.actor()).record(&access).await?;
    Ok(analyse(reader, study).await?)
}

#[derive(Template)]
#[template(path = "analysis.html")]
struct AnalysisPage {
    analysis: Analysis,
    /// When this page was made.
    made: Timestamp,
    /// The head of the chain, which covers every record that the analysis has read.
    chain: String,
    /// The version of parfocal that made this page.
    version: &'static str,
    /// The line that commits to all orders.
    commitment: Option<String>,
}

impl AnalysisPage {
    /// When this page was made, in words and local time.
    fn made(&self) -> String {
        super::researcher::day_and_time(&self.made)
    }

    /// When the study was unblinded, in words and local time.
    fn unblinded(&self) -> String {
        super::researcher::day_and_time(&self.analysis.unblinded)
    }
}

/// What a surgeon said in the settings of one policy or, without one, outside all settings.
fn said_of<'a>(surgeon: &'a SurgeonWords, policy: Option<&str>) -> Vec<&'a SettingWords> {
    surgeon.settings.iter().filter(|setting| setting.policy.as_deref() == policy).collect()
}

/// A number for a table, with three decimals; a dash if there is none.
fn number(value: Option<&f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| decimals(*value, 3))
}

/// The p over all policies for a table: that of Friedman's permutation test, or for two policies of Wilcoxon's test.
fn p_of_all(compared: &Comparison) -> String {
    let friedman = compared.difference.friedman.as_ref().map(|friedman| friedman.p_permutation);
    let only_pair = match compared.pairs.as_slice() {
        [pair] => Some(pair.p),
        _ => None,
    };
    friedman.or(only_pair).map_or_else(|| "–".to_owned(), |p| p_words(p).replace("p = ", "").replace("p < ", "< "))
}

/// Kendall's W for a table; a dash if there is none.
fn w_of(compared: &Comparison) -> String {
    let w = compared.difference.friedman.as_ref().map(|friedman| friedman.kendalls_w);
    w.map_or_else(|| "–".to_owned(), |w| decimals(w, 2))
}

/// The summaries of each policy at `site` for the outcome of `compared`.
fn at_site<'a>(site: &'a SiteAnalysis, compared: &Comparison) -> &'a [PolicySummary] {
    let own = site.outcomes.iter().find(|own| own.outcome.outcome == compared.outcome.outcome);
    own.map_or(&[], |own| &own.policies)
}

/// The sessions of a protocol that have a remark, for example why they do not count.
fn remarked(protocol: &ProtocolAnalysis) -> Vec<&parfocal_results::analysis::AnalysedSession> {
    protocol.sessions.iter().filter(|session| session.remark.is_some()).collect()
}

/// The analysis of a study, with its figures; it prints well.
#[utoipa::path(get, path = "/researcher/studies/{study}/analysis", tag = "researcher",
    params(("study" = String, Path)), responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 404, description = "No such study"),
    (status = 409, description = "The study is not unblinded")))]
pub(super) async fn analysis_page(
    by: Researcher,
    State(app): State<AppState>,
    Path(study): Path<String>,
) -> Result<Html<String>, Error> {
    let analysis = looked_at(&app, &by, &study).await?;
    let made = app.clock.wall();
    let chain = super::researcher::chain_words(&app).await;
    let commitment = StudyDetail::read(app.conductor.studies(), &study).await?.commitment_line;
    let version = env!("CARGO_PKG_VERSION");
    AnalysisPage { analysis, made, chain, version, commitment }.render().map(Html).map_err(|_| Error::Internal)
}

/// The analysis of a study. Each access is recorded.
#[utoipa::path(get, path = "/api/researcher/studies/{study}/analysis", tag = "researcher",
    params(("study" = String, Path)), responses(
    (status = 200, body = Analysis),
    (status = 404, description = "No such study"),
    (status = 409, description = "The study is not unblinded")))]
pub(super) async fn analysis(
    by: Researcher,
    State(app): State<AppState>,
    Path(study): Path<String>,
) -> Result<Json<Analysis>, Error> {
    Ok(Json(looked_at(&app, &by, &study).await?))
}

/// The same as one ZIP file: tables with their data dictionary, figures, JSON, checksums.
#[utoipa::path(get, path = "/api/researcher/studies/{study}/analysis.zip", tag = "researcher",
    params(("study" = String, Path)), responses(
    (status = 200, description = "The file", content_type = "application/zip"),
    (status = 404, description = "No such study"),
    (status = 409, description = "The study is not unblinded")))]
pub(super) async fn analysis_zip(
    by: Researcher,
    State(app): State<AppState>,
    Path(study): Path<String>,
) -> Result<Response, Error> {
    let analysis = looked_at(&app, &by, &study).await?;
    Ok(zip_download(Analysis::folder_name(&study), async move |zip| analysis.into_zip(zip).await))
}
