//! A message with its arguments, which becomes a sentence only when it is known who reads it.

use std::fmt;

use fluent_bundle::FluentArgs;

use super::Language;

/// A sentence that can be said in every language. It is shown in English where nothing else is asked for: to operators
/// and researchers, and in the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    id: &'static str,
    arguments: Vec<(&'static str, Argument)>,
}

/// What is put into a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Argument {
    /// A number, which chooses between one and many.
    Number(u64),
    /// Words of people, such as a question. They may be written in another direction than the sentence.
    Words(String),
}

/// Around words whose direction the browser finds out by itself (Unicode's first strong isolate).
const ISOLATED: [char; 2] = ['\u{2068}', '\u{2069}'];

impl Message {
    /// The message with this id in the languages' files.
    pub const fn new(id: &'static str) -> Self {
        Self { id, arguments: Vec::new() }
    }

    /// The same with a number.
    #[must_use]
    pub fn number(mut self, name: &'static str, number: impl TryInto<u64>) -> Self {
        let number = number.try_into().unwrap_or(u64::MAX);
        self.arguments.push((name, Argument::Number(number)));
        self
    }

    /// The same with words of people.
    #[must_use]
    pub fn words(mut self, name: &'static str, words: impl Into<String>) -> Self {
        self.arguments.push((name, Argument::Words(words.into())));
        self
    }

    /// The sentence in `language`.
    pub fn say_in(&self, language: Language) -> String {
        let mut args = FluentArgs::new();
        for (name, argument) in &self.arguments {
            match argument {
                Argument::Number(number) => args.set(*name, *number),
                Argument::Words(words) if reads_left_to_right(words) => args.set(*name, words.clone()),
                Argument::Words(words) => args.set(*name, format!("{}{words}{}", ISOLATED[0], ISOLATED[1])),
            }
        }
        language.format(self.id, None, Some(&args))
    }
}

/// Whether no letter of `words` is written from right to left: all such letters stand from Hebrew on, among those that
/// the languages of our files do not use.
fn reads_left_to_right(words: &str) -> bool {
    words.chars().all(|letter| letter < '\u{0590}' || !letter.is_alphabetic())
}

impl fmt::Display for Message {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.say_in(Language::English))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_said_in_each_language_and_in_english_where_nobody_asks() {
        let message = Message::new("refused-too-long").number("length", 9_000_u32).number("limit", 8_000_u32);
        assert_eq!(message.to_string(), "the text is 9000 bytes long; the limit is 8000, so please split it");
        let all: std::collections::BTreeSet<_> =
            Language::ALL.into_iter().map(|language| message.say_in(language)).collect();
        assert_eq!(all.len(), Language::ALL.len(), "{all:?}");
    }

    #[test]
    fn words_that_read_from_right_to_left_do_not_turn_the_sentence() {
        let open = |question: &str| Message::new("refused-still-open").words("question", question).to_string();
        assert_eq!(open("How was it?"), "still to be answered: How was it?");
        assert_eq!(open("كيف كان؟"), "still to be answered: \u{2068}كيف كان؟\u{2069}");
    }
}
