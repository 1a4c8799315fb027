//! Personal accounts: their names, their roles, and what each role may do.

use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::refusal::Refusal;
use super::role::Role;

/// Maximum number of characters in an account's name.
const LONGEST_NAME: usize = 40;

/// Maximum number of characters in a display name: the same as in the signature of a study's event.
const LONGEST_DISPLAY: usize = 200;

/// Minimum number of characters in a passphrase. NIST SP 800-63B-4 requires 15 if the passphrase is the only proof. The
/// pages recommend 15, and refuse fewer than this.
pub const SHORTEST_PASSPHRASE: usize = 10;

/// Maximum number of characters in a passphrase: enough for any sentence, and hashed in bounded time.
pub const LONGEST_PASSPHRASE: usize = 256;

/// A browser that sends no request for this long has to sign in again (NIST SP 800-63B-4, AAL2: 1 h at most).
pub const IDLE_LIMIT: Duration = Duration::from_hours(1);

/// A browser has to sign in again after this long in any case: a long day in theatre.
pub const SIGN_IN_LIMIT: Duration = Duration::from_hours(12);

/// The name that a person signs in with: 1 to 40 lower-case letters, digits, dots and dashes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, ToSchema)]
#[serde(transparent)]
pub struct AccountName(String);

impl AccountName {
    /// Checks `text` and makes it an account's name.
    ///
    /// # Errors
    /// If it is empty, too long, or has other characters.
    pub fn new(text: &str) -> Result<Self, Refusal> {
        let fits = |letter: char| matches!(letter, 'a'..='z' | '0'..='9' | '.' | '-');
        if (1..=LONGEST_NAME).contains(&text.len()) && text.chars().all(fits) {
            return Ok(Self(text.to_owned()));
        }
        Err(Refusal::Invalid(format!(
            "an account's name has 1 to {LONGEST_NAME} lower-case letters, digits, dots and dashes, such as a.turing"
        )))
    }

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for AccountName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.0)
    }
}

/// The role of a personal account in studies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AccountRole {
    /// Leads studies: may do everything that operators and researchers may, and also lock and unblind studies.
    Lead,
    /// Runs sessions at the device.
    Operator,
    /// Plans studies and examines their data.
    Researcher,
    /// May read everything that researchers may, but changes nothing.
    Monitor,
}

impl AccountRole {
    /// All roles.
    pub const ALL: [Self; 4] = [Self::Lead, Self::Operator, Self::Researcher, Self::Monitor];

    /// Whether a person with this role may act as `role`. `changes`: whether the request may change something.
    pub const fn may_act_as(self, role: Role, changes: bool) -> bool {
        match (self, role) {
            (Self::Lead, Role::Operator | Role::Researcher)
            | (Self::Operator, Role::Operator)
            | (Self::Researcher, Role::Researcher) => true,
            (Self::Monitor, Role::Researcher) => !changes,
            _ => false,
        }
    }

    /// Whether a person with this role may lock and unblind studies.
    pub const fn leads(self) -> bool {
        matches!(self, Self::Lead)
    }
}

names!(AccountRole { Lead: "lead", Operator: "operator", Researcher: "researcher", Monitor: "monitor" });

impl fmt::Display for AccountRole {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

/// An account.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Account {
    /// The name that the person signs in with.
    pub account: AccountName,
    /// The person's name, as signatures show it.
    pub display: String,
    /// The role, which decides what the person may do.
    pub role: AccountRole,
    /// Whether the account is disabled: nobody can sign in to it.
    pub disabled: bool,
}

/// Checks a display name, and returns it without surrounding blanks.
///
/// # Errors
/// If it is empty, too long, or has control characters.
pub fn check_display(text: &str) -> Result<String, Refusal> {
    let text = text.trim();
    if (1..=LONGEST_DISPLAY).contains(&text.chars().count()) && !text.chars().any(char::is_control) {
        return Ok(text.to_owned());
    }
    Err(Refusal::Invalid(format!("give the person's name in 1 to {LONGEST_DISPLAY} characters")))
}

/// A change to an account.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AccountChange {
    /// Gives the account this role.
    Role(AccountRole),
    /// Forbids signing in, and ends all sign-ins.
    Disable,
    /// Allows signing in again.
    Enable,
    /// Ends all sign-ins.
    SignOut,
}

