//! One session in detail, for the researcher's page.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::Reports;
use super::beside::{ConsentLine, CorrectionLine, WithdrawalLine};
use crate::conductor::{ConductError, Course};
use parfocal_base::PolicyName;
use parfocal_base::boxed;
use parfocal_base::ids::{IdempotencyKey, SegmentId, SessionId};
use parfocal_records::store::{DeviceEvent, Erased, LatestCorrections, SessionLine, standings};
use parfocal_trial::correction::{Field, Subject};
use parfocal_trial::erasure::Erasable;
use parfocal_trial::event::EventKind;
use parfocal_trial::grace::Outstanding;
use parfocal_trial::instruments::{Measure, in_words, measures, sus_score};
use parfocal_trial::question::{AnswerValue, QuestionKind};
use parfocal_trial::role::Role;
use parfocal_trial::session::inspections;
use parfocal_trial::view::LogLine;

/// A session in detail, for the researcher. Contains the policies only after it was unblinded.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SessionDetail {
    /// The session's line in the list.
    #[serde(flatten)]
    pub line: SessionLine,
    /// The protocol's title for researchers.
    pub researcher_title: String,
    /// Algorithm that drew the order.
    pub algorithm: &'static str,
    /// SHA-256 published when the session was made, which commits to the order.
    pub commitment: String,
    /// The session's settings, in order.
    pub settings_detail: Vec<SettingDetail>,
    /// Answers that count, in the order of entry; none once the participant has withdrawn.
    pub answers: Vec<AnswerLine>,
    /// Corrections, oldest first. Once the participant has withdrawn, only those of the participant.
    pub corrections: Vec<CorrectionLine>,
    /// The participant's consents, oldest first; the latest counts.
    pub consents: Vec<ConsentLine>,
    /// The participant's withdrawal, if there is one.
    pub withdrawal: Option<WithdrawalLine>,
    /// Time, by the server's clock, until which arriving comments and answers count; none while the session is under
    /// way.
    #[schema(value_type = Option<String>)]
    pub counts_until: Option<Timestamp>,
    /// What may still arrive and would not count after unblinding.
    pub outstanding: Option<Outstanding>,
    /// Everything that happened, oldest first.
    pub log: Vec<LogLine>,
    /// What unblinding revealed; none before.
    pub unblinding: Option<Unblinding>,
    /// Whether its study was locked, so that only notes can be added. For the page alone.
    #[serde(skip)]
    pub study_locked: bool,
}

/// A setting of a session.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SettingDetail {
    /// Number of the setting, from 1.
    pub setting: usize,
    /// Identifier of the segment.
    pub segment: SegmentId,
    /// When inspection began, by the server's wall clock.
    #[schema(value_type = Option<String>)]
    pub started: Option<Timestamp>,
    /// Time inspected without pauses, in seconds; none until the inspection is over.
    pub inspected_seconds: Option<f64>,
}

/// An answer, as it is shown.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AnswerLine {
    /// When it was recorded, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// Setting, from 1; none for a closing question.
    pub setting: Option<usize>,
    /// The question's identifier.
    pub question: String,
    /// The question's text.
    pub text: String,
    /// The question's kind; none if it is not known.
    pub kind: Option<&'static str>,
    /// The answer's key.
    pub key: IdempotencyKey,
    /// The answer as it was given.
    pub value: AnswerValue,
    /// The answer in words.
    pub words: String,
    /// The corrected answer; none if it was not corrected.
    pub corrected: Option<AnswerValue>,
    /// The corrected answer in words.
    pub corrected_words: Option<String>,
    /// A researcher's note on the answer.
    pub note: Option<String>,
    /// When its words were erased, by the server's wall clock; none if they were not.
    #[schema(value_type = Option<String>)]
    pub erased: Option<Timestamp>,
    /// Its scores, from the corrected answer if there is one; none if it has no score or an item is missing.
    pub scores: Vec<Measure>,
    /// The score of the System Usability Scale, 0 to 100, for its ten items.
    pub sus_score: Option<f64>,
    /// Whether it replaced an earlier answer.
    pub changed: bool,
    /// Whether another of the surgeon's devices gave a different answer; the timeline shows it.
    pub devices_disagree: bool,
}

/// What unblinding revealed.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Unblinding {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// Reason for the unblinding.
    pub reason: String,
    /// Whether it was an emergency: the session was under way, or its study was blinded.
    pub emergency: bool,
    /// The policy of each setting, in order.
    #[schema(value_type = Vec<String>)]
    pub policies: Vec<PolicyName>,
}

impl Reports {
    /// Session `session` in detail.
    ///
    /// # Errors
    /// If there is no such session, or the database failed.
    #[boxed]
    pub async fn session_detail(&self, session: SessionId) -> Result<SessionDetail, ConductError> {
        let course = self.load(session).await?;
        let withdrawal = self.withdrawal(&course).await?;
        let mut answers = self.answer_lines(&course).await?;
        let mut corrections = self.correction_lines(&course).await?;
        if withdrawal.is_some() {
            answers.clear();
            // Corrections of the participant stay: they say who has withdrawn.
            corrections.retain(|correction| correction.field == Field::Participant);
        }

        let line = self.reader.session_line(session).await?;
        let line = line.ok_or_else(|| ConductError::NotFound("there is no such session".to_owned()))?;
        Ok(SessionDetail {
            line,
            researcher_title: course.protocol.researcher_title.clone(),
            algorithm: course.made.algorithm.name(),
            commitment: course.made.commitment.clone(),
            settings_detail: settings(&course),
            answers,
            corrections,
            consents: self.consent_lines(session).await?,
            withdrawal,
            counts_until: course.grace.until(),
            outstanding: self.outstanding(&course).await?,
            log: self.log(&course).await?,
            unblinding: unblinding(&course),
            study_locked: course.study_locked.is_some(),
        })
    }

