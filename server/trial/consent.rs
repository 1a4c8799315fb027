//! A participant's consent: to which version of the text, on which day, obtained by whom, on paper or on a screen. The
//! signed text itself stays with the institution.

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::refusal::Refusal;
use super::role::Role;
use crate::ids::SessionId;

/// Longest version of a text and longest name of who obtained a consent, characters.
pub const LONGEST: usize = 80;

/// A consent as the operator's page sends it.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, ToSchema)]
pub struct NewConsent {
    /// The session that it is for.
    pub session: SessionId,
    /// What was consented to.
    #[serde(flatten)]
    pub consent: Consent,
}

/// A consent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Consent {
    /// Version of the text.
    #[schema(pattern = r"\S")]
    pub text_version: String,
    /// The day on which it was given.
    #[schema(value_type = String, format = Date)]
    pub given_on: Date,
    /// Who obtained it: initials or a code.
    #[schema(pattern = r"\S")]
    pub obtained_by: String,
    /// On paper or on a screen.
    pub medium: Medium,
}

/// Where a consent was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Medium {
    /// On paper.
    Paper,
    /// On a screen.
    Screen,
}

impl Medium {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Screen => "screen",
        }
    }

    /// The medium called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Paper, Self::Screen].into_iter().find(|medium| medium.name() == name)
    }
}

/// The consent that is recorded where `by` records `new` on the day `today`, in a session whose protocol requires the
/// text version `required`, if any. Blanks around texts are taken away.
///
/// # Errors
/// When another role does this, a text is missing or too long, the day is yet to come, or the version is another one.
pub fn check(by: Role, new: &Consent, required: Option<&str>, today: Date) -> Result<Consent, Refusal> {
    if by != Role::Operator {
        return Err(Refusal::only("the operator"));
    }

    let text_version = short(&new.text_version, "the version of the consent text")?;
    let obtained_by = short(&new.obtained_by, "who obtained the consent")?;
    if new.given_on > today {
        return Err(Refusal::Invalid(format!("the consent was given on {}, which is yet to come", new.given_on)));
    }
    if let Some(required) = required.filter(|required| *required != text_version) {
        return Err(Refusal::Invalid(format!(
            "the protocol requires version '{required}' of the consent text, not '{text_version}'"
        )));
    }
    Ok(Consent { text_version, given_on: new.given_on, obtained_by, medium: new.medium })
}

/// `text` without blanks around it; `what` names it.
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
        refused(Consent { given_on: date(2026, 3, 2), ..consent() }, "yet to come");
        for by in [Role::Surgeon, Role::Researcher, Role::System] {
            assert_eq!(check(by, &consent(), None, TODAY), Err(Refusal::only("the operator")), "{by:?}");
        }
    }
}
