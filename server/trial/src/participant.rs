//! Participants are known by codes, never by names.

use super::refusal::Refusal;

/// Checks a participant's code: 2 to 16 capital letters, digits and dashes.
///
/// # Errors
/// If `text` is not such a code.
pub fn check_code(text: &str) -> Result<(), Refusal> {
    let fits = (2..=16).contains(&text.len())
        && text.bytes().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'-');
    if fits {
        return Ok(());
    }
    let text: String = text.chars().take(40).collect();
    Err(Refusal::Invalid(format!(
        "'{text}' is not a participant code: use 2 to 16 capital letters, digits and dashes, such as S-01; never a name"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_taken_and_names_are_not() {
        for code in ["S-01", "A1", "1234567890ABCDEF"] {
            assert_eq!(check_code(code), Ok(()));
        }
        for text in ["", "A", "Dr Smith", "anna", "1234567890ABCDEFG", "S_01", "Ä-01", "S-01\n"] {
            assert!(check_code(text).is_err(), "{text:?}");
        }
    }
}
