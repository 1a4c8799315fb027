//! The token that shows that a browser is signed in. The database keeps its SHA-256 alone.

use sha2::{Digest, Sha256};

use super::AccountError;

/// Bytes of a token: 256 bits cannot be guessed.
const BYTES: usize = 32;

/// A token, in hexadecimal.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// A new one.
    pub(super) fn random() -> Result<Self, AccountError> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes).map_err(|error| AccountError::Storage(format!("no random numbers: {error}")))?;
        Ok(Self(hex::encode(bytes)))
    }

    /// The token that a browser sent; none where it cannot be one.
    #[must_use]
    pub fn sent(text: &str) -> Option<Self> {
        let is_token = text.len() == BYTES * 2 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        is_token.then(|| Self(text.to_owned()))
    }

    /// As the browser sends it.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// What is kept of it.
    pub(super) fn sha256(&self) -> String {
        hex::encode(Sha256::digest(&self.0))
    }
}
