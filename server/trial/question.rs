//! Questions, and what an answer to one can be. Whether an answer fits its question and what it scores is in
//! [`instruments`](super::instruments).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A question of the protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Question {
    /// Id, unique in the protocol.
    pub id: String,
    /// The question as read by the surgeon.
    pub text: String,
    /// What sort of answer it takes.
    #[serde(flatten)]
    pub kind: QuestionKind,
    /// Whether it can be left out.
    #[serde(default)]
    pub optional: bool,
}

/// Sorts of answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum QuestionKind {
    /// Free text.
    Text,
    /// A point from 1 to `points`.
    Likert {
        /// 5 or 7; with labels, as many as there are.
        points: u8,
        /// What 1 means.
        low: String,
        /// What the highest point means.
        high: String,
        /// What each point means, in order; empty where only the ends are named.
        #[serde(default)]
        labels: Vec<String>,
    },
    /// A place on a line, from 0 to 100.
    VisualAnalogue {
        /// What 0 means.
        low: String,
        /// What 100 means.
        high: String,
    },
    /// All settings of the session put in order.
    Ranking {
        /// Whether settings may share a place.
        #[serde(default)]
        ties: bool,
    },
    /// The System Usability Scale: ten items of 1..=5.
    Sus,
    /// The NASA Task Load Index without weights.
    NasaTlx {
        /// Its six scales.
        scales: Vec<Scale>,
    },
    /// The Surgery Task Load Index.
    SurgTlx {
        /// Its six scales.
        scales: Vec<Scale>,
        /// The pairs of scales to be compared; empty where it is asked without weights.
        pairs: Vec<Pair>,
    },
    /// Whether the surgeon thinks to have recognised settings: no, not sure, yes.
    Recognition,
}

/// A scale of a questionnaire.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Scale {
    /// Its name in exports: lower case letters and dashes.
    pub name: String,
    /// Its name as the surgeon reads it.
    pub title: String,
    /// What is asked.
    pub text: String,
    /// What its lower end means.
    pub low: String,
    /// What its upper end means.
    pub high: String,
}

/// Two scales of a questionnaire, by their places from 0, of which the surgeon chooses one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Pair {
    /// The one offered first.
    pub first: u8,
    /// The other.
    pub second: u8,
}

impl QuestionKind {
    /// Name of the kind, as in protocols and exports.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Likert { .. } => "likert",
            Self::VisualAnalogue { .. } => "visual-analogue",
            Self::Ranking { .. } => "ranking",
            Self::Sus => "sus",
            Self::NasaTlx { .. } => "nasa-tlx",
            Self::SurgTlx { .. } => "surg-tlx",
            Self::Recognition => "recognition",
        }
    }
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum AnswerValue {
    /// A Likert point, a place on a line, or what was recognised.
    Point(u8),
    /// A ranking of settings (from 1), best first; or the items of a questionnaire, 0 for those that this answer
    /// leaves as they were.
    Points(Vec<u8>),
    /// Text.
    Text(String),
}
