//! Erases words, together with everything that the database has about them.

use super::corrections::no_such_record;
use super::{ConductError, Conductor, Pen, Shared};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_records::store::{Answer, Correction, Erased, Erasure, Reader, StoreError};
use parfocal_trial::account::Actor;
use parfocal_trial::correction::Field;
use parfocal_trial::erasure::{self, Erasable, NewErasure};
use parfocal_trial::event::EventKind;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::refusal::Refusal;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::study::event::StudyEventKind;

impl Conductor {
    /// Erases words of session `session` with the notes on them, or the reason of one of its events. When this returns,
    /// no file of the database contains them.
    ///
    /// # Errors
    /// If `by` is not the researcher, a session is under way, the record has no words, or the disk failed.
    pub async fn erase(&self, by: impl Into<Actor>, session: SessionId, new: NewErasure) -> Result<(), ConductError> {
        let by = by.into();
        self.to_the_end(move |shared| async move { shared.erase(by, session, new).await }).await
    }

    /// Erases all words of session `session`, whose participant withdrew: comments with their sound, answers in words,
    /// and notes. When this returns, no file of the database contains them.
    ///
    /// # Errors
    /// If `by` is not the researcher, the participant has not withdrawn, a session is under way, nothing is left to
    /// erase, or the disk failed.
    pub async fn erase_all_words(
        &self,
        by: impl Into<Actor>,
        session: SessionId,
        reason: String,
    ) -> Result<(), ConductError> {
        let by = by.into();
        self.to_the_end(move |shared| async move { shared.erase_all_words(by, session, &reason).await }).await
    }
}

impl Shared {
    #[boxed]
    async fn erase_all_words(&self, by: Actor, session: SessionId, reason: &str) -> Result<(), ConductError> {
        let mut pen = self.pen.lock().await;
        let reason = self.check_erasing(&mut pen, &by, session, reason).await?;
        if !self.store.reader().is_withdrawn(session).await? {
            let refusal = "all words can be erased at once only for a withdrawn session; erase them one by one";
            return Err(Refusal::conflict(refusal).into());
        }

        let records = words_left(self.store.reader(), session).await?;
        if records.is_empty() {
            // But there may be copies that an earlier attempt could not remove.
            if self.store.finish_erasures().await? {
                return Ok(());
            }
            return Err(Refusal::conflict("no words of this session are left to erase").into());
        }
        self.erase_records(by, session, records, &reason).await
    }

    /// Checks that words of `session` may be erased now. Returns the reason without surrounding white space.
    async fn check_erasing(
        &self,
        pen: &mut Pen,
        by: &Actor,
        session: SessionId,
        reason: &str,
    ) -> Result<String, ConductError> {
        self.record_stops(pen).await?;
        let under_way = self.live().shown_phase().is_some_and(|phase| !phase.has_ended());
        let reason = erasure::check(by.role, under_way, reason)?;

        if self.store.reader().session(session).await?.is_none() {
            return Err(ConductError::no_session());
        }
        self.check_words(session, "reason", &reason).await?;
        Ok(reason)
    }

    #[boxed]
    async fn erase(&self, by: Actor, session: SessionId, new: NewErasure) -> Result<(), ConductError> {
        let mut pen = self.pen.lock().await;
        let reason = self.check_erasing(&mut pen, &by, session, &new.reason).await?;
        let records = match new.subject {
            Erasable::Event => self.with_its_copy(session, &new.record).await?,
            Erasable::StudyEvent => {
                let advice = "erase the reason of the session's event instead; the study's event is erased with it";
                return Err(Refusal::Invalid(advice.to_owned()).into());
            }
            Erasable::Comment | Erasable::Answer | Erasable::Correction => {
                self.with_its_notes(session, new.subject, new.record).await?
            }
        };
        self.erase_records(by, session, records, &reason).await
    }

    async fn erase_records(
        &self,
        by: Actor,
        session: SessionId,
        records: Vec<(Erasable, String)>,
        reason: &str,
    ) -> Result<(), ConductError> {
        let stamp = self.stamp();
        let Actor { role: by, account } = by;
        let erasure = |(subject, record)| Erasure { session, subject, record, reason: reason.to_owned(), by, stamp };
        let erasures: Vec<Erasure> = records.into_iter().map(erasure).collect();
        let erased = self.store.erase(&erasures, account.as_ref()).await;
        // Then the words are erased from their records, and no page may go on showing them.
        if !matches!(erased, Ok(()) | Err(StoreError::ErasureUnfinished)) {
            return Ok(erased?);
        }

        let reader = self.store.reader();
        let comments = reader.comments(session).await?;
        let events = reader.events(session).await?;
        let mut live = self.live();
        if let Some(course) = live.course_of(session) {
            course.hear_again(comments.into_iter().map(|(_, comment)| comment));
            course.read_again(events.into_iter().map(|(_, event)| event));
            self.publish(&live);
        }
        Ok(erased?)
    }