    /// The events of the session, and those of camera and lens since the session was made.
    async fn log(&self, course: &Course) -> Result<Vec<LogLine>, ConductError> {
        let clocks = &self.run_clock.clocks;
        let devices = self.reader.device_events(course.session()).await?;

        // In the order in which things happened, even if the wall clock was changed in between.
        let mut lines: Vec<(Timestamp, LogLine)> = Vec::new();
        for (at, event) in course.timed_events() {
            let text = event.kind.in_words(|segment| course.setting(segment));
            let account = event.account.as_ref().map(ToString::to_string);
            let has_reason = event.kind.reason().is_some_and(|reason| !reason.is_empty());
            let is_its_own = !event.kind.has_reason_of_study(course.study.is_some());
            let erasable_event = (has_reason && is_its_own).then_some(event.number);
            let line = LogLine { at: event.wall, by: event.by, account, text, erasable_event };
            lines.push((at, line));
        }

        let made = lines.first().map(|(at, _)| *at);
        for (run, DeviceEvent { wall, at, device, message, .. }) in devices {
            let at = clocks.wall(run, at);
            if Some(at) >= made {
                let text = format!("The {device}: {message}");
                let line = LogLine { at: wall, by: Role::System, account: None, text, erasable_event: None };
                lines.push((at, line));
            }
        }

        lines.extend(self.beside(course.session()).await?);
        lines.sort_by_key(|(at, _)| *at);
        Ok(lines.into_iter().map(|(_, line)| line).collect())
    }

    async fn answer_lines(&self, course: &Course) -> Result<Vec<AnswerLine>, ConductError> {
        let clocks = &self.run_clock.clocks;
        let answers = self.reader.answers(course.session()).await?;
        let standings = standings(&answers, clocks);
        let corrections = LatestCorrections::of(&self.reader.corrections(course.session()).await?);
        let erased = Erased::by(&self.reader.erasures(course.session()).await?);

        let mut lines: Vec<(Timestamp, AnswerLine)> = Vec::new();
        for ((run, answer), standing) in answers.into_iter().zip(standings).filter(|(_, standing)| standing.counts) {
            let question = course.protocol.question(&answer.question, answer.segment.is_some());
            let kind = question.map(|question| &question.kind);
            let corrected = corrections.value(&answer.key);
            let line = AnswerLine {
                at: answer.stamp.wall,
                setting: answer.segment.map(|segment| course.setting(segment)),
                text: question.map(|question| question.text.clone()).unwrap_or_default(),
                sus_score: sus_score(kind, &standing.value),
                kind: kind.map(QuestionKind::name),
                key: answer.key,
                words: in_words(kind, &standing.value),
                corrected_words: corrected.as_ref().map(|value| in_words(kind, value)),
                note: corrections.note(Subject::Answer, &answer.key).map(str::to_owned),
                erased: erased.at(Erasable::Answer, &answer.key),
                scores: kind.map_or_else(Vec::new, |kind| scores(kind, corrected.as_ref().unwrap_or(&standing.value))),
                corrected,
                question: answer.question,
                value: standing.value,
                changed: standing.revision > 1,
                devices_disagree: standing.disagrees,
            };

            lines.push((clocks.entered_at(run, answer.stamp.at, &answer.origin), line));
        }

        lines.sort_by_key(|(given, _)| *given);
        Ok(lines.into_iter().map(|(_, line)| line).collect())
    }
}

/// The scores of an answer without missing items. The weights of a workload index are left out.
fn scores(kind: &QuestionKind, value: &AnswerValue) -> Vec<Measure> {
    let is_shown =
        |measure: &Measure| measure.score && measure.value.is_some() && !measure.name.starts_with("weight-of-");
    measures(kind, value).into_iter().filter(is_shown).collect()
}

fn settings(course: &Course) -> Vec<SettingDetail> {
    let inspections = inspections(course.events.iter().map(|event| (event, &event.kind)));
    let detail = |(&segment, setting): (&SegmentId, usize)| {
        let inspection = inspections.iter().find(|inspection| inspection.segment == segment);
        SettingDetail {
            setting,
            segment,
            started: inspection.map(|inspection| inspection.began.wall),
            inspected_seconds: inspection.and_then(|inspection| inspection.inspected).map(|time| time.as_secs_f64()),
        }
    };

    course.state.segments().iter().zip(1..).map(detail).collect()
}

fn unblinding(course: &Course) -> Option<Unblinding> {
    course.events.iter().find_map(|event| match &event.kind {
        EventKind::Unblinded { reason, emergency } => Some(Unblinding {
            at: event.wall,
            reason: reason.clone(),
            emergency: *emergency,
            policies: course.made.segments.iter().map(|(_, policy)| policy.clone()).collect(),
        }),
        _ => None,
    })
}
