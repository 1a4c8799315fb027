//! Answers: whether an answer fits its question, and how partial answers are combined.

use super::instruments;
use super::question::{AnswerValue, Question};
use super::refusal::{Refusal, RefusalKind};
use parfocal_language::Message;

/// Maximum length of the text of an answer or comment, in bytes of UTF-8: about 2500 words.
pub const LONGEST_TEXT: usize = 16 * 1024;

/// Checks that `value` is an answer to `question` in a session of `settings` settings.
///
/// # Errors
/// If it is not. The error says which answers the question takes.
pub fn check(question: &Question, value: &AnswerValue, settings: usize) -> Result<(), Refusal> {
    if !instruments::fits(&question.kind, value, settings) {
        let expected = instruments::expected(&question.kind, settings);
        return Err(Refusal::Invalid(format!("question '{}' takes {expected}", question.id)));
    }
    match value {
        AnswerValue::Text(text) => check_length(text),
        AnswerValue::Point(_) | AnswerValue::Points(_) => Ok(()),
    }
}

/// Checks the length of a text.
///
/// # Errors
/// If it is longer than [`LONGEST_TEXT`].
pub fn check_length(text: &str) -> Result<(), Refusal> {
    if text.len() <= LONGEST_TEXT {
        return Ok(());
    }
    let too_long = Message::new("refused-too-long").number("length", text.len()).number("limit", LONGEST_TEXT);
    Err(Refusal::Said(RefusalKind::Invalid, too_long))
}

/// The answer after `given` was added to `earlier`. A 0 among the points keeps the earlier point. So each item of a
/// questionnaire can be answered by itself, from any device, and no item removes another.
pub fn on_top_of(earlier: Option<&AnswerValue>, given: AnswerValue) -> AnswerValue {
    match (earlier, given) {
        (Some(AnswerValue::Points(before)), AnswerValue::Points(mut points)) if before.len() == points.len() => {
            for (point, before) in points.iter_mut().zip(before).filter(|(point, _)| **point == 0) {
                *point = *before;
            }
            AnswerValue::Points(points)
        }
        (_, given) => given,
    }
}

/// Whether nothing of `value` is left open: every item has a point, and a text has words.
pub fn is_whole(value: &AnswerValue) -> bool {
    match value {
        AnswerValue::Point(_) => true,
        AnswerValue::Points(points) => !points.contains(&0),
        AnswerValue::Text(text) => !text.trim().is_empty(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instruments::sus::ITEMS as SUS_ITEMS;
    use crate::question::QuestionKind;

    fn question(kind: QuestionKind) -> Question {
        Question { id: "q".to_owned(), text: "?".to_owned(), kind, optional: false, only_if_yes: None }
    }

    #[test]
    fn the_items_of_a_questionnaire_add_up_in_any_order_and_the_latest_of_each_counts() {
        let sus = question(crate::instruments::sus::question(parfocal_language::Language::English).unwrap());
        let item = |place: usize, point: u8| {
            let mut items = vec![0; SUS_ITEMS];
            items[place] = point;
            AnswerValue::Points(items)
        };

        let mut kept = None;
        for (place, point) in [(9, 2), (0, 4), (1, 2), (2, 3), (3, 1), (4, 1), (5, 3), (6, 2), (7, 2), (8, 4), (4, 4)] {
            assert!(!kept.as_ref().is_some_and(is_whole) || place == 4);
            let given = item(place, point);
            assert_eq!(check(&sus, &given, 6), Ok(()));
            kept = Some(on_top_of(kept.as_ref(), given));
        }

        let whole = AnswerValue::Points(vec![4, 2, 3, 1, 4, 3, 2, 2, 4, 2]);
        assert_eq!(kept.as_ref(), Some(&whole));
        assert!(is_whole(&whole));
        for nothing in [vec![0; SUS_ITEMS], vec![3; 9], vec![6; SUS_ITEMS]] {
            assert!(check(&sus, &AnswerValue::Points(nothing), 6).is_err());
        }
    }

    #[test]
    fn a_later_answer_of_one_piece_takes_the_place_of_the_earlier() {
        let before = AnswerValue::Points(vec![1, 2, 3]);
        let after = AnswerValue::Points(vec![3, 1, 2]);
        assert_eq!(on_top_of(Some(&before), after.clone()), after);
        assert_eq!(on_top_of(Some(&AnswerValue::Point(3)), AnswerValue::Point(5)), AnswerValue::Point(5));
    }

    #[test]
    fn a_ranking_names_every_setting_once() {
        let ranking = question(QuestionKind::Ranking { ties: false });
        assert_eq!(check(&ranking, &AnswerValue::Points(vec![3, 1, 2]), 3), Ok(()));
        for wrong in [vec![1, 2], vec![1, 2, 2], vec![0, 1, 2], vec![1, 2, 4], vec![1, 2, 3, 4]] {
            let misfit = check(&ranking, &AnswerValue::Points(wrong), 3).unwrap_err();
            assert!(misfit.to_string().contains("1 to 3"), "{misfit}");
        }
    }

    #[test]
    fn a_likert_point_stays_on_its_scale() {
        let low = "l".to_owned();
        let high = "h".to_owned();
        let likert = question(QuestionKind::Likert { points: 7, low, high, labels: Vec::new() });
        assert_eq!(check(&likert, &AnswerValue::Point(7), 6), Ok(()));
        assert!(check(&likert, &AnswerValue::Point(0), 6).is_err());
        assert!(check(&likert, &AnswerValue::Point(8), 6).is_err());
        assert!(check(&likert, &AnswerValue::Text("7".to_owned()), 6).is_err());
    }

    #[test]
    fn a_text_up_to_the_limit_is_taken_and_the_limit_is_named() {
        let text = question(QuestionKind::Text);
        assert_eq!(check(&text, &AnswerValue::Text("é".repeat(LONGEST_TEXT / 2)), 6), Ok(()));
        let misfit = check(&text, &AnswerValue::Text("x".repeat(1_000_000)), 6).unwrap_err();
        assert!(misfit.to_string().contains("16384"), "{misfit}");
    }
}
