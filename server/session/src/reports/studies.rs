//! Reports on studies for the pages and the command line. They contain no order.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use crate::conductor::{ConductError, ProtocolSummary, Studies, outstanding_sessions, plan_concerns};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_records::store::{Reader, RunClocks, StoreError, StoredStudy};
use parfocal_trial::allocation::Order;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::study::definition::{PlaceRules, Site};
use parfocal_trial::study::event::StudyEvent;
use parfocal_trial::study::lists::commitment_line;
use parfocal_trial::study::places::Enrolled;
use parfocal_trial::study::stage::Stage;

/// A study in a list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyLine {
    /// Name of the study.
    pub study: String,
    /// Title of the study.
    pub title: String,
    /// Stage of the study, from planned to unblinded.
    pub stage: Stage,
    /// Number of sessions made in it.
    pub sessions: usize,
    /// Number of surgeons planned at the sites that this database runs.
    pub surgeons: usize,
}

/// A study in detail.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyDetail {
    /// The study's line in the list.
    #[serde(flatten)]
    pub line: StudyLine,
    /// SHA-256 of the definition: the same at every site.
    pub definition_sha256: String,
    /// The definition, byte for byte.
    pub definition: String,
    /// How sessions are ordered, the same as in each protocol.
    pub order: Order,
    /// The study's protocols.
    pub protocols: Vec<StudyProtocol>,
    /// The study's sites.
    pub sites: Vec<SiteDetail>,
    /// Rules for the place of an aborted or withdrawn session.
    pub rules: PlaceRules,
    /// What to do when a list is used up.
    pub when_used_up: String,
    /// Names of the people who may unblind the whole study.
    pub may_unblind: Vec<String>,
    /// The planned analysis.
    pub analysis: String,
    /// The line to print, publish or mail before the first session; none until the orders are drawn.
    pub commitment_line: Option<String>,
    /// Concerns about the plan, in sentences; empty once the study is open.
    pub concerns: Vec<String>,
    /// Number of sessions for which a surgeon's device may still hold something that would not count after locking. 0
    /// unless the study is closed.
    pub outstanding: usize,
    /// The study's sessions, in the order in which they were made.
    pub study_sessions: Vec<Enrolled>,
    /// The study's events, oldest first.
    pub log: Vec<StudyLogLine>,
}

/// A protocol of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyProtocol {
    /// Name of the protocol.
    pub name: String,
    /// SHA-256 of the protocol's text.
    pub sha256: String,
}

/// A site of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct SiteDetail {
    /// The site as planned.
    #[serde(flatten)]
    pub site: Site,
    /// Whether this database runs the site.
    pub here: bool,
    /// Number of sessions made at the site.
    pub sessions: usize,
}

/// An event of a study in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyLogLine {
    /// When it happened, by the wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// How the event was recorded: by a role, or on the command line.
    pub by: &'static str,
    /// Name of the person, as given in the signature.
    pub person: String,
    /// What happened.
    pub text: String,
    /// Reason for the change.
    pub reason: String,
}

impl StudyLogLine {
    /// What happened, and why. An erased reason leaves only what happened.
    pub fn in_words(&self) -> String {
        if self.reason.is_empty() { self.text.clone() } else { format!("{}: {}", self.text, self.reason) }
    }
}

/// A study that accepts new sessions now, for the operator to choose. Says nothing of its policies.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct OpenStudy {
    /// Name of the study.
    pub study: String,
    /// Title of the study.
    pub title: String,
    /// Names of the sites that this database runs.
    pub sites: Vec<String>,
    /// The study's protocols, as they were when it was planned.
    pub protocols: Vec<ProtocolSummary>,
}

impl StudyLine {
    /// All studies, in the order in which they were planned.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn all(studies: &Studies) -> Result<Vec<Self>, ConductError> {
        let mut lines = Vec::new();
        for name in studies.reader().study_names().await? {
            lines.push(line(&studies.stored(&name).await?));
        }
        Ok(lines)
    }
}

impl OpenStudy {
    /// The studies that accept new sessions now.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn all(studies: &Studies) -> Result<Vec<Self>, ConductError> {
        let open = studies.taking_sessions().await?;
        let summary = |study: StoredStudy| Self {
            study: study.definition.name.as_str().to_owned(),
            title: study.definition.title.clone(),
            protocols: study.definition.protocols.iter().map(ProtocolSummary::of).collect(),
            sites: study.sites,
        };
        Ok(open.into_iter().map(summary).collect())
    }
}

fn line(study: &StoredStudy) -> StudyLine {
    let here = study.definition.sites.iter().filter(|site| study.sites.contains(&site.name));
    StudyLine {
        study: study.definition.name.as_str().to_owned(),
        title: study.definition.title.clone(),
        stage: study.state().stage,
        sessions: study.sessions.len(),
        surgeons: here.map(|site| site.surgeons).sum(),
    }
}

impl StudyDetail {
    /// Study `name` in detail.
    ///
    /// # Errors
    /// If there is no such study, or the database failed.
    #[boxed]
    pub async fn read(studies: &Studies, name: &str) -> Result<Self, ConductError> {
        let study = studies.stored(name).await?;
        Ok(Self::of(&study, studies.reader(), |clocks| studies.now(clocks)).await?)
    }

    /// The details of `study`. `now` tells the present time by the clocks of the server's runs.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn of(
        study: &StoredStudy,
        reader: &Reader,
        now: impl FnOnce(&RunClocks) -> Timestamp,
    ) -> Result<Self, StoreError> {
        let definition = &study.definition;
        let line = line(study);
        let definition_sha256 = definition.sha256();
        let commitment = study.state().commitment;

        let concerns = match line.stage {
            Stage::Planned => plan_concerns(reader, study).await?,
            _ => Vec::new(),
        };
        let outstanding = match line.stage {
            Stage::Closed => outstanding_sessions(reader, study, now).await?,
            _ => 0,
        };

        let protocol =
            |protocol: &Protocol| StudyProtocol { name: protocol.name.clone(), sha256: hex::encode(protocol.sha256()) };
        let site = |site: &Site| SiteDetail {
            here: study.sites.contains(&site.name),
            sessions: study.sessions.iter().filter(|session| session.site == site.name).count(),
            site: site.clone(),
        };

        Ok(Self {
            commitment_line: commitment.map(|orders| commitment_line(&line.study, &definition_sha256, &orders)),
            definition: definition.source.to_string(),
            definition_sha256,
            order: definition.order,
            protocols: definition.protocols.iter().map(protocol).collect(),
            sites: definition.sites.iter().map(site).collect(),
            rules: definition.rules,
            when_used_up: definition.when_used_up.clone(),
            may_unblind: definition.may_unblind.clone(),
            analysis: definition.analysis.clone(),
            concerns,
            outstanding,
            study_sessions: study.sessions.clone(),
            log: log(study),
            line,
        })
    }
}

fn log(study: &StoredStudy) -> Vec<StudyLogLine> {
    let participant = |session: SessionId| {
        let enrolled = study.sessions.iter().find(|enrolled| enrolled.session == session);
        enrolled.map_or_else(|| "an unknown session".to_owned(), |enrolled| enrolled.surgeon().to_owned())
    };
    let line = |event: &StudyEvent| StudyLogLine {
        at: event.wall,
        by: event.way.name(),
        person: event.signature.person.clone(),
        text: event.kind.in_words(participant),
        reason: event.signature.reason.clone(),
    };
    study.events.iter().map(line).collect()
}
