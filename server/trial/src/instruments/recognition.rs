//! Whether the surgeon thinks they recognised settings. This question is used to judge how well the blinding worked
//! (Bang, Ni & Davis 2004, Controlled Clinical Trials 25:143; they ask for a guess and accept "don't know"). It does
//! not ask which policy ran, because surgeons know no policy by name.

use super::measure::{Measure, given};
use crate::question::{Question, QuestionKind};
use parfocal_language::Language;

const WORDS: [&str; 3] = ["No", "Not sure", "Yes"];

/// Whether `point` is one of the three answers.
pub fn fits(point: u8) -> bool {
    (1..=WORDS.len()).contains(&usize::from(point))
}

/// The question that follows a yes: the guess alone does not tell what gave the setting away. `closing` says whether
/// the recognition question `id` is about all settings.
pub fn follow_up(id: &str, closing: bool, language: Language) -> Question {
    let text = if closing { "recognised-which" } else { "recognised-this" };
    Question {
        id: format!("{id}-why"),
        text: language.say(text),
        kind: QuestionKind::Text,
        optional: true,
        only_if_yes: Some(id.to_owned()),
    }
}

/// 1 for no, 2 for not sure, 3 for yes.
pub fn measures(point: u8) -> Vec<Measure> {
    vec![Measure::item("recognised", "Recognised: 1 no, 2 not sure, 3 yes", given(point))]
}

/// The answer in words.
pub fn in_words(point: u8) -> String {
    let word = usize::from(point).checked_sub(1).and_then(|place| WORDS.get(place));
    word.map_or_else(|| point.to_string(), |word| (*word).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_three_answers() {
        assert_eq!([1, 2, 3].map(in_words), ["No", "Not sure", "Yes"]);
        assert!(!fits(0) && fits(1) && fits(3) && !fits(4));
    }
}
