//! The items and scores of a session's answers, as numbers. For each question, that is the answer that counts, with its
//! correction applied.

use super::blinded::Blinded;
use super::description::ScoreRow;
use crate::store::{LatestCorrections, standings};
use parfocal_trial::instruments::measures;

impl Blinded {
    /// A row for each item and each score.
    pub(super) fn score_rows(&self) -> Vec<ScoreRow> {
        // If this version cannot read the protocol, it cannot know the questions.
        let Some(protocol) = &self.protocol else { return Vec::new() };
        let corrections = LatestCorrections::of(&self.corrections);
        let standings = standings(&self.answers, &self.clocks);

        let mut rows = Vec::new();
        for ((_, answer), standing) in self.answers.iter().zip(&standings).filter(|(_, standing)| standing.counts) {
            let Some(question) = protocol.question(&answer.question, answer.segment.is_some()) else { continue };
            let corrected = corrections.value(&answer.key);
            let value = corrected.as_ref().unwrap_or(&standing.value);

            rows.extend(measures(&question.kind, value).into_iter().map(|measure| ScoreRow {
                session: self.session(),
                setting: self.setting(answer.segment),
                segment: answer.segment,
                question: answer.question.clone(),
                kind: question.kind.name(),
                measure: measure.name,
                label: measure.label,
                value: measure.value,
                computed: measure.score,
                corrected: corrected.is_some(),
            }));
        }
        rows
    }
}