/// Checks that at least one enabled lead is left after `change` of `account`. `all` are all accounts.
///
/// # Errors
/// If the change would remove the last lead.
pub fn check_change(account: &Account, change: &AccountChange, all: &[Account]) -> Result<(), Refusal> {
    let takes_lead_away = match change {
        AccountChange::Role(role) => !role.leads(),
        AccountChange::Disable => true,
        AccountChange::Enable | AccountChange::SignOut => false,
    };
    let leads = |each: &Account| each.role.leads() && !each.disabled;
    let others = all.iter().filter(|each| leads(each) && each.account != account.account).count();

    if takes_lead_away && leads(account) && others == 0 {
        return Err(Refusal::conflict(
            "this is the last lead who can sign in; make another lead first, so that somebody can lock and unblind",
        ));
    }
    Ok(())
}

/// The author of an action: a role, and a personal account if the person is signed in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Actor {
    /// The role in which the action is done.
    pub role: Role,
    /// The personal account. None for people who only have a role's link, and for the server itself.
    pub account: Option<AccountName>,
}

impl From<Role> for Actor {
    fn from(role: Role) -> Self {
        Self { role, account: None }
    }
}

/// How long the next attempt to sign in has to wait after `failures` failed ones in a row: not at all after a typing
/// mistake or two, then 1 s, and twice as long after each further failure.
pub fn wait_after(failures: u32) -> Duration {
    /// Number of failures that cost no wait.
    const FREE: u32 = 2;
    /// The longest wait. It makes guessing take years, but still lets in a person who mistyped.
    const LONGEST: Duration = Duration::from_secs(8);

    match failures.checked_sub(FREE + 1) {
        None => Duration::ZERO,
        Some(doublings) => Duration::from_secs(1).saturating_mul(1 << doublings.min(10)).min(LONGEST),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn account(name: &str, role: AccountRole, disabled: bool) -> Account {
        Account { account: AccountName::new(name).unwrap(), display: name.to_owned(), role, disabled }
    }

    #[test]
    fn names_are_plain() {
        for good in ["a", "a.turing", "j-01", &"x".repeat(40)] {
            assert_eq!(AccountName::new(good).unwrap().as_str(), good);
        }
        for bad in ["", "A", "a b", "é", "a/b", &"x".repeat(41)] {
            assert!(AccountName::new(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn each_role_acts_as_the_table_says() {
        let roles = [Role::Surgeon, Role::Operator, Role::Researcher, Role::System];
        let table = [
            (AccountRole::Lead, [false, true, true, false], [false, true, true, false]),
            (AccountRole::Operator, [false, true, false, false], [false, true, false, false]),
            (AccountRole::Researcher, [false, false, true, false], [false, false, true, false]),
            (AccountRole::Monitor, [false, false, true, false], [false; 4]),
        ];
        for (account, reads, changes) in table {
            assert_eq!(roles.map(|role| account.may_act_as(role, false)), reads, "{account}");
            assert_eq!(roles.map(|role| account.may_act_as(role, true)), changes, "{account}");
            assert_eq!(account.leads(), account == AccountRole::Lead);
        }
    }

    #[test]
    fn the_last_lead_stays() {
        let lead = account("lead", AccountRole::Lead, false);
        let disabled = account("former", AccountRole::Lead, true);
        let other = account("other", AccountRole::Lead, false);
        let alone = [lead.clone(), disabled];
        for change in [AccountChange::Disable, AccountChange::Role(AccountRole::Monitor)] {
            assert!(check_change(&lead, &change, &alone).is_err(), "{change:?}");
            assert!(check_change(&lead, &change, &[lead.clone(), other.clone()]).is_ok(), "{change:?}");
        }
        assert!(check_change(&lead, &AccountChange::Role(AccountRole::Lead), &alone).is_ok());
        assert!(check_change(&lead, &AccountChange::SignOut, &alone).is_ok());
    }

    #[test]
    fn waits_double_up_to_a_limit() {
        let seconds = |failures| wait_after(failures).as_secs();
        assert_eq!([0, 1, 2, 3, 4, 5, 6, 7, 40, u32::MAX].map(seconds), [0, 0, 0, 1, 2, 4, 8, 8, 8, 8]);
    }
}
