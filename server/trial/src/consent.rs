//! A participant's consent: the version of the text, the day, who obtained it, and whether on paper or on a screen. The
//! signed text itself stays with the institution.

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::refusal::Refusal;
use super::role::Role;
use parfocal_base::ids::SessionId;

/// Maximum number of characters in a consent text's version, and in the name of the person who obtained the consent.
pub const LONGEST: usize = 80;

/// A consent as the operator's page sends it.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, ToSchema)]
pub struct NewConsent {
    /// Session that the consent is for.
    pub session: SessionId,
    /// The consent that was given.
    #[serde(flatten)]
    pub consent: Consent,
}

/// A recorded consent of a participant.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Consent {
    /// Version of the consent text.
    #[schema(pattern = r"\S")]
    pub text_version: String,
    /// Day on which the consent was given.
    #[schema(value_type = String, format = Date)]
    pub given_on: Date,
    /// Person who obtained the consent: initials or a code.
    #[schema(pattern = r"\S")]
    pub obtained_by: String,
    /// Whether the consent was given on paper or on a screen.
    pub medium: Medium,
}

/// Where a consent was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Medium {
    /// Signed on paper.
    Paper,
    /// Given on a screen.
    Screen,
}

names!(Medium { Paper: "paper", Screen: "screen" });

/// Checks the consent `new` that `by` records on the day `today`, and returns it without blanks around its texts.
/// `required` is the text version that the session's protocol requires, if any.
///
/// # Errors
/// If `by` is not the operator, a text is missing or too long, the consent is dated in the future, or its version is
/// not the required one.
pub fn check(by: Role, new: &Consent, required: Option<&str>, today: Date) -> Result<Consent, Refusal> {
    if by != Role::Operator {
        return Err(Refusal::only("the operator"));
    }

    let text_version = short(&new.text_version, "the version of the consent text")?;
    let obtained_by = short(&new.obtained_by, "who obtained the consent")?;
    if new.given_on > today {
        return Err(Refusal::Invalid(format!("the consent was given on {}, which is in the future", new.given_on)));
    }
    if let Some(required) = required.filter(|required| *required != text_version) {
        return Err(Refusal::Invalid(format!(
            "the protocol requires version '{required}' of the consent text, not '{text_version}'"
        )));
    }
    Ok(Consent { text_version, given_on: new.given_on, obtained_by, medium: new.medium })
}

/// Returns `text` without surrounding blanks, if its length is allowed. `what` names it in the error.
fn short(text: &str, what: &str) -> Result<String, Refusal> {
    let text = text.trim();
    let length = text.chars().count();
    if !(1..=LONGEST).contains(&length) {
        return Err(Refusal::Invalid(format!("{what}: give 1 to {LONGEST} characters, not {length}")));
    }
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use jiff::civil::date;

    use super::*;

    fn consent() -> Consent {
        Consent {
            text_version: " 2.1 ".to_owned(),
            given_on: date(2026, 3, 1),
            obtained_by: "KM".to_owned(),
            medium: Medium::Paper,
        }
    }

    const TODAY: Date = date(2026, 3, 1);

    #[test]
    fn a_consent_to_the_required_text_is_taken() {
        let taken = check(Role::Operator, &consent(), Some("2.1"), TODAY).unwrap();
        assert_eq!(taken, Consent { text_version: "2.1".to_owned(), ..consent() });
        assert!(check(Role::Operator, &consent(), None, TODAY).is_ok());
    }

    #[test]
    fn whatever_is_wrong_with_a_consent_is_named() {
        let refused = |new: Consent, said: &str| {
            let refusal = check(Role::Operator, &new, Some("2.1"), TODAY).unwrap_err();
            assert!(matches!(&refusal, Refusal::Invalid(text) if text.contains(said)), "{refusal}");
        };
        refused(Consent { text_version: "2.0".to_owned(), ..consent() }, "requires version '2.1'");
        refused(Consent { text_version: " ".to_owned(), ..consent() }, "the version of the consent text");
        refused(Consent { obtained_by: "x".repeat(81), ..consent() }, "who obtained the consent");
        refused(Consent { given_on: date(2026, 3, 2), ..consent() }, "in the future");
        for by in [Role::Surgeon, Role::Researcher, Role::System] {
            assert_eq!(check(by, &consent(), None, TODAY), Err(Refusal::only("the operator")), "{by:?}");
        }
    }
}
