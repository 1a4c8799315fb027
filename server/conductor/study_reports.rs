//! What the pages and the command line read of studies. No order is in it.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::studies::Studies;
use super::{ConductError, Conductor, ProtocolSummary};
use crate::ids::SessionId;
use crate::store::StoredStudy;
use crate::trial::allocation::Order;
use crate::trial::phase::SessionStatus;
use crate::trial::protocol::Protocol;
use crate::trial::study::definition::{PlaceRules, Site};
use crate::trial::study::event::StudyEvent;
use crate::trial::study::lists::commitment_line;
use crate::trial::study::places::Enrolled;
use crate::trial::study::stage::Stage;

/// A study in a list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyLine {
    /// Its name.
    pub study: String,
    /// Its title.
    pub title: String,
    /// How far it has come.
    pub stage: Stage,
    /// Sessions that were made in it.
    pub sessions: usize,
    /// Surgeons planned at the sites that this database runs.
    pub surgeons: usize,
}

/// A study in detail.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyDetail {
    /// Its line in the list.
    #[serde(flatten)]
    pub line: StudyLine,
    /// SHA-256 of its definition: the same at every site.
    pub definition_sha256: String,
    /// Its definition, byte for byte.
    pub definition: String,
    /// How its sessions are ordered.
    pub order: Order,
    /// Its protocols.
    pub protocols: Vec<StudyProtocol>,
    /// Its sites.
    pub sites: Vec<SiteDetail>,
    /// What becomes of places whose session does not stand.
    pub rules: PlaceRules,
    /// What to do when a list is used up.
    pub when_used_up: String,
    /// Who may unblind all of it.
    pub may_unblind: Vec<String>,
    /// How it will be analysed.
    pub analysis: String,
    /// The line to print, publish or mail before the first session; none before the orders were drawn.
    pub commitment_line: Option<String>,
    /// While it is closed: sessions for which a surgeon's device may still hold something that locking would keep from
    /// counting.
    pub outstanding: usize,
    /// Its sessions, in the order in which they were made.
    pub study_sessions: Vec<StudySession>,
    /// What happened to it, oldest first.
    pub log: Vec<StudyLogLine>,
}

/// A protocol of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyProtocol {
    /// Its name.
    pub name: String,
    /// SHA-256 of its text.
    pub sha256: String,
}

/// A site of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct SiteDetail {
    /// As it is planned.
    #[serde(flatten)]
    pub site: Site,
    /// Whether this database runs it.
    pub here: bool,
    /// Sessions that were made there.
    pub sessions: usize,
}

/// A session of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudySession {
    /// The session.
    pub session: SessionId,
    /// Participant's code.
    pub participant: String,
    /// The right code, where it was corrected.
    pub corrected_participant: Option<String>,
    /// Its site.
    pub site: String,
    /// Its protocol.
    pub protocol: String,
    /// Its place in the list of both, from 1.
    pub place: usize,
    /// How far it came.
    pub status: SessionStatus,
    /// Whether it was told which policies ran.
    pub unblinded: bool,
    /// Whether its surgeon withdrew.
    pub withdrawn: bool,
}

/// An event of a study in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct StudyLogLine {
    /// When, by the wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// By which way: a role, or the command line.
    pub by: &'static str,
    /// Who, as the person said.
    pub person: String,
    /// What happened.
    pub text: String,
    /// Why.
    pub reason: String,
}

/// A study that takes sessions now, for the operator to choose. Says nothing of its policies.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct OpenStudy {
    /// Its name.
    pub study: String,
    /// Its title.
    pub title: String,
    /// The names of its sites that this database runs.
    pub sites: Vec<String>,
    /// Its protocols, as they were when it was planned.
    pub protocols: Vec<ProtocolSummary>,
}

impl Studies {
    /// All studies, in the order in which they were planned.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn lines(&self) -> Result<Vec<StudyLine>, ConductError> {
        let mut lines = Vec::new();
        for name in self.reader().study_names().await? {
            lines.push(line(&self.stored(&name).await?));
        }
        Ok(lines)
    }

    /// Study `name` in detail.
    ///
    /// # Errors
    /// When there is none, or the database failed.
    pub async fn detail(&self, name: &str) -> Result<StudyDetail, ConductError> {
        let study = self.stored(name).await?;
        let mut detail = StudyDetail::of(&study);
        if detail.line.stage == Stage::Closed {
            detail.outstanding = self.outstanding(&study).await?;
        }
        Ok(detail)
    }
}

impl Conductor {
    /// The studies that take sessions now.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn open_studies(&self) -> Result<Vec<OpenStudy>, ConductError> {
        let open = self.shared.studies.taking_sessions().await?;
        let summary = |study: StoredStudy| OpenStudy {
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
    /// That of `study`, without what may be outstanding.
    #[must_use]
    pub fn of(study: &StoredStudy) -> Self {
        let definition = &study.definition;
        let line = line(study);
        let definition_sha256 = definition.sha256();
        let commitment = study.state().commitment;

        let protocol =
            |protocol: &Protocol| StudyProtocol { name: protocol.name.clone(), sha256: hex::encode(protocol.sha256()) };
        let site = |site: &Site| SiteDetail {
            here: study.sites.contains(&site.name),
            sessions: study.sessions.iter().filter(|session| session.site == site.name).count(),
            site: site.clone(),
        };

        Self {
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
            outstanding: 0,
            study_sessions: sessions(study),
            log: log(study),
            line,
        }
    }
}

fn sessions(study: &StoredStudy) -> Vec<StudySession> {
    let session = |enrolled: &Enrolled| StudySession {
        session: enrolled.session,
        participant: enrolled.participant.clone(),
        corrected_participant: enrolled.corrected_participant.clone(),
        site: enrolled.site.clone(),
        protocol: enrolled.protocol.clone(),
        place: enrolled.place,
        status: enrolled.status,
        unblinded: enrolled.unblinded,
        withdrawn: enrolled.withdrawn,
    };
    study.sessions.iter().map(session).collect()
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
