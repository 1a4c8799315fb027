//! Questions and answers. Whether an answer fits its question, and how it is scored, is in
//! [`instruments`](super::instruments).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A question of the protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Question {
    /// Id of the question, unique in the protocol.
    pub id: String,
    /// The question as the surgeon reads it.
    pub text: String,
    /// The kind of answer that the question takes.
    #[serde(flatten)]
    pub kind: QuestionKind,
    /// Whether the question can be left unanswered.
    #[serde(default)]
    pub optional: bool,
    /// Id of the recognition question to which this one belongs: it is asked only if that one is answered with yes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub only_if_yes: Option<String>,
}

/// The kinds of question, by the answers that they take.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum QuestionKind {
    /// Free text.
    Text,
    /// A point from 1 to `points`.
    Likert {
        /// 5 or 7; with labels, as many as there are.
        points: u8,
        /// Meaning of point 1.
        low: String,
        /// Meaning of the highest point.
        high: String,
        /// Meaning of each point, in order; empty if only the ends are named.
        #[serde(default)]
        labels: Vec<String>,
    },
    /// A place on a line, from 0 to 100.
    VisualAnalogue {
        /// Meaning of 0, the lower end.
        low: String,
        /// Meaning of 100, the upper end.
        high: String,
    },
    /// A ranking of all settings of the session.
    Ranking {
        /// Whether settings may share a place.
        #[serde(default)]
        ties: bool,
    },
    /// The System Usability Scale: ten items of 1..=5.
    Sus {
        /// The ten items as the surgeon reads them.
        items: Vec<String>,
        /// Meaning of 1.
        low: String,
        /// Meaning of 5.
        high: String,
    },
    /// The NASA Task Load Index without weights.
    NasaTlx {
        /// The six scales.
        scales: Vec<Scale>,
    },
    /// The Surgery Task Load Index.
    SurgTlx {
        /// The six scales.
        scales: Vec<Scale>,
        /// The pairs of scales to compare; empty if the index is asked without weights.
        pairs: Vec<Pair>,
    },
    /// Whether the surgeon thinks they recognised settings: no, not sure, yes.
    Recognition,
}

/// A scale of a questionnaire.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Scale {
    /// Name of the scale in exports: lower-case letters and dashes.
    pub name: String,
    /// Name of the scale as the surgeon reads it.
    pub title: String,
    /// The question about this scale.
    pub text: String,
    /// Meaning of the lower end.
    pub low: String,
    /// Meaning of the upper end.
    pub high: String,
}

/// Two scales of a questionnaire, of which the surgeon chooses one. Scales are numbered from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Pair {
    /// Scale that is offered first.
    pub first: u8,
    /// Scale that is offered second.
    pub second: u8,
}

impl QuestionKind {
    /// The kind's name, as in protocols and exports.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Likert { .. } => "likert",
            Self::VisualAnalogue { .. } => "visual-analogue",
            Self::Ranking { .. } => "ranking",
            Self::Sus { .. } => "sus",
            Self::NasaTlx { .. } => "nasa-tlx",
            Self::SurgTlx { .. } => "surg-tlx",
            Self::Recognition => "recognition",
        }
    }
}

/// The value of an answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum AnswerValue {
    /// A Likert point, a place on a line, or an answer to a recognition question.
    Point(u8),
    /// A ranking of settings (from 1), best first; or the items of a questionnaire, with 0 for items that this answer
    /// leaves as they were.
    Points(Vec<u8>),
    /// An answer in words.
    Text(String),
}
