//! The token that proves that a browser is signed in. The database keeps only its SHA-256.

use sha2::{Digest, Sha256};

use super::AccountError;

/// Number of bytes in a token. 256 bits cannot be guessed.
const BYTES: usize = 32;

/// A token, in hexadecimal.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// Makes a new random token.
    pub(super) fn random() -> Result<Self, AccountError> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes).map_err(|error| AccountError::Storage(format!("no random numbers: {error}")))?;
        Ok(Self(hex::encode(bytes)))
    }

    /// The token in `text`, which a browser sent; none if it does not have the form of a token.
    pub fn sent(text: &str) -> Option<Self> {
        let is_token = text.len() == BYTES * 2 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        is_token.then(|| Self(text.to_owned()))
    }

    /// The token as the browser sends it: 64 hexadecimal digits.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The token's SHA-256 in hexadecimal, which the database keeps.
    pub(super) fn sha256(&self) -> String {
        hex::encode(Sha256::digest(&self.0))
    }
}
