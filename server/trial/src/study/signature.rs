//! Signatures: who changes a study, how, and why.

use crate::account::{Account, AccountName};
use crate::refusal::Refusal;
use crate::role::Role;

/// Maximum length of a reason, in characters.
const LONGEST_REASON: usize = 1000;
/// Maximum length of a person's name, in characters.
const LONGEST_PERSON: usize = 200;

/// How something was done to a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// On a page or through the HTTP interface, in this role.
    Role(Role),
    /// With a command.
    CommandLine,
}

impl Channel {
    /// The way's name, as in the database and in exports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Role(role) => role.name(),
            Self::CommandLine => "command-line",
        }
    }

    /// The way with this name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        if name == Self::CommandLine.name() { Some(Self::CommandLine) } else { Role::named(name).map(Self::Role) }
    }
}

/// The person who does something to a study, and the reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signature {
    /// Name or function of the person: the display name of the account, or as given on the command line.
    pub person: String,
    /// Reason for the change.
    pub reason: String,
    /// Account to which the person is signed in; none on the command line.
    pub account: Option<AccountName>,
}

impl Signature {
    /// A signature of `person` with `reason`, from the command line, where nobody is signed in.
    ///
    /// # Errors
    /// If the name or the reason is missing or too long.
    pub fn new(person: &str, reason: &str) -> Result<Self, Refusal> {
        let person = person.trim();
        let reason = reason.trim();

        if !(1..=LONGEST_PERSON).contains(&person.chars().count()) {
            return Err(Refusal::Invalid(format!(
                "say who you are, in 1 to {LONGEST_PERSON} characters: it is kept with the change"
            )));
        }
        if !(1..=LONGEST_REASON).contains(&reason.chars().count()) {
            return Err(Refusal::Invalid(format!(
                "give a reason, in 1 to {LONGEST_REASON} characters: it is kept with the change"
            )));
        }
        Ok(Self { person: person.to_owned(), reason: reason.to_owned(), account: None })
    }

    /// A signature of the person who is signed in to `account`, with `reason`.
    ///
    /// # Errors
    /// If the reason is missing or too long.
    pub fn of_account(account: &Account, reason: &str) -> Result<Self, Refusal> {
        Ok(Self { account: Some(account.account.clone()), ..Self::new(&account.display, reason)? })
    }
}
