//! Erasure of words, with everything that the database has about them.

use super::corrections::no_such_record;
use super::{ConductError, Conductor, Shared};
use crate::ids::SessionId;
use crate::store::{Answer, Comment, Erasure, StoredCorrection};
use crate::trial::account::Actor;
use crate::trial::correction::Field;
use crate::trial::erasure::{self, Erasable, NewErasure};
use crate::trial::question::AnswerValue;
use crate::trial::refusal::Refusal;

impl Conductor {
    /// Erases words that were said in session `session`, and the notes on them. When this returns, they are nowhere in
    /// the database's files.
    ///
    /// # Errors
    /// When `by` is not the researcher, a session is under way, the record has no words, or the disk failed.
    pub async fn erase(&self, by: impl Into<Actor>, session: SessionId, new: NewErasure) -> Result<(), ConductError> {
        let by = by.into();
        self.to_the_end(move |shared| async move { shared.erase(by, session, new).await }).await
    }
}

impl Shared {
    async fn erase(&self, by: Actor, session: SessionId, new: NewErasure) -> Result<(), ConductError> {
        let mut pen = self.pen.lock().await;
        self.record_stops(&mut pen).await?;
        let under_way = self.live().shown_phase().is_some_and(|phase| !phase.has_ended());
        let reason = erasure::check(by.role, under_way, &new.reason)?;

        let reader = self.store.reader();
        if reader.session(session).await?.is_none() {
            return Err(ConductError::no_session());
        }
        let corrections = reader.corrections(session).await?;
        match new.subject {
            Erasable::Comment => is_comment(&reader.comments(session).await?, &new.record)?,
            Erasable::Answer => is_text(&reader.answers(session).await?, &new.record)?,
            Erasable::Correction => is_note(&corrections, &new.record)?,
        }

        let stamp = self.stamp();
        let Actor { role: by, account } = by;
        let erasure =
            |subject: Erasable, record: String| Erasure { session, subject, record, reason: reason.clone(), by, stamp };

        // A note on the words may repeat them.
        let notes = corrections.iter().filter(|stored| stored.correction.record == new.record);
        let notes = notes.map(|stored| erasure(Erasable::Correction, stored.number.to_string()));
        let mut erasures = vec![erasure(new.subject, new.record.clone())];
        erasures.extend(notes);
        self.store.erase(&erasures, account.as_ref()).await?;

        let comments = reader.comments(session).await?;
        let mut live = self.live();
        if let Some(course) = live.course_of(session) {
            course.hear_again(comments.into_iter().map(|(_, comment)| comment));
            self.publish(&live);
        }
        Ok(())
    }
}

fn is_comment(comments: &[(i64, Comment)], record: &str) -> Result<(), ConductError> {
    let found = comments.iter().any(|(_, comment)| comment.key.to_string() == record);
    if found { Ok(()) } else { Err(no_such_record()) }
}

fn is_text(answers: &[(i64, Answer)], record: &str) -> Result<(), ConductError> {
    let found = answers.iter().find(|(_, answer)| answer.key.to_string() == record);
    let (_, answer) = found.ok_or_else(no_such_record)?;
    match answer.value {
        AnswerValue::Text(_) => Ok(()),
        AnswerValue::Point(_) | AnswerValue::Points(_) => {
            Err(Refusal::conflict("only words can be erased; this answer is a number").into())
        }
    }
}

fn is_note(corrections: &[StoredCorrection], record: &str) -> Result<(), ConductError> {
    let found = corrections.iter().find(|stored| stored.number.to_string() == record);
    let stored = found.ok_or_else(no_such_record)?;
    match stored.correction.field {
        Field::Note => Ok(()),
        Field::Participant | Field::Value => {
            Err(Refusal::conflict("only a note can be erased; this correction is a value").into())
        }
    }
}
