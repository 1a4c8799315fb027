//! Erasure of words: the text is removed permanently. Its record and its hash stay.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::reason;
use super::refusal::Refusal;
use super::role::Role;

/// An erasure as the researcher's page sends it.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, ToSchema)]
pub struct NewErasure {
    /// Kind of record whose words are erased.
    pub subject: Erasable,
    /// Key of the record; for a correction or an event, its number.
    pub record: String,
    /// Reason for the erasure; kept with it. It must not repeat the erased words.
    #[schema(pattern = r"\S")]
    pub reason: String,
}

/// A record whose words can be erased.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Erasable {
    /// An answer given in words.
    Answer,
    /// A comment.
    Comment,
    /// A correction, with its note and its reason.
    Correction,
    /// The reason of an event of the session.
    Event,
    /// The reason of a study's event about the session. It is erased together with the reason of the session's event.
    StudyEvent,
}

names!(Erasable {
    Answer: "answer",
    Comment: "comment",
    Correction: "correction",
    Event: "event",
    StudyEvent: "study-event",
});

/// Checks whether `by` may erase words for `reason`. `under_way`: whether any session is under way. Returns the reason
/// without surrounding blanks.
///
/// # Errors
/// If `by` is not the researcher, a session is under way, or the reason is missing or too long.
pub fn check(by: Role, under_way: bool, reason: &str) -> Result<String, Refusal> {
    if by != Role::Researcher {
        return Err(Refusal::only("the researcher"));
    }
    // Erasing rewrites the whole database. A surgeon's comments and answers would have to wait for it.
    if under_way {
        return Err(Refusal::conflict("a session is under way; erase once it has ended"));
    }
    reason::needed(reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_researcher_erases_only_between_sessions_and_only_with_a_reason() {
        assert_eq!(check(Role::Researcher, false, "names a patient"), Ok("names a patient".to_owned()));
        assert!(matches!(check(Role::Researcher, true, "why"), Err(Refusal::Conflict(_))));
        assert!(matches!(check(Role::Researcher, false, " "), Err(Refusal::Invalid(_))));
        for by in [Role::Surgeon, Role::Operator, Role::System] {
            assert_eq!(check(by, false, "why"), Err(Refusal::only("the researcher")), "{by:?}");
        }
    }
}
