//! Reasons that people give for what they do. They are kept in the audit trail.

use super::refusal::Refusal;

/// Longest reason, characters.
const LONGEST: usize = 1000;

/// `reason` without blanks around it; it may be empty.
///
/// # Errors
/// When it is too long.
pub fn optional(reason: &str) -> Result<String, Refusal> {
    let reason = reason.trim();
    if reason.chars().count() > LONGEST {
        return Err(Refusal::Invalid(format!("the reason is longer than {LONGEST} characters")));
    }
    Ok(reason.to_owned())
}

/// `reason` without blanks around it.
///
/// # Errors
/// When it is empty or too long.
pub fn needed(reason: &str) -> Result<String, Refusal> {
    let reason = optional(reason)?;
    if reason.is_empty() {
        return Err(Refusal::Invalid("give a reason: it is kept in the log".to_owned()));
    }
    Ok(reason)
}
