//! Accounts as the database keeps them: written in `book`, read in `reading`.

mod book;
mod reading;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use crate::trial::account::{Account, AccountChange, AccountName, AccountRole};

pub use book::AccountBook;

/// An argon2id hash of a passphrase, with what it was made with.
#[derive(Clone, PartialEq, Eq)]
pub struct PassphraseHash {
    /// Memory, KiB.
    pub memory_kib: u32,
    /// Passes over it.
    pub passes: u32,
    /// Random, of its own for each passphrase.
    pub salt: Vec<u8>,
    /// The hash.
    pub hash: Vec<u8>,
}

/// An account with what it signs in by.
#[derive(Clone, PartialEq, Eq)]
pub struct StoredAccount {
    /// The account.
    pub account: Account,
    /// The hash of its passphrase.
    pub hash: PassphraseHash,
    /// Whether the account of somebody else set this passphrase.
    pub set_by_another: bool,
}

/// An account as a lead sees it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct AccountLine {
    /// The account.
    #[serde(flatten)]
    pub account: Account,
    /// Whether a lead set its passphrase: the person then has to choose another to sign in.
    pub set_by_another: bool,
    /// When the person last signed in.
    #[schema(value_type = Option<String>)]
    pub last_signed_in: Option<Timestamp>,
}

/// A browser that is signed in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredSignIn {
    /// Whose it is.
    pub account: Account,
    /// When it began, by the wall clock.
    pub began: Timestamp,
    /// When it was last used, to the minute or so.
    pub used: Timestamp,
}

/// Something that happened to an account, as the chain keeps it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AccountEvent {
    /// It was made.
    Added(AccountRole),
    /// Its role, or whether it may sign in, changed; or all its sign-ins were ended.
    Changed(AccountChange),
    /// Its passphrase was replaced.
    PassphraseReplaced,
    /// A browser signed in.
    SignedIn,
    /// A browser signed out.
    SignedOut,
    /// A wrong passphrase was given.
    Failed(FailedAttempt),
}

/// Where a wrong passphrase was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailedAttempt {
    /// To sign in.
    SignIn,
    /// To sign in to an account that is disabled.
    Disabled,
    /// To lock or unblind.
    Confirmation,
}

impl AccountEvent {
    /// Name of the kind, as in the database.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Added(_) => "added",
            Self::Changed(AccountChange::Role(_)) => "role-changed",
            Self::Changed(AccountChange::Disable) => "disabled",
            Self::Changed(AccountChange::Enable) => "enabled",
            Self::Changed(AccountChange::SignOut) => "sign-ins-ended",
            Self::PassphraseReplaced => "passphrase-replaced",
            Self::SignedIn => "signed-in",
            Self::SignedOut => "signed-out",
            Self::Failed(_) => "attempt-failed",
        }
    }

    const fn detail(&self) -> Option<&'static str> {
        match self {
            Self::Added(role) | Self::Changed(AccountChange::Role(role)) => Some(role.name()),
            Self::Failed(FailedAttempt::SignIn) => Some("sign-in"),
            Self::Failed(FailedAttempt::Disabled) => Some("sign-in to a disabled account"),
            Self::Failed(FailedAttempt::Confirmation) => Some("confirmation"),
            _ => None,
        }
    }
}

/// Who changes an account: a lead's account, or none for the command line.
pub type By<'a> = Option<&'a AccountName>;
