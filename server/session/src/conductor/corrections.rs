//! Corrections: the trial's rules decide on them against what is on disk, and they are recorded beside the original.

use super::course::Course;
use super::{ConductError, Conductor, Shared};
use parfocal_base::boxed;
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_records::store::{Answer, Correction, LatestCorrections, standings};
use parfocal_trial::account::Actor;
use parfocal_trial::correction::{self, Corrected, Field, FieldChange, NewCorrection, Subject};
use parfocal_trial::permission;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::refusal::Refusal;
use parfocal_trial::remark::CommentContent;

/// A correction that was decided on, as it is stored.
struct DecidedCorrection {
    subject: Subject,
    record: String,
    field: Field,
    old: String,
    new: String,
}

impl Conductor {
    /// Corrects a record of session `session`. The correction is on disk when this returns; the original stays.
    ///
    /// # Errors
    /// If `by` is not the researcher, the session is under way or withdrawn, its study is locked, the correction is
    /// invalid or was made in the meantime, its words would tell a policy in a blinded export, or the disk failed.
    pub async fn correct(
        &self,
        by: impl Into<Actor>,
        session: SessionId,
        new: NewCorrection,
    ) -> Result<(), ConductError> {
        let by = by.into();
        self.to_the_end(move |shared| async move { shared.correct(by, session, new).await }).await
    }
}

impl Shared {
    #[boxed]
    async fn correct(&self, by: Actor, session: SessionId, new: NewCorrection) -> Result<(), ConductError> {
        let _pen = self.pen.lock().await;
        let course = self.load(session).await?;
        let reason = correction::check(by.role, course.state.ended(), &new.reason)?;
        correction::check_lock(&new.change, course.study_locked.is_some())?;
        // The participant can be corrected even after a withdrawal, because it says who has withdrawn.
        if !matches!(new.change, FieldChange::Participant { .. }) {
            permission::check_reading(course.state.withdrawn())?;
        }

        self.check_words(session, "reason", &reason).await?;

        let latest = LatestCorrections::of(&self.store.reader().corrections(session).await?);
        let DecidedCorrection { subject, record, field, old, new } = match new.change {
            FieldChange::Participant { old, new } => self.participant(&course, &latest, old, new).await?,
            FieldChange::Value { record, old, new } => self.value(&course, &latest, record, &old, &new).await?,
            FieldChange::Note { record, old, new } => self.note(&course, &latest, record, &old, &new).await?,
        };

        let stamp = self.stamp();
        let Actor { role: by, account } = by;
        let correction = Correction { session, subject, record, field, old, new, reason, by, stamp };
        Ok(self.store.correct(&correction, account.as_ref()).await?)
    }

    async fn participant(
        &self,
        course: &Course,
        latest: &LatestCorrections,
        old: String,
        new: String,
    ) -> Result<DecidedCorrection, ConductError> {
        let session = course.session();
        let known = self.store.reader().participants().await?;
        let current = latest.participant(session).unwrap_or(&course.made.participant);
        correction::check_participant(current, &old, &new, known.iter().map(String::as_str))?;

        Ok(DecidedCorrection {
            subject: Subject::Session,
            record: session.to_string(),
            field: Field::Participant,
            old,
            new,
        })
    }

    async fn value(
        &self,
        course: &Course,
        latest: &LatestCorrections,
        record: IdempotencyKey,
        old: &AnswerValue,
        new: &AnswerValue,
    ) -> Result<DecidedCorrection, ConductError> {
        let answers = self.store.reader().answers(course.session()).await?;
        let standings = standings(&answers, &self.run_clock.clocks);
        let found = answers.iter().zip(&standings).find(|((_, answer), _)| answer.key == record);
        let ((_, answer), standing) = found.ok_or_else(no_such_record)?;
        if !standing.counts {
            let refusal = "this answer does not count; correct the one that counts, or add a note";
            return Err(Refusal::conflict(refusal).into());
        }

        let corrected = latest.value(&record);
        let answer = Corrected {
            segment: answer.segment,
            question: &answer.question,
            current: corrected.as_ref().unwrap_or(&standing.value),
        };
        let settings = course.state.segments().len();
        correction::check_value(&answer, old, new, &course.protocol, settings)?;

        let record = record.to_string();
        Ok(DecidedCorrection {
            subject: Subject::Answer,
            record,
            field: Field::Value,
            old: json(old)?,
            new: json(new)?,
        })
    }

    async fn note(
        &self,
        course: &Course,
        latest: &LatestCorrections,
        record: IdempotencyKey,
        old: &str,
        new: &str,
    ) -> Result<DecidedCorrection, ConductError> {
        let (subject, spoken) = self.subject_of(course.session(), record).await?;
        let old = old.trim();
        let new = new.trim();
        correction::check_note(latest.note(subject, &record).unwrap_or_default(), old, new)?;
        // A note on a recording is its transcript. What a surgeon said is never refused.
        if !spoken {
            self.check_words(course.session(), "note", new).await?;
        }

        let record = record.to_string();
        Ok(DecidedCorrection { subject, record, field: Field::Note, old: old.to_owned(), new: new.to_owned() })
    }

    /// Whether the record with this key is an answer or a comment of `session`, and whether it was spoken.
    async fn subject_of(&self, session: SessionId, record: IdempotencyKey) -> Result<(Subject, bool), ConductError> {
        let reader = self.store.reader();
        let is_answer = |(_, answer): &(i64, Answer)| answer.key == record;
        if reader.answers(session).await?.iter().any(is_answer) {
            return Ok((Subject::Answer, false));
        }

        let comments = reader.comments(session).await?;
        let comment = comments.into_iter().map(|(_, comment)| comment).find(|comment| comment.key == record);
        let comment = comment.ok_or_else(no_such_record)?;
        Ok((Subject::Comment, comment.said == CommentContent::Voice))
    }
}

pub(super) fn no_such_record() -> ConductError {
    ConductError::NotFound("this session has no such record; reload the page".to_owned())
}

fn json(value: &AnswerValue) -> Result<String, ConductError> {
    serde_json::to_string(value).map_err(|error| ConductError::Invalid(error.to_string()))
}
