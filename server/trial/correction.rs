//! Corrections: what a researcher may put right of what was recorded. The original stays; what is right stands beside
//! it, with the reason. A surgeon's own words are never corrected: a note can be added to them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::answers;
use super::participant::ParticipantCode;
use super::protocol::Protocol;
use super::question::{AnswerValue, QuestionKind};
use super::reason;
use super::refusal::Refusal;
use super::role::Role;
use crate::ids::{IdempotencyKey, SegmentId};

/// A correction as the researcher's page sends it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
pub struct NewCorrection {
    /// What is put right.
    #[serde(flatten)]
    pub change: FieldChange,
    /// Why; kept with the correction.
    #[schema(pattern = r"\S")]
    pub reason: String,
}

/// What is put right. `old` is what the page showed, so that nobody corrects what somebody else corrected meanwhile.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(tag = "field", rename_all = "kebab-case")]
pub enum FieldChange {
    /// The session was another participant's.
    Participant {
        /// The code so far.
        old: String,
        /// The right code.
        new: String,
    },
    /// An answer should have been another one. Not for answers in words.
    Value {
        /// The answer's key.
        record: IdempotencyKey,
        /// The answer so far.
        old: AnswerValue,
        /// The right answer.
        new: AnswerValue,
    },
    /// A note on a comment or on an answer.
    Note {
        /// The key of the comment or answer.
        record: IdempotencyKey,
        /// The note so far; empty where there is none.
        old: String,
        /// The note.
        new: String,
    },
}

/// What a correction is about.
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

impl Subject {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Session => "session",
            Self::Answer => "answer",
            Self::Comment => "comment",
        }
    }

    /// The subject called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Session, Self::Answer, Self::Comment].into_iter().find(|subject| subject.name() == name)
    }
}

/// What of a record is put right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Field {
    /// The participant of a session.
    Participant,
    /// The value of an answer, as JSON.
    Value,
    /// A note on an answer or a comment.
    Note,
}

impl Field {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Participant => "participant",
            Self::Value => "value",
            Self::Note => "note",
        }
    }

    /// The field called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Participant, Self::Value, Self::Note].into_iter().find(|field| field.name() == name)
    }
}

/// Whether `by` may correct a session that has `ended`, for `reason`. The reason comes back without blanks around it.
///
/// # Errors
/// When another role does this, the session is under way, or the reason is missing or too long.
pub fn check(by: Role, ended: bool, reason: &str) -> Result<String, Refusal> {
    if by != Role::Researcher {
        return Err(Refusal::only("the researcher"));
    }
    if !ended {
        return Err(Refusal::conflict("the session is under way; correct it once it has ended"));
    }
    reason::needed(reason)
}

/// Whether the session's participant may be corrected from `old` to `new`. `current` is the code so far, `known` are
/// the participants there are.
///
/// # Errors
/// When `new` is no participant's code, or the code was corrected meanwhile.
pub fn check_participant<'a>(
    current: &str,
    old: &str,
    new: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Result<(), Refusal> {
    let code = ParticipantCode::new(new).map_err(|error| Refusal::Invalid(error.to_string()))?;
    if !known.into_iter().any(|known| known == code.as_str()) {
        return Err(Refusal::Invalid(format!("there is no participant '{code}'; add the code first")));
    }
    check_change(current, old, new)
}

/// An answer that is to be corrected.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected<'a> {
    /// Its segment; none for a closing question.
    pub segment: Option<SegmentId>,
    /// The question's id.
    pub question: &'a str,
    /// The value so far.
    pub current: &'a AnswerValue,
}

/// Whether an answer in a session of `settings` settings by `protocol` may be corrected from `old` to `new`.
///
/// # Errors
/// When the answer is in words, `new` does not answer the question, or the answer was corrected meanwhile.
pub fn check_value(
    answer: &Corrected<'_>,
    old: &AnswerValue,
    new: &AnswerValue,
    protocol: &Protocol,
    settings: usize,
) -> Result<(), Refusal> {
    let question = protocol.question(answer.question, answer.segment.is_some()).ok_or(Refusal::UnknownQuestion)?;
    if question.kind == QuestionKind::Text {
        return Err(Refusal::conflict("what a surgeon wrote stays as it was written; add a note instead"));
    }

    answers::check(question, new, settings).map_err(|misfit| Refusal::Invalid(misfit.to_string()))?;
    if !answers::is_whole(new) {
        return Err(Refusal::Invalid("a corrected answer leaves nothing open; give every item".to_owned()));
    }
    check_change(answer.current, old, new)
}

/// Whether a note may be changed from `old` to `new`. `current` is the note so far.
///
/// # Errors
/// When it is too long, or was changed meanwhile.
pub fn check_note(current: &str, old: &str, new: &str) -> Result<(), Refusal> {
    answers::check_length(new).map_err(|misfit| Refusal::Invalid(misfit.to_string()))?;
    check_change(current, old, new)
}

fn check_change<T: PartialEq + ?Sized>(current: &T, old: &T, new: &T) -> Result<(), Refusal> {
    if current != old {
        return Err(Refusal::conflict("somebody has corrected this meanwhile; reload the page and look again"));
    }
    if current == new {
        return Err(Refusal::conflict("this is what stands there already; nothing was corrected"));
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
    fn what_was_corrected_meanwhile_or_stands_there_already_is_not_corrected() {
        let known = ["S-01", "S-02"];
        let meanwhile = check_participant("S-02", "S-01", "S-02", known);
        assert!(matches!(meanwhile, Err(Refusal::Conflict(text)) if text.contains("meanwhile")));
        let same = check_note("as it is", "as it is", "as it is");
        assert!(matches!(same, Err(Refusal::Conflict(text)) if text.contains("already")));
        assert_eq!(check_note("", "", "said of the monitor, not the focus"), Ok(()));
    }
}
