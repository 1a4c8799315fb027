//! Who changes a study, by which way, and why.

use super::refusal::StudyRefusal;
use crate::trial::account::{Account, AccountName};
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
    /// The person, by name or function: the display name of the account, or what the command line was told.
    pub person: String,
    /// Why.
    pub reason: String,
    /// The account under which the person signed in; none for the command line.
    pub account: Option<AccountName>,
}

impl Signature {
    /// A signature of `person` with `reason`, by the command line, where nobody signs in.
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
        Ok(Self { person: person.to_owned(), reason: reason.to_owned(), account: None })
    }
    /// A signature of whoever is signed in to `account`, with `reason`.
    ///
    /// # Errors
    /// When the reason is missing or too long.
    pub fn of_account(account: &Account, reason: &str) -> Result<Self, StudyRefusal> {
        Ok(Self { account: Some(account.account.clone()), ..Self::new(&account.display, reason)? })
    }
}
