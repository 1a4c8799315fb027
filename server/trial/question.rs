//! Questions, and what an answer to one can be. Whether an answer fits its question is in [`answers`](super::answers).

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
        /// 5 or 7.
        points: u8,
        /// What 1 means.
        low: String,
        /// What the highest point means.
        high: String,
    },
    /// All settings of the session put in order, best first.
    Ranking,
    /// The System Usability Scale: ten items of 1..=5.
    Sus,
}

impl QuestionKind {
    /// Name of the kind, as in protocols and exports.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Likert { .. } => "likert",
            Self::Ranking => "ranking",
            Self::Sus => "sus",
        }
    }
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum AnswerValue {
    /// A Likert point.
    Point(u8),
    /// A ranking of settings (from 1), best first; or the ten SUS items, 0 for those that this answer
    /// leaves as they were.
    Points(Vec<u8>),
    /// Text.
    Text(String),
}
