//! What the operator's and researcher's pages read: participants, protocols, sessions, one session in detail.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::course::Course;
use super::{ConductError, Conductor, ProtocolSummary, operator_only};
use crate::autofocus::PolicyName;
use crate::ids::{SegmentId, SessionId};
use crate::store::{DeviceEvent, Participant, Reader, SessionLine};
use crate::trial::answers::sus_score;
use crate::trial::event::{Event, EventKind};
use crate::trial::participant::ParticipantCode;
use crate::trial::view::{AnswerValue, LogLine, QuestionKind, Role};

/// A session in detail, for the researcher. Policies are in it once it was unblinded, and not before.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SessionDetail {
    /// Its line in the list.
    #[serde(flatten)]
    pub line: SessionLine,
    /// Protocol's title for researchers.
    pub researcher_title: String,
    /// Algorithm that drew the order.
    pub algorithm: &'static str,
    /// SHA-256 that commits to the order since the session was made.
    pub commitment: String,
    /// Its settings, in order.
    pub settings_detail: Vec<SettingDetail>,
    /// Answers that count, in the order they were given.
    pub answers: Vec<AnswerLine>,
    /// Everything that happened, oldest first.
    pub log: Vec<LogLine>,
    /// What unblinding told, if it happened.
    pub unblinding: Option<Unblinding>,
}

/// A setting of a session.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SettingDetail {
    /// Number, from 1.
    pub setting: usize,
    /// Segment.
    pub segment: SegmentId,
    /// When inspection began, by the server's wall clock.
    #[schema(value_type = Option<String>)]
    pub started: Option<Timestamp>,
    /// Time inspected without pauses, seconds, once it is over.
    pub inspected_seconds: Option<f64>,
}

/// An answer for reading.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AnswerLine {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// Setting, from 1; none for a closing question.
    pub setting: Option<usize>,
    /// Question's id.
    pub question: String,
    /// The question.
    pub text: String,
    /// The answer.
    pub value: AnswerValue,
    /// The System Usability Scale's score, 0..=100, for its ten items.
    pub sus_score: Option<f64>,
    /// Whether it replaced an earlier answer.
    pub changed: bool,
}

/// What unblinding told.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Unblinding {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// Why.
    pub reason: String,
    /// Whether the session was still under way.
    pub emergency: bool,
    /// The policy of each setting, in order.
    #[schema(value_type = Vec<String>)]
    pub policies: Vec<PolicyName>,
}

impl Conductor {
    /// For reading what is kept.
    #[must_use]
    pub fn reader(&self) -> &Reader {
        self.shared.store.reader()
    }

    /// The participants, by code.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn participants(&self) -> Result<Vec<Participant>, ConductError> {
        Ok(self.shared.store.reader().participants().await?)
    }

    /// Adds a participant; one that is there already stays.
    ///
    /// # Errors
    /// When `code` is no code, or the disk failed.
    pub async fn add_participant(&self, by: Role, code: &str) -> Result<(), ConductError> {
        if by != Role::Researcher {
            operator_only(by)?;
        }
        let code = ParticipantCode::new(code).map_err(|error| ConductError::Invalid(error.to_string()))?;
        Ok(self.shared.store.add_participant(code.as_str(), self.shared.clock.wall()).await?)
    }

    /// The protocols, by name.
    #[must_use]
    pub fn protocols(&self) -> Vec<ProtocolSummary> {
        self.shared.library.summaries()
    }

    /// The sessions, newest first; practice only where `practice` is set.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn sessions(&self, practice: bool) -> Result<Vec<SessionLine>, ConductError> {
        Ok(self.shared.store.reader().sessions(practice).await?)
    }

    /// Session `session` in detail.
    ///
    /// # Errors
    /// When there is none, or the database failed.
    pub async fn session_detail(&self, session: SessionId) -> Result<SessionDetail, ConductError> {
        let course = self.shared.load(session).await?;
        let lines = self.sessions(true).await?;
        let line = lines.into_iter().find(|line| line.session == session);
        let line = line.ok_or_else(|| ConductError::NotFound("there is no such session".to_owned()))?;
        Ok(SessionDetail {
            line,
            researcher_title: course.protocol.researcher_title.clone(),
            algorithm: course.made.algorithm.name(),
            commitment: course.made.commitment.clone(),
            settings_detail: settings(&course),
            answers: self.answer_lines(&course).await?,
            log: self.log(&course).await?,
            unblinding: unblinding(&course),
        })
    }

    /// What happened in the session, and to camera and lens since it was made.
    async fn log(&self, course: &Course) -> Result<Vec<LogLine>, ConductError> {
        let line = |event: &Event| LogLine {
            at: event.wall,
            by: event.by,
            text: event.kind.in_words(|segment| course.setting(segment)),
        };
        let mut lines: Vec<LogLine> = course.events.iter().map(line).collect();
        let made = lines.first().map(|line| line.at);
        let devices = self.shared.store.reader().device_events(course.session()).await?;
        let since = devices.into_iter().map(|(_, _, event)| event).filter(|event| Some(event.wall) >= made);
        lines.extend(since.map(|DeviceEvent { wall, device, message, .. }| LogLine {
            at: wall,
            by: Role::System,
            text: format!("The {device}: {message}"),
        }));
        lines.sort_by_key(|line| line.at);
        Ok(lines)
    }

    async fn answer_lines(&self, course: &Course) -> Result<Vec<AnswerLine>, ConductError> {
        let mut latest: BTreeMap<(Option<SegmentId>, String), usize> = BTreeMap::new();
        let mut lines: Vec<Option<AnswerLine>> = Vec::new();
        for (_, answer) in self.shared.store.reader().answers(course.session()).await? {
            let question = course.protocol.question(&answer.question, answer.segment.is_some());
            let before = latest.insert((answer.segment, answer.question.clone()), lines.len());
            if let Some(before) = before {
                lines[before] = None;
            }
            lines.push(Some(AnswerLine {
                at: answer.stamp.wall,
                setting: answer.segment.map(|segment| course.setting(segment)),
                text: question.map(|question| question.text.clone()).unwrap_or_default(),
                sus_score: match (question.map(|question| &question.kind), &answer.value) {
                    (Some(QuestionKind::Sus), AnswerValue::Points(items)) => sus_score(items),
                    _ => None,
                },
                question: answer.question,
                value: answer.value,
                changed: before.is_some(),
            }));
        }
        Ok(lines.into_iter().flatten().collect())
    }
}

fn settings(course: &Course) -> Vec<SettingDetail> {
    let detail = |(&segment, setting): (&SegmentId, usize)| {
        let of_it = || course.events.iter().filter(move |event| event.kind.segment() == Some(segment));
        SettingDetail {
            setting,
            segment,
            started: of_it()
                .find(|event| matches!(event.kind, EventKind::SegmentStarted { .. }))
                .map(|event| event.wall),
            inspected_seconds: of_it().find_map(|event| match event.kind {
                EventKind::SegmentFinished { inspected_ms, .. } => {
                    Some(std::time::Duration::from_millis(inspected_ms).as_secs_f64())
                }
                _ => None,
            }),
        }
    };
    course.state.plan().segments.iter().zip(1..).map(detail).collect()
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
