//! The analysis of a study as it is told: on the page, as JSON, in tables.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::comparison::Comparison;
use super::outcomes::Outcome;
use super::statistics::Summary;
use crate::ids::SessionId;

/// The analysis of a study that was unblinded.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Analysis {
    /// The study.
    pub study: String,
    /// Its title.
    pub title: String,
    /// SHA-256 of its definition.
    pub definition_sha256: String,
    /// How its definition says that it is analysed.
    pub planned: String,
    /// When it was unblinded, by the server's wall clock.
    #[schema(value_type = String)]
    pub unblinded: Timestamp,
    /// The sites of it that this database runs.
    pub sites: Vec<String>,
    /// What resamples and permutations are drawn from: the first 16 digits of `definition_sha256`.
    pub seed: String,
    /// What a reader must know of all figures.
    pub notes: Vec<String>,
    /// Each of its protocols by itself.
    pub protocols: Vec<ProtocolAnalysis>,
}

/// The sessions of a protocol analysed.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ProtocolAnalysis {
    /// The protocol.
    pub protocol: String,
    /// Its title for researchers.
    pub researcher_title: String,
    /// Its policies.
    pub policies: Vec<String>,
    /// Settings of each policy in a session.
    pub repeats: usize,
    /// Surgeons whose sessions count.
    pub surgeons: usize,
    /// The sessions made by it, and whether each counts.
    pub sessions: Vec<AnalysedSession>,
    /// What a reader must know of this protocol's figures.
    pub notes: Vec<String>,
    /// What is compared between the policies.
    pub outcomes: Vec<Comparison>,
    /// Answers about sessions as a whole, which no policy can be given.
    pub whole_sessions: Vec<WholeSessions>,
    /// What surgeons said.
    pub words: Vec<SurgeonWords>,
    /// Each value that was compared.
    pub values: Vec<Value>,
}

/// A session of the study, and whether it counts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct AnalysedSession {
    /// The session.
    pub session: SessionId,
    /// The surgeon's code, as it was corrected; none of a withdrawn session.
    pub surgeon: Option<String>,
    /// Its site.
    pub site: String,
    /// Whether it counts.
    pub counts: bool,
    /// Why it does not count; or what is to be known of it though it does.
    pub remark: Option<String>,
}

/// A closing question's answers.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct WholeSessions {
    /// What was asked.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Sessions without an answer.
    pub missing: usize,
    /// The answers.
    #[serde(flatten)]
    pub summary: Summary,
}

/// What a surgeon said in the sessions that count.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct SurgeonWords {
    /// The surgeon's code.
    pub surgeon: String,
    /// By setting; those beside all settings come last.
    pub settings: Vec<SettingWords>,
}

/// What was said in a setting, or beside all settings of a session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct SettingWords {
    /// The session.
    pub session: SessionId,
    /// The setting, from 1; none beside all settings.
    pub setting: Option<usize>,
    /// The policy that ran.
    pub policy: Option<String>,
    /// What was said, in order.
    pub words: Vec<Words>,
}

/// Something that was said.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Words {
    /// The question that it answers; none of a comment.
    pub question: Option<String>,
    /// The words, empty where they were erased.
    pub text: String,
    /// Whether it arrived after the time in which what a surgeon's device held counted.
    pub late: bool,
    /// Whether its words were erased.
    pub erased: bool,
}

/// A value that was compared.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = AnalysedValue)]
pub struct Value {
    /// The session.
    pub session: SessionId,
    /// The surgeon's code, as it was corrected.
    pub surgeon: String,
    /// The setting, from 1.
    pub setting: usize,
    /// The policy that ran.
    pub policy: String,
    /// Which of the policy's settings in the session, from 1.
    pub repeat: usize,
    /// The outcome.
    pub outcome: String,
    /// The value; none where it is missing.
    pub value: Option<f64>,
}
