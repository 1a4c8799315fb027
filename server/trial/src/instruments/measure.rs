//! Items and scores as numbers.

use serde::Serialize;
use utoipa::ToSchema;

/// An item or a score of an answer as a number.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Measure {
    /// Name of the measure: lower-case letters, digits and dashes.
    pub name: String,
    /// Name of the measure for people.
    pub label: String,
    /// The number; none if it is missing.
    pub value: Option<f64>,
    /// Whether the number is computed from other items.
    pub score: bool,
}

impl Measure {
    /// An item as the surgeon gave it.
    pub(super) fn item(name: impl Into<String>, label: impl Into<String>, value: Option<f64>) -> Self {
        Self { name: name.into(), label: label.into(), value, score: false }
    }

    /// A score that is computed from several items.
    pub(super) fn score(name: &str, label: &str, value: Option<f64>) -> Self {
        Self { name: name.to_owned(), label: label.to_owned(), value, score: true }
    }
}

/// Shown in place of a missing item.
pub(super) const MISSING: &str = "–";

/// An item in words, for people.
pub(super) fn in_words(item: u8) -> String {
    if item == 0 { MISSING.to_owned() } else { item.to_string() }
}

/// An item as a number; none if it is unanswered, which is written as 0.
pub(super) fn given(item: u8) -> Option<f64> {
    (item > 0).then(|| f64::from(item))
}
