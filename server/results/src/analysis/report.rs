//! The analysis of a study as it is shown: on the page, as JSON, in tables.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::comparison::Comparison;
use super::outcomes::{Outcome, Value};
use super::statistics::Summary;
use parfocal_base::ids::SessionId;

/// The analysis of an unblinded study.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Analysis {
    /// Name of the study.
    pub study: String,
    /// Title of the study.
    pub title: String,
    /// SHA-256 of the study's definition.
    pub definition_sha256: String,
    /// The planned analysis, as in the definition.
    pub planned: String,
    /// When the study was unblinded, by the server's wall clock.
    #[schema(value_type = String)]
    pub unblinded: Timestamp,
    /// Names of the study's sites that this database, or the databases of this package, run.
    pub sites: Vec<String>,
    /// Names of the definition's sites that have no session in this analysis.
    pub missing_sites: Vec<String>,
    /// Seed of resamples and permutations: the first 16 hexadecimal digits of `definition_sha256`.
    pub seed: String,
    /// Notes that apply to all figures.
    pub notes: Vec<String>,
    /// One analysis per protocol.
    pub protocols: Vec<ProtocolAnalysis>,
}

/// The analysis of a protocol's sessions.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ProtocolAnalysis {
    /// Name of the protocol.
    pub protocol: String,
    /// Title of the protocol for researchers.
    pub researcher_title: String,
    /// Names of the policies.
    pub policies: Vec<String>,
    /// Number of settings of each policy in a session.
    pub repeats: usize,
    /// Number of surgeons whose sessions count.
    pub surgeons: usize,
    /// The sessions with this protocol, and whether each counts.
    pub sessions: Vec<AnalysedSession>,
    /// Notes that apply to this protocol's figures.
    pub notes: Vec<String>,
    /// The outcomes, compared between the policies, over all sites.
    pub outcomes: Vec<Comparison>,
    /// The same for each site alone; empty if all sessions that count are of one site.
    pub by_site: Vec<SiteAnalysis>,
    /// Answers about sessions as a whole, which cannot be assigned to a policy.
    pub whole_sessions: Vec<WholeSessions>,
    /// Comments and answers in words.
    pub words: Vec<SurgeonWords>,
    /// Every value that was compared.
    pub values: Vec<Value>,
}

/// The figures of one site's sessions.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SiteAnalysis {
    /// Name of the site.
    pub site: String,
    /// Number of its sessions that count.
    pub sessions: usize,
    /// Number of its surgeons whose sessions count.
    pub surgeons: usize,
    /// The outcomes, compared between the policies.
    pub outcomes: Vec<Comparison>,
    /// Answers about sessions as a whole.
    pub whole_sessions: Vec<WholeSessions>,
}

/// A session of the study, and whether it counts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct AnalysedSession {
    /// The session.
    pub session: SessionId,
    /// The surgeon's code, corrected if it was; none for a withdrawn session.
    pub surgeon: Option<String>,
    /// Name of the site.
    pub site: String,
    /// Whether it counts.
    pub counts: bool,
    /// Why it does not count, or a remark on a session that counts.
    pub remark: Option<String>,
}

/// The answers to a closing question.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct WholeSessions {
    /// The question as an outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Number of sessions without an answer.
    pub missing: usize,
    /// Summary of the answers.
    #[serde(flatten)]
    pub summary: Summary,
}

/// A surgeon's words in the sessions that count.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct SurgeonWords {
    /// The surgeon's code.
    pub surgeon: String,
    /// The words by setting; those outside settings come last in each session.
    pub settings: Vec<SettingWords>,
}

/// The words in a setting, or outside all settings of a session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct SettingWords {
    /// The session.
    pub session: SessionId,
    /// The setting, from 1; none outside settings.
    pub setting: Option<usize>,
    /// The policy that ran; none outside settings.
    pub policy: Option<String>,
    /// The words, in order.
    pub words: Vec<Words>,
}

/// A comment or an answer in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Words {
    /// The question that it answers; none for a comment.
    pub question: Option<String>,
    /// The words; empty if they were erased.
    pub text: String,
    /// Whether it arrived too late to count.
    pub late: bool,
    /// Whether its words were erased.
    pub erased: bool,
}
