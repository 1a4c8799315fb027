//! Why a request about an account failed.

use crate::store::StoreError;
use parfocal_trial::account::{Account, AccountName};
use parfocal_trial::refusal::Refusal;

/// Why a request about an account failed. Nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AccountError {
    /// The name and the passphrase do not match, or the account is disabled.
    #[error("The name and the passphrase do not match, or the account is disabled. Try again, or ask a lead.")]
    WrongPassphrase,
    /// The passphrase that was given as confirmation is wrong.
    #[error("This is not your passphrase. Nothing was changed; try again.")]
    WrongConfirmation,
    /// A lead set the passphrase, so the person has to choose another one.
    #[error(
        "A lead set this passphrase. Choose one that only you know, on the page /sign-in: then only you can sign with \
         your name."
    )]
    ChooseAnother,
    /// Too many attempts failed.
    #[error("Too many attempts failed. Wait {seconds} seconds, then try again.")]
    TooMany {
        /// Seconds to wait.
        seconds: u64,
    },
    /// The account's name or display name is already taken.
    #[error("{0}")]
    Taken(String),
    /// No account has this name.
    #[error("{0}")]
    Unknown(String),
    /// The rules refuse the request.
    #[error("{0}")]
    Refused(Refusal),
    /// The disk or database failed.
    #[error("{0}")]
    Storage(String),
}

impl AccountError {
    pub(super) fn unknown(name: &AccountName, all: &[Account]) -> Self {
        let names: Vec<_> = all.iter().map(|account| account.account.as_str()).collect();
        let names = if names.is_empty() { "none yet".to_owned() } else { names.join(", ") };
        Self::Unknown(format!("there is no account '{name}'; there are: {names}"))
    }
}

impl From<Refusal> for AccountError {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

impl From<StoreError> for AccountError {
    fn from(error: StoreError) -> Self {
        Self::Storage(error.to_string())
    }
}