    /// The record itself and the notes on it, because a note may repeat the words. Of a record without words, such as a
    /// mark, the notes alone. An answer and a note are erased in all their versions: a surgeon who goes on writing gives
    /// another answer to the same question, and a correction also has what stood there before it.
    async fn with_its_notes(
        &self,
        session: SessionId,
        subject: Erasable,
        record: String,
    ) -> Result<Vec<(Erasable, String)>, ConductError> {
        let reader = self.store.reader();
        let corrections = reader.corrections(session).await?;
        let (words, about, refusal) = match subject {
            Erasable::Comment => {
                let comments = reader.comments(session).await?;
                let comment = comments.iter().find(|(_, comment)| comment.key.to_string() == record);
                let (_, comment) = comment.ok_or_else(no_such_record)?;
                let words = if can_be_erased(&comment.said) { vec![record.clone()] } else { Vec::new() };
                (words, vec![record], "only words can be erased; this comment has none")
            }
            Erasable::Answer => {
                let answers = reader.answers(session).await?;
                let answer = answers.iter().find(|(_, answer)| answer.key.to_string() == record);
                let (_, answer) = answer.ok_or_else(no_such_record)?;
                let words = versions_in_words(answer, &answers);
                let about = words.iter().cloned().chain([record]).collect();
                (words, about, "only words can be erased; this answer is a number")
            }
            _ => {
                let stored = corrections.iter().find(|stored| stored.number.to_string() == record);
                let correction = stored.map(|stored| &stored.correction).ok_or_else(no_such_record)?;
                let about = if correction.field == Field::Note { vec![correction.record.clone()] } else { Vec::new() };
                (Vec::new(), about, "only a note can be erased; this correction is a value")
            }
        };

        let is_note = |correction: &Correction| correction.field == Field::Note && about.contains(&correction.record);
        let notes = corrections.iter().filter(|stored| is_note(&stored.correction));
        let notes = notes.map(|stored| (Erasable::Correction, stored.number.to_string()));

        let words = words.into_iter().map(|record| (subject, record));
        let records: Vec<_> = words.chain(notes).collect();
        if records.is_empty() {
            return Err(Refusal::conflict(refusal).into());
        }
        Ok(records)
    }

    /// The session's event with this number, and the event of its study that repeats the reason.
    async fn with_its_copy(&self, session: SessionId, number: &str) -> Result<Vec<(Erasable, String)>, ConductError> {
        let reader = self.store.reader();
        let events = reader.events(session).await?;
        let found = events.iter().map(|(_, event)| event).find(|event| event.number.to_string() == number);
        let event = found.ok_or_else(no_such_record)?;
        if event.kind.reason().is_none() {
            return Err(Refusal::conflict("only a reason can be erased; this event has none").into());
        }

        let enrolment = reader.enrolment(session).await?;
        if event.kind.has_reason_of_study(enrolment.is_some()) {
            let refusal = "this is the reason for unblinding the whole study; all its sessions tell it, and it cannot \
                           be erased";
            return Err(Refusal::conflict(refusal).into());
        }

        let mut records = vec![(Erasable::Event, format!("{session}/{}", event.number))];
        if let Some(enrolment) = enrolment {
            let of_study = reader.study_events(&enrolment.study).await?;
            let copies = of_study.iter().filter(|copy| repeats(&copy.kind, session, &event.kind));
            records.extend(copies.map(|copy| (Erasable::StudyEvent, format!("{}/{}", enrolment.study, copy.number))));
        }
        Ok(records)
    }
}

/// Whether the study's event `of_study` repeats the event `of_session` of session `session`.
fn repeats(of_study: &StudyEventKind, session: SessionId, of_session: &EventKind) -> bool {
    match of_study {
        StudyEventKind::SessionWithdrawn { session: about } => {
            *about == session && matches!(of_session, EventKind::Withdrawn { .. })
        }
        StudyEventKind::SessionUnblinded { session: about } => {
            *about == session && matches!(of_session, EventKind::Unblinded { .. })
        }
        _ => false,
    }
}

/// The keys of all answers in words to the question that `answer`, one of `answers`, answers.
fn versions_in_words(answer: &Answer, answers: &[(i64, Answer)]) -> Vec<String> {
    let same = |other: &&Answer| other.segment == answer.segment && other.question == answer.question;
    let in_words = |other: &&Answer| matches!(other.value, AnswerValue::Text(_));
    let versions = answers.iter().map(|(_, other)| other).filter(same).filter(in_words);
    versions.map(|version| version.key.to_string()).collect()
}

/// Whether a comment's words, written or spoken, can be erased.
fn can_be_erased(said: &CommentContent) -> bool {
    said.has_words() || *said == CommentContent::Voice
}

/// The records of `session` whose words nobody has erased: comments, answers in words, notes.
pub(crate) async fn words_left(reader: &Reader, session: SessionId) -> Result<Vec<(Erasable, String)>, StoreError> {
    let comments = reader.comments(session).await?.into_iter();
    let comments = comments.filter(|(_, comment)| can_be_erased(&comment.said));
    let comments = comments.map(|(_, comment)| (Erasable::Comment, comment.key.to_string()));
    let answers = reader.answers(session).await?.into_iter();
    let answers = answers.filter(|(_, answer)| matches!(answer.value, AnswerValue::Text(_)));
    let answers = answers.map(|(_, answer)| (Erasable::Answer, answer.key.to_string()));
    let notes = reader.corrections(session).await?.into_iter();
    let notes = notes.filter(|stored| stored.correction.field == Field::Note);
    let notes = notes.map(|stored| (Erasable::Correction, stored.number.to_string()));

    let erased = Erased::by(&reader.erasures(session).await?);
    let is_left = |(subject, record): &(Erasable, String)| erased.at(*subject, record).is_none();
    let left = comments.chain(answers).chain(notes).filter(is_left);
    Ok(left.collect())
}
