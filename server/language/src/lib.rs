//! The languages in which surgeons read parfocal. Each has one file in `web/languages/`, in Mozilla's format Fluent
//! (<https://projectfluent.org>). The server and the pages read the same files; they are built into the program.

mod markup;
mod message;

use std::fmt;
use std::sync::LazyLock;

use fluent_bundle::concurrent::FluentBundle;
use fluent_bundle::{FluentArgs, FluentResource};
use serde::{Deserialize, Serialize};
use unic_langid::LanguageIdentifier;
use utoipa::ToSchema;

pub use message::{Argument, Message};

/// A language that surgeons can read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub enum Language {
    /// English.
    #[default]
    #[serde(rename = "en")]
    English,
    /// German.
    #[serde(rename = "de")]
    German,
    /// French.
    #[serde(rename = "fr")]
    French,
    /// Spanish.
    #[serde(rename = "es")]
    Spanish,
}

/// The messages of one language.
type Bundle = FluentBundle<FluentResource>;

/// Those of each language, in the order of [`Language::ALL`].
static BUNDLES: LazyLock<[Bundle; 4]> = LazyLock::new(|| Language::ALL.map(bundle));

fn bundle(language: Language) -> Bundle {
    // A code that cannot be read would be taken for English. A test reads them all.
    let locale: LanguageIdentifier = language.code().parse().unwrap_or_default();
    let mut bundle = FluentBundle::new_concurrent(vec![locale]);
    // Words of people are isolated where they stand in a sentence: `Argument`.
    bundle.set_use_isolating(false);

    // What can be read of a file with a fault is taken; a test reads all files.
    let resource = FluentResource::try_new(language.source().to_owned()).unwrap_or_else(|(resource, _)| resource);
    bundle.add_resource_overriding(resource);
    bundle
}

impl Language {
    /// All languages, in the order in which they are declared.
    pub const ALL: [Self; 4] = [Self::English, Self::German, Self::French, Self::Spanish];

    /// The language's code, as protocols and pages name it (BCP 47).
    pub const fn code(self) -> &'static str {
        match self {
            Self::English => "en",
            Self::German => "de",
            Self::French => "fr",
            Self::Spanish => "es",
        }
    }

    /// The language with this code; none if surgeons cannot read parfocal in it.
    pub fn from_code(code: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|language| language.code() == code)
    }

    /// The language's name in English.
    pub const fn name(self) -> &'static str {
        match self {
            Self::English => "English",
            Self::German => "German",
            Self::French => "French",
            Self::Spanish => "Spanish",
        }
    }

    /// The direction in which the language is written, as HTML has it.
    pub const fn direction(self) -> &'static str {
        match self {
            Self::English | Self::German | Self::French | Self::Spanish => "ltr",
        }
    }

    /// The language's file: all messages, in Fluent.
    pub const fn source(self) -> &'static str {
        match self {
            Self::English => include_str!("../../../web/languages/en.ftl"),
            Self::German => include_str!("../../../web/languages/de.ftl"),
            Self::French => include_str!("../../../web/languages/fr.ftl"),
            Self::Spanish => include_str!("../../../web/languages/es.ftl"),
        }
    }

    /// The message `id` without arguments.
    pub fn say(self, id: &str) -> String {
        self.format(id, None, None)
    }

    /// The languages' codes, for a sentence.
    pub fn codes() -> String {
        Self::ALL.map(Self::code).join(", ")
    }

    fn bundle(self) -> &'static Bundle {
        &BUNDLES[self as usize]
    }

    /// The value of message `id`, or of its `attribute`. A message that is missing is shown by its id; a test looks for
    /// missing ones.
    fn format(self, id: &str, attribute: Option<&str>, args: Option<&FluentArgs<'_>>) -> String {
        let found = || {
            let bundle = self.bundle();
            let message = bundle.get_message(id)?;
            let pattern = match attribute {
                None => message.value()?,
                Some(name) => message.get_attribute(name)?.value(),
            };
            Some(bundle.format_pattern(pattern, args, &mut Vec::new()).into_owned())
        };
        found().unwrap_or_else(|| id.to_owned())
    }
}

impl fmt::Display for Language {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_can_be_read_without_a_fault() {
        for language in Language::ALL {
            let faults = FluentResource::try_new(language.source().to_owned()).map_err(|(_, faults)| faults);
            assert!(faults.is_ok(), "{language}: {:?}", faults.err());
            let locale: LanguageIdentifier = language.code().parse().unwrap();
            assert_eq!(locale.to_string(), language.code());
        }
    }

    #[test]
    fn each_language_is_known_by_its_code_and_no_other_is() {
        for language in Language::ALL {
            assert_eq!(Language::from_code(language.code()), Some(language));
            let written = format!("\"{}\"", language.code());
            assert!(matches!(serde_code(language), text if text == written), "{language}");
        }
        assert_eq!(Language::from_code("DE"), None);
        assert_eq!(Language::from_code("it"), None);
        assert_eq!(Language::codes(), "en, de, fr, es");
    }

    /// The code that serde writes, taken from the derive's own names.
    fn serde_code(language: Language) -> String {
        use serde::de::IntoDeserializer;
        use serde::de::value::{Error, StrDeserializer};
        let read: Result<Language, Error> = Language::deserialize(IntoDeserializer::<Error>::into_deserializer(
            language.code(),
        ) as StrDeserializer<'_, _>);
        read.map_or_else(|error| error.to_string(), |read| format!("\"{read}\""))
    }
}
