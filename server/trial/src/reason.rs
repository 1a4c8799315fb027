//! Reasons that people, and sometimes the server, give for their actions. They are kept in the audit trail.

use super::refusal::Refusal;

/// Maximum length of a reason, in characters.
const LONGEST: usize = 1000;

/// Why the server pauses a session while no tablet shows the surgeon's page.
pub const TABLET_AWAY: &str = "the surgeon’s tablet is away";

/// Why the server pauses a session while the surgeon's picture is too small.
pub const SMALL_PICTURE: &str = "the surgeon’s picture is smaller than the protocol allows";

/// Checks a reason that may be empty, and returns it without surrounding blanks.
///
/// # Errors
/// If it is too long.
pub fn optional(reason: &str) -> Result<String, Refusal> {
    let reason = reason.trim();
    if reason.chars().count() > LONGEST {
        return Err(Refusal::Invalid(format!("the reason is longer than {LONGEST} characters")));
    }
    Ok(reason.to_owned())
}

/// Checks a reason that is required, and returns it without surrounding blanks.
///
/// # Errors
/// If it is empty or too long.
pub fn needed(reason: &str) -> Result<String, Refusal> {
    let reason = optional(reason)?;
    if reason.is_empty() {
        return Err(Refusal::Invalid("give a reason: it is kept in the log".to_owned()));
    }
    Ok(reason)
}
