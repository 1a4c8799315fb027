//! Corrections: which records a researcher may correct. The original stays. The correct value is kept beside it, with
//! the reason. A surgeon's own words are never corrected, but a note can be added to them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::answers;
use super::participant;
use super::protocol::Protocol;
use super::question::{AnswerValue, QuestionKind};
use super::reason;
use super::refusal::Refusal;
use super::role::Role;
use parfocal_base::ids::{IdempotencyKey, SegmentId};

/// A correction as the researcher's page sends it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
pub struct NewCorrection {
    /// Field to correct, with its old and new value.
    #[serde(flatten)]
    pub change: FieldChange,
    /// Reason for the correction; kept with it.
    #[schema(pattern = r"\S")]
    pub reason: String,
}

/// The corrected field. `old` is the value that the page showed, so that nobody overwrites another person's correction
/// without seeing it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(tag = "field", rename_all = "kebab-case")]
pub enum FieldChange {
    /// The session belonged to another participant.
    Participant {
        /// Participant code that the page showed.
        old: String,
        /// Correct participant code.
        new: String,
    },
    /// The value of an answer was wrong. Not for answers in words.
    Value {
        /// Key of the answer.
        record: IdempotencyKey,
        /// Answer that the page showed.
        old: AnswerValue,
        /// Correct answer.
        new: AnswerValue,
    },
    /// A note on a comment or on an answer.
    Note {
        /// The key of the comment or answer.
        record: IdempotencyKey,
        /// Note that the page showed; empty if there was none.
        old: String,
        /// New note.
        new: String,
    },
}

/// The kind of record that a correction changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Subject {
    /// The session itself.
    Session,
    /// An answer.
    Answer,
    /// A comment.
    Comment,
}

names!(Subject { Session: "session", Answer: "answer", Comment: "comment" });

/// The corrected part of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Field {
    /// Participant of a session.
    Participant,
    /// Value of an answer, as JSON.
    Value,
    /// Note on an answer or a comment.
    Note,
}

names!(Field { Participant: "participant", Value: "value", Note: "note" });

/// Checks whether `by` may correct a session for `reason`. `ended`: whether the session has ended. Returns the reason
/// without surrounding blanks.
///
/// # Errors
/// If `by` is not the researcher, the session is under way, or the reason is missing or too long.
pub fn check(by: Role, ended: bool, reason: &str) -> Result<String, Refusal> {
    if by != Role::Researcher {
        return Err(Refusal::only("the researcher"));
    }
    if !ended {
        return Err(Refusal::conflict("the session is under way; correct it once it has ended"));
    }
    reason::needed(reason)
}

/// Checks whether `change` is possible in a session whose study was `locked` or not. A note stays possible: it changes
/// no result.
///
/// # Errors
/// If the study was locked, and `change` is of an answer or of the participant.
pub fn check_lock(change: &FieldChange, locked: bool) -> Result<(), Refusal> {
    match change {
        FieldChange::Participant { .. } | FieldChange::Value { .. } if locked => Err(Refusal::conflict(
            "the session's study is locked: its answers and its participant can no longer be corrected; you can still \
             add a note",
        )),
        _ => Ok(()),
    }
}

/// Checks whether the session's participant may be corrected from `old` to `new`. `current` is the present code;
/// `known` are the codes of all participants.
///
/// # Errors
/// If `new` is not the code of a participant, the code was corrected in the meantime, or nothing would change.
pub fn check_participant<'a>(
    current: &str,
    old: &str,
    new: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Result<(), Refusal> {
    participant::check_code(new)?;
    if !known.into_iter().any(|known| known == new) {
        return Err(Refusal::Invalid(format!("there is no participant '{new}'; add the code first")));
    }
    check_change(current, old, new)
}

/// An answer to be corrected.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected<'a> {
    /// Segment that the answer is about; none for a closing question.
    pub segment: Option<SegmentId>,
    /// Id of the question.
    pub question: &'a str,
    /// Present value, with earlier corrections.
    pub current: &'a AnswerValue,
}

/// Checks whether an answer in a session of `settings` settings with `protocol` may be corrected from `old` to `new`.
///
/// # Errors
/// If the answer is in words, `new` is not a complete answer to the question, the answer was corrected in the meantime,
/// or nothing would change.
pub fn check_value(
    answer: &Corrected<'_>,
    old: &AnswerValue,
    new: &AnswerValue,
    protocol: &Protocol,
    settings: usize,
) -> Result<(), Refusal> {
    let question = protocol.question(answer.question, answer.segment.is_some()).ok_or(Refusal::unknown_question())?;
    if question.kind == QuestionKind::Text {
        return Err(Refusal::conflict("a surgeon's words are never corrected; add a note instead"));
    }

    answers::check(question, new, settings)?;
    if !answers::is_whole(new) {
        return Err(Refusal::Invalid("a corrected answer must be complete; give every item".to_owned()));
    }
    check_change(answer.current, old, new)
}

/// Checks whether a note may be changed from `old` to `new`. `current` is the present note.
///
/// # Errors
/// If `new` is too long, the note was changed in the meantime, or nothing would change.
pub fn check_note(current: &str, old: &str, new: &str) -> Result<(), Refusal> {
    answers::check_length(new).map_err(|too_long| Refusal::Invalid(too_long.to_string()))?;
    check_change(current, old, new)
}

fn check_change<T: PartialEq + ?Sized>(current: &T, old: &T, new: &T) -> Result<(), Refusal> {
    if current != old {
        return Err(Refusal::conflict(
            "somebody else has corrected this in the meantime; reload the page and check again",
        ));
    }
    if current == new {
        return Err(Refusal::conflict("the new value is the present one; nothing was corrected"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_researcher_corrects_only_after_the_end_and_only_with_a_reason() {
        assert_eq!(check(Role::Researcher, true, "  the tablet slipped "), Ok("the tablet slipped".to_owned()));
        for by in [Role::Surgeon, Role::Operator, Role::System] {
            assert_eq!(check(by, true, "why"), Err(Refusal::only("the researcher")), "{by:?}");
        }
        assert!(
            matches!(check(Role::Researcher, false, "why"), Err(Refusal::Conflict(text)) if text.contains("ended"))
        );
        assert!(matches!(check(Role::Researcher, true, " \n"), Err(Refusal::Invalid(_))));
    }

    #[test]
    fn a_participant_is_corrected_to_one_that_is_known() {
        let known = ["S-01", "S-02"];
        assert_eq!(check_participant("S-01", "S-01", "S-02", known), Ok(()));
        for wrong in ["S-03", "anna", ""] {
            assert!(matches!(check_participant("S-01", "S-01", wrong, known), Err(Refusal::Invalid(_))), "{wrong}");
        }
    }

    #[test]
    fn a_stale_or_unchanged_value_is_not_corrected() {
        let known = ["S-01", "S-02"];
        let meanwhile = check_participant("S-02", "S-01", "S-02", known);
        assert!(matches!(meanwhile, Err(Refusal::Conflict(text)) if text.contains("in the meantime")));
        let same = check_note("as it is", "as it is", "as it is");
        assert!(matches!(same, Err(Refusal::Conflict(text)) if text.contains("is the present one")));
        assert_eq!(check_note("", "", "said of the monitor, not the focus"), Ok(()));
    }
}
