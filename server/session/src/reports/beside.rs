//! Records kept beside a session, as researchers read them: consents, corrections, erasures, a withdrawal.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::Reports;
use crate::conductor::{ConductError, Course, words_left};
use parfocal_base::ids::SessionId;
use parfocal_records::store::{Answer, Erased, Stamp, StoredConsent, StoredCorrection, StoredErasure};
use parfocal_trial::consent::Consent;
use parfocal_trial::correction::{Field, Subject};
use parfocal_trial::erasure::Erasable;
use parfocal_trial::event::{Event, EventKind};
use parfocal_trial::instruments::in_words;
use parfocal_trial::question::Question;
use parfocal_trial::role::Role;
use parfocal_trial::view::LogLine;

/// A correction, as it is shown.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct CorrectionLine {
    /// Order of the record in the database.
    pub number: i64,
    /// When it was recorded, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// Role that recorded it.
    pub by: Role,
    /// The corrected record, in words.
    pub about: String,
    /// The corrected part of the record.
    pub field: Field,
    /// The value before the correction, in words.
    pub old: String,
    /// The corrected value, in words.
    pub new: String,
    /// Reason for the correction.
    pub reason: String,
    /// When its words were erased, by the server's wall clock; none if they were not.
    #[schema(value_type = Option<String>)]
    pub erased: Option<Timestamp>,
}

/// A consent, as it is shown.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct ConsentLine {
    /// When it was recorded, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// The consent.
    #[serde(flatten)]
    pub consent: Consent,
}

/// A withdrawal, as it is shown.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct WithdrawalLine {
    /// When it was recorded, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// Role that recorded it.
    pub by: Role,
    /// The personal account of the person who recorded it, if signed in.
    pub account: Option<String>,
    /// Reason for the withdrawal.
    pub reason: String,
    /// Number of comments, answers in words and notes that nobody has erased from the database yet.
    pub words_left: usize,
}

impl Reports {
    /// The log lines of consents, corrections and erasures. Each comes with its time by the server's clocks over its
    /// restarts.
    pub(super) async fn beside(&self, session: SessionId) -> Result<Vec<(Timestamp, LogLine)>, ConductError> {
        let reader = &self.reader;
        let clocks = &self.run_clock.clocks;
        let actors = reader.actors(session).await?;
        let line = |kind: &str, number: i64, run: i64, stamp: Stamp, by: Role, text: String| {
            let account = actors.get(&(kind.to_owned(), number.to_string())).cloned();
            (clocks.wall(run, stamp.at), LogLine { at: stamp.wall, by, account, text, erasable_event: None })
        };

        let mut lines = Vec::new();
        for stored in reader.consents(session).await? {
            let Consent { text_version, given_on, obtained_by, medium } = &stored.consent;
            let medium = medium.name();
            let text = format!(
                "Consent recorded: version {text_version} of the text, on {medium}, given on {given_on}, \
                 obtained by {obtained_by}"
            );
            lines.push(line("consent", stored.number, stored.run, stored.stamp, stored.by, text));
        }
        for StoredCorrection { number, run, correction } in reader.corrections(session).await? {
            let subject = correction.subject.name();
            let what = match correction.field {
                Field::Note => format!("Note on {} {subject}", if subject == "answer" { "an" } else { "a" }),
                Field::Participant => "Participant corrected".to_owned(),
                Field::Value => "Answer corrected".to_owned(),
            };
            let why = Some(&correction.reason).filter(|reason| !reason.is_empty());
            let text = why.map_or_else(|| what.clone(), |reason| format!("{what}: {reason}"));
            lines.push(line("correction", number, run, correction.stamp, correction.by, text));
        }
        for StoredErasure { number, run, erasure } in reader.erasures(session).await? {
            let what = match erasure.subject {
                Erasable::Answer => "Words of an answer",
                Erasable::Comment => "Words of a comment",
                Erasable::Correction => "Words of a correction",
                Erasable::Event => "Reason of an event",
                Erasable::StudyEvent => "Reason in the study's audit trail",
            };
            let text = format!("{what} erased: {}", erasure.reason);
            lines.push(line("erasure", number, run, erasure.stamp, erasure.by, text));
        }
        Ok(lines)
    }

    pub(super) async fn consent_lines(&self, session: SessionId) -> Result<Vec<ConsentLine>, ConductError> {
        let consents = self.reader.consents(session).await?;
        let line = |stored: StoredConsent| ConsentLine { at: stored.stamp.wall, consent: stored.consent };
        Ok(consents.into_iter().map(line).collect())
    }

    pub(super) async fn correction_lines(&self, course: &Course) -> Result<Vec<CorrectionLine>, ConductError> {
        let reader = &self.reader;
        let session = course.session();
        let corrections = reader.corrections(session).await?;
        let answers = reader.answers(session).await?;
        let comments = reader.comments(session).await?;
        let erased = Erased::by(&reader.erasures(session).await?);

        let line = |StoredCorrection { number, correction, .. }: StoredCorrection| {
            let mut all = answers.iter().map(|(_, answer)| answer);
            let answer = all.find(|answer| answer.key.to_string() == correction.record);
            let question = answer.and_then(|answer| question_of(course, answer));
            let words = |text: &str| match (correction.field, serde_json::from_str(text)) {
                (Field::Value, Ok(value)) => in_words(question.map(|question| &question.kind), &value),
                _ => text.to_owned(),
            };
            let setting = answer.and_then(|answer| answer.segment).or_else(|| {
                let comment = comments.iter().find(|(_, comment)| comment.key.to_string() == correction.record);
                comment.and_then(|(_, comment)| comment.segment)
            });
            let setting = setting.map(|segment| course.setting(segment));

            CorrectionLine {
                number,
                at: correction.stamp.wall,
                by: correction.by,
                about: about(correction.subject, setting, question),
                field: correction.field,
                old: words(&correction.old),
                new: words(&correction.new),
                reason: correction.reason.clone(),
                erased: erased.at(Erasable::Correction, &number),
            }
        };
        Ok(corrections.into_iter().map(line).collect())
    }

    /// The participant's withdrawal, if there is one.
    pub(super) async fn withdrawal(&self, course: &Course) -> Result<Option<WithdrawalLine>, ConductError> {
        let of_withdrawal = |event: &Event| match &event.kind {
            EventKind::Withdrawn { reason } => Some((event.clone(), reason.clone())),
            _ => None,
        };
        let Some((event, reason)) = course.events.iter().find_map(of_withdrawal) else { return Ok(None) };

        Ok(Some(WithdrawalLine {
            at: event.wall,
            by: event.by,
            account: event.account.map(|account| account.to_string()),
            reason,
            words_left: words_left(&self.reader, course.session()).await?.len(),
        }))
    }
}

fn question_of<'a>(course: &'a Course, answer: &Answer) -> Option<&'a Question> {
    course.protocol.question(&answer.question, answer.segment.is_some())
}

/// The corrected record, in words.
fn about(subject: Subject, setting: Option<usize>, question: Option<&Question>) -> String {
    let on = setting.map_or_else(String::new, |setting| format!(" on setting {setting}"));
    match (subject, question) {
        (Subject::Session, _) => "Participant".to_owned(),
        (Subject::Comment, _) => format!("Comment{on}"),
        (Subject::Answer, Some(question)) => format!("Answer{on}: {}", question.text),
        (Subject::Answer, None) => format!("Answer{on}"),
    }
}
