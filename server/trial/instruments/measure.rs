//! Items and scores as numbers.

use serde::Serialize;
use utoipa::ToSchema;

/// An item or a score of an answer, as a number.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Measure {
    /// Its name: lower case letters, digits and dashes.
    pub name: String,
    /// Its name for reading.
    pub label: String,
    /// The number; none where it is missing.
    pub value: Option<f64>,
    /// Whether it is computed from other items.
    pub score: bool,
}

impl Measure {
    /// An item as it was given.
    pub(super) fn item(name: impl Into<String>, label: impl Into<String>, value: Option<f64>) -> Self {
        Self { name: name.into(), label: label.into(), value, score: false }
    }

    /// What is computed from several items.
    pub(super) fn score(name: &str, label: &str, value: Option<f64>) -> Self {
        Self { name: name.to_owned(), label: label.to_owned(), value, score: true }
    }
}

/// What stands where an item is missing.
pub(super) const MISSING: &str = "–";

/// An item as a number; none for an open one, which is given as 0.
pub(super) fn given(item: u8) -> Option<f64> {
    (item > 0).then(|| f64::from(item))
}
