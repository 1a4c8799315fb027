//! The items and scores of a session's answers, as numbers. For each question, that is the answer that counts, with its
//! correction applied.

use super::description::ScoreRow;
use crate::store::{Answer, LatestCorrections};
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_trial::instruments::{Measure, measures};
use parfocal_trial::protocol::Protocol;
use parfocal_trial::standing::AnswerStanding;

/// What the scores of a session are computed from.
pub struct Scored<'a> {
    /// The session.
    pub session: SessionId,
    /// Its protocol, which says what was asked.
    pub protocol: &'a Protocol,
    /// Its segments, in order.
    pub segments: &'a [SegmentId],
    /// Its answers, each with the start of the server that kept it.
    pub answers: &'a [(i64, Answer)],
    /// The standing of each answer, in the same order: whether it counts, and its full value.
    pub standings: &'a [AnswerStanding],
    /// The corrections of the session.
    pub corrections: &'a LatestCorrections,
}

impl Scored<'_> {
    /// A row for each item and each score.
    pub fn rows(&self) -> Vec<ScoreRow> {
        let answers = self.answers.iter().map(|(_, answer)| answer).zip(self.standings);
        answers
            .filter(|(_, standing)| standing.counts)
            .flat_map(|(answer, standing)| self.of(answer, standing))
            .collect()
    }

    fn of(&self, answer: &Answer, standing: &AnswerStanding) -> Vec<ScoreRow> {
        let Some(question) = self.protocol.question(&answer.question, answer.segment.is_some()) else {
            return Vec::new();
        };

        let corrected = self.corrections.value(&answer.key);
        let value = corrected.as_ref().unwrap_or(&standing.value);
        let setting = self.segments.iter().position(|&known| Some(known) == answer.segment).map(|place| place + 1);
        let row = |measure: Measure| ScoreRow {
            session: self.session,
            setting,
            segment: answer.segment,
            question: answer.question.clone(),
            kind: question.kind.name(),
            measure: measure.name,
            label: measure.label,
            value: measure.value,
            computed: measure.score,
            corrected: corrected.is_some(),
        };
        measures(&question.kind, value).into_iter().map(row).collect()
    }
}
