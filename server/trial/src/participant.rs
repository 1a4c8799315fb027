//! Participants are known by codes, never by names.

use std::fmt;

use serde::Serialize;

/// A participant's code: 2 to 16 capital letters, digits and dashes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct ParticipantCode(String);

/// A text that is not a valid participant code.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a participant code: use 2 to 16 capital letters, digits and dashes, such as S-01; never a name")]
pub struct BadCode(String);

impl ParticipantCode {
    /// Checks `text` and makes it a participant's code.
    ///
    /// # Errors
    /// If it is not a valid code.
    pub fn new(text: &str) -> Result<Self, BadCode> {
        let fits = (2..=16).contains(&text.len())
            && text.bytes().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'-');
        if fits { Ok(Self(text.to_owned())) } else { Err(BadCode(text.chars().take(40).collect())) }
    }

    /// The code as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for ParticipantCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_taken_and_names_are_not() {
        for code in ["S-01", "A1", "1234567890ABCDEF"] {
            assert_eq!(ParticipantCode::new(code).unwrap().as_str(), code);
        }
        for text in ["", "A", "Dr Smith", "anna", "1234567890ABCDEFG", "S_01", "Ä-01", "S-01\n"] {
            assert!(ParticipantCode::new(text).is_err(), "{text:?}");
        }
    }
}
