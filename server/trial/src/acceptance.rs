//! Decides which comments and answers of a surgeon are accepted. Everything accepted is kept, in every state of the
//! session.

use super::answers;
use super::question::AnswerValue;
use super::refusal::{Refusal, RefusalKind};
use super::remark::{CommentContent, NewAnswer};
use super::session::SessionState;
use parfocal_base::ids::SegmentId;
use parfocal_language::Message;

/// Checks the content of a comment.
///
/// # Errors
/// If a text is empty or too long.
pub fn check_comment(said: &CommentContent) -> Result<(), Refusal> {
    let (CommentContent::Text(text) | CommentContent::Quick(text)) = said else { return Ok(()) };
    if text.trim().is_empty() {
        return Err(Refusal::Said(RefusalKind::Invalid, Message::new("refused-empty")));
    }
    answers::check_length(text)
}

/// Checks whether a spoken comment is allowed. `voice`: whether the session's protocol asks for voice comments. Without
/// that they are refused, because speech is personal data and nobody has consented to its recording.
///
/// # Errors
/// If the comment is spoken and the session does not ask for voice.
pub fn check_spoken(said: &CommentContent, voice: bool) -> Result<(), Refusal> {
    if *said == CommentContent::Voice && !voice {
        return Err(Refusal::not_now("refused-no-voice"));
    }
    Ok(())
}

/// Checks the answer `new` in a session in the state `state`.
///
/// # Errors
/// If the session does not ask this question, has not asked it yet, or the answer does not fit the question.
pub fn check_answer(new: &NewAnswer, state: &SessionState) -> Result<(), Refusal> {
    let has_segment = new.segment.is_none_or(|segment| state.position(segment).is_some());
    let question = state.protocol().question(&new.question, new.segment.is_some()).filter(|_| has_segment);
    let question = question.ok_or(Refusal::unknown_question())?;

    if !state.takes_answers(new.segment) {
        return Err(Refusal::not_now("refused-question-not-asked"));
    }
    answers::check(question, &new.value, state.segments().len())
}

/// Checks the answer `new` in a session of `segments` whose questions are unknown, because this version cannot read the
/// session's protocol.
///
/// # Errors
/// If the session has no such segment, or the answer is too long.
pub fn check_unasked(new: &NewAnswer, segments: &[SegmentId]) -> Result<(), Refusal> {
    if let AnswerValue::Text(text) = &new.value {
        answers::check_length(text)?;
    }
    match new.segment {
        Some(segment) if !segments.contains(&segment) => Err(Refusal::unknown_segment()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voice_is_taken_only_where_the_protocol_asks_for_it() {
        assert_eq!(check_spoken(&CommentContent::Voice, true), Ok(()));
        assert_eq!(check_spoken(&CommentContent::Mark, false), Ok(()));
        assert!(matches!(check_spoken(&CommentContent::Voice, false), Err(Refusal::Said(RefusalKind::Conflict, _))));
    }

    #[test]
    fn a_comment_must_say_something_and_no_more_than_fits() {
        assert_eq!(check_comment(&CommentContent::Text("sharp".to_owned())), Ok(()));
        let refused = |text: &str| check_comment(&CommentContent::Text(text.to_owned())).unwrap_err();
        assert_eq!(refused(" \n").to_string(), "the comment is empty");
        assert!(matches!(refused(&"a".repeat(answers::LONGEST_TEXT + 1)), Refusal::Said(RefusalKind::Invalid, _)));
    }
}
