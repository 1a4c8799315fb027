//! Accounts as the database keeps them: written in `book`, read in `reading`.

mod book;
mod reading;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use parfocal_trial::account::{Account, AccountChange, AccountName, AccountRole};

pub use book::AccountBook;

/// An argon2id hash of a passphrase, with its parameters.
#[derive(Clone, PartialEq, Eq)]
pub struct PassphraseHash {
    /// Memory, KiB.
    pub memory_kib: u32,
    /// Passes over the memory.
    pub passes: u32,
    /// Random bytes, new for each passphrase.
    pub salt: Vec<u8>,
    /// The hash itself, as bytes.
    pub hash: Vec<u8>,
}

/// An account with the hash of its passphrase.
#[derive(Clone, PartialEq, Eq)]
pub struct StoredAccount {
    /// Its name, role and whether it is disabled.
    pub account: Account,
    /// The hash of its passphrase.
    pub hash: PassphraseHash,
    /// Whether the account of another person set this passphrase.
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
    /// The account that is signed in.
    pub account: Account,
    /// When it began, by the wall clock.
    pub began: Timestamp,
    /// When it was last used, to the minute or so.
    pub used: Timestamp,
}

/// An event of an account, as the chain keeps it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AccountEvent {
    /// The account was created.
    Added(AccountRole),
    /// Its role changed, it was disabled or enabled, or all its sign-ins were ended.
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

/// What a wrong passphrase was given for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailedAttempt {
    /// To sign in.
    SignIn,
    /// To sign in to an account that is disabled.
    Disabled,
    /// To confirm a lock or an unblinding.
    Confirmation,
}

impl AccountEvent {
    /// Name of the kind, as in the database.
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

/// The account that makes a change, such as a lead's; `None` for the command line.
pub type ChangedBy<'a> = Option<&'a AccountName>;
