//! Concerns about a study's plan: what in it cannot work as intended. Each is shown when the study is planned, and has
//! to be confirmed when it is opened, because the plan cannot be changed afterwards.

use super::definition::{Definition, Site};
use crate::account::Account;
use crate::protocol::Protocol;

/// The concerns about `definition`, each a sentence. `accounts` are those that are enabled, and `here` the sites that
/// this database runs.
pub fn concerns(definition: &Definition, accounts: &[Account], here: &[String]) -> Vec<String> {
    let sites = definition.sites.iter().filter(|site| here.contains(&site.name));
    let lists = sites.flat_map(|site| definition.protocols.iter().map(move |protocol| (site, protocol)));
    let mut all: Vec<String> = lists.filter_map(|(site, protocol)| incomplete_set(site, protocol)).collect();
    all.extend(nobody_unblinds(definition, accounts));
    all
}

/// A last set that is never complete: in it, not every order comes equally often.
fn incomplete_set(site: &Site, protocol: &Protocol) -> Option<String> {
    let in_a_set = protocol.set_size();
    let over = site.surgeons % in_a_set;
    if over == 0 {
        return None;
    }

    let fewer = site.surgeons - over;
    let more = fewer + in_a_set;
    let instead = if fewer == 0 { more.to_string() } else { format!("{fewer} or {more}") };
    Some(format!(
        "Site \u{2018}{}\u{2019} plans {} surgeons, but protocol \u{2018}{}\u{2019} is balanced in sets of {in_a_set}: the last set stays \
         incomplete, and its orders are not balanced. Plan {instead} surgeons.",
        site.name, site.surgeons, protocol.name
    ))
}

/// A list of people of whom none could unblind the study, because only leads can, each under the name of the account.
fn nobody_unblinds(definition: &Definition, accounts: &[Account]) -> Option<String> {
    let may = |account: &Account| account.role.leads() && definition.may_unblind.contains(&account.display);
    if accounts.iter().any(may) {
        return None;
    }
    Some(format!(
        "Nobody here could unblind the study: none of those who may (may_unblind: {}) has a lead\u{2019}s account of that \
         name. Give a lead\u{2019}s account one of these names, or name a lead in the plan.",
        definition.may_unblind.join("; ")
    ))
}
