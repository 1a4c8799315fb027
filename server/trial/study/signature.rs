//! Who changes a study, by which way, and why.

use super::refusal::StudyRefusal;
use crate::trial::role::Role;

/// Longest reason, characters.
const LONGEST_REASON: usize = 1000;
/// Longest name of a person, characters.
const LONGEST_PERSON: usize = 200;

/// By which way something was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// On a page or through the interface, by this role.
    Role(Role),
    /// By a command.
    CommandLine,
}

impl Way {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Role(role) => role.name(),
            Self::CommandLine => "command-line",
        }
    }

    /// The way called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        if name == Self::CommandLine.name() { Some(Self::CommandLine) } else { Role::named(name).map(Self::Role) }
    }
}

/// Who does something to a study, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signature {
    /// The person, by name or function. Nobody checks it yet.
    pub person: String,
    /// Why.
    pub reason: String,
}

impl Signature {
    /// A signature of `person` with `reason`.
    ///
    /// # Errors
    /// When one of them is missing or too long.
    pub fn new(person: &str, reason: &str) -> Result<Self, StudyRefusal> {
        let person = person.trim();
        let reason = reason.trim();

        if !(1..=LONGEST_PERSON).contains(&person.chars().count()) {
            return Err(StudyRefusal::NoPerson { longest: LONGEST_PERSON });
        }
        if !(1..=LONGEST_REASON).contains(&reason.chars().count()) {
            return Err(StudyRefusal::NoReason { longest: LONGEST_REASON });
        }
        Ok(Self { person: person.to_owned(), reason: reason.to_owned() })
    }
}
