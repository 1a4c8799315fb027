//! Instruments: which answers each kind of question takes, and how they are scored, as published. Missing values stay
//! missing: a questionnaire with an unanswered item has no score.

mod likert;
mod measure;
pub mod nasa_tlx;
mod ranking;
pub mod recognition;
pub mod surg_tlx;
pub mod sus;
mod visual_analogue;
mod workload;

pub use measure::Measure;

use super::question::{AnswerValue, QuestionKind, Scale};
use measure::in_words as item_in_words;

/// Whether `value` is an answer to a question of `kind` in a session of `settings` settings. A questionnaire also takes
/// partial answers.
pub fn fits(kind: &QuestionKind, value: &AnswerValue, settings: usize) -> bool {
    match (kind, value) {
        (QuestionKind::Text, AnswerValue::Text(_)) => true,
        (QuestionKind::Likert { points, .. }, AnswerValue::Point(point)) => (1..=*points).contains(point),
        (QuestionKind::VisualAnalogue { .. }, AnswerValue::Point(place)) => visual_analogue::fits(*place),
        (QuestionKind::Recognition, AnswerValue::Point(point)) => recognition::fits(*point),
        (QuestionKind::Ranking { ties: false }, AnswerValue::Points(order)) => ranking::is_order(order, settings),
        (QuestionKind::Ranking { ties: true }, AnswerValue::Points(places)) => ranking::are_places(places, settings),
        (QuestionKind::Sus { .. }, AnswerValue::Points(items)) => sus::fits(items),
        (QuestionKind::NasaTlx { scales }, AnswerValue::Points(items)) => workload::fits(items, scales.len(), 0),
        (QuestionKind::SurgTlx { scales, pairs }, AnswerValue::Points(items)) => {
            workload::fits(items, scales.len(), pairs.len())
        }
        _ => false,
    }
}

/// The score of the System Usability Scale; `None` for another kind of question, and if an item is missing.
pub fn sus_score(kind: Option<&QuestionKind>, value: &AnswerValue) -> Option<f64> {
    match (kind, value) {
        (Some(QuestionKind::Sus { .. }), AnswerValue::Points(items)) => sus::score(items),
        _ => None,
    }
}

/// The answers that a question of `kind` takes in a session of `settings` settings, in words.
pub fn expected(kind: &QuestionKind, settings: usize) -> String {
    let gradations = |scales: &[Scale]| format!("{} gradations from 1 to {}", scales.len(), workload::GRADATIONS);
    match kind {
        QuestionKind::Text => "text".to_owned(),
        QuestionKind::Likert { points, .. } => format!("a point from 1 to {points}"),
        QuestionKind::VisualAnalogue { .. } => format!("a whole number from 0 to {}", visual_analogue::LONGEST),
        QuestionKind::Recognition => "1 for no, 2 for not sure, 3 for yes".to_owned(),
        QuestionKind::Ranking { ties: false } => {
            format!("each of the settings 1 to {settings} once, best first")
        }
        QuestionKind::Ranking { ties: true } => {
            format!("a place from 1 to {settings} for each of the {settings} settings, {OPEN}")
        }
        QuestionKind::Sus { .. } => format!("{} points from 1 to 5, {OPEN}", sus::ITEMS),
        QuestionKind::NasaTlx { scales } => format!("{}, {OPEN}", gradations(scales)),
        QuestionKind::SurgTlx { scales, pairs } if pairs.is_empty() => format!("{}, {OPEN}", gradations(scales)),
        QuestionKind::SurgTlx { scales, pairs } => {
            format!("{} and {} choices of 1 or 2, {OPEN}", gradations(scales), pairs.len())
        }
    }
}

/// Tells how to write an item that an answer does not give.
const OPEN: &str = "0 for an item that stays as it was";

/// The items and scores of an answer; empty for a text.
pub fn measures(kind: &QuestionKind, value: &AnswerValue) -> Vec<Measure> {
    match (kind, value) {
        (QuestionKind::Likert { .. }, AnswerValue::Point(point)) => likert::measures(*point),
        (QuestionKind::VisualAnalogue { .. }, AnswerValue::Point(place)) => visual_analogue::measures(*place),
        (QuestionKind::Recognition, AnswerValue::Point(point)) => recognition::measures(*point),
        (QuestionKind::Ranking { ties }, AnswerValue::Points(points)) => ranking::measures(points, *ties),
        (QuestionKind::Sus { .. }, AnswerValue::Points(items)) => sus::measures(items),
        (QuestionKind::NasaTlx { scales }, AnswerValue::Points(items)) => nasa_tlx::measures(scales, items),
        (QuestionKind::SurgTlx { scales, pairs }, AnswerValue::Points(items)) => {
            surg_tlx::measures(scales, pairs, items)
        }
        _ => Vec::new(),
    }
}

/// An answer in words, for people. Without `kind` the points are listed without their meaning.
pub fn in_words(kind: Option<&QuestionKind>, value: &AnswerValue) -> String {
    match (kind, value) {
        (Some(QuestionKind::Likert { labels, .. }), AnswerValue::Point(point)) => likert::in_words(labels, *point),
        (Some(QuestionKind::Recognition), AnswerValue::Point(point)) => recognition::in_words(*point),
        (Some(QuestionKind::Ranking { ties: true }), AnswerValue::Points(places)) => ranking::in_words(places),
        (Some(QuestionKind::NasaTlx { scales } | QuestionKind::SurgTlx { scales, .. }), AnswerValue::Points(items)) => {
            workload::in_words(scales, items)
        }
        (_, AnswerValue::Point(point)) => point.to_string(),
        (_, AnswerValue::Points(points)) => {
            points.iter().map(|point| item_in_words(*point)).collect::<Vec<_>>().join(", ")
        }
        (_, AnswerValue::Text(text)) => text.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_language::Language;

    #[test]
    fn words_have_no_measures_and_no_answer_fits_another_sort_of_question() {
        let text = AnswerValue::Text("sharp".to_owned());
        assert_eq!(measures(&QuestionKind::Text, &text), []);
        let kinds = [
            QuestionKind::Likert { points: 5, low: String::new(), high: String::new(), labels: Vec::new() },
            QuestionKind::VisualAnalogue { low: String::new(), high: String::new() },
            QuestionKind::Ranking { ties: true },
            sus::question(Language::English).unwrap(),
            nasa_tlx::question(Language::English).unwrap(),
            surg_tlx::question(true, Language::English).unwrap(),
            QuestionKind::Recognition,
        ];
        for kind in kinds {
            assert!(!fits(&kind, &text, 6), "{kind:?}");
            assert!(!fits(&QuestionKind::Text, &AnswerValue::Point(1), 6));
            assert!(!expected(&kind, 6).is_empty());
        }
    }
}
