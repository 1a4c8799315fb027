//! Decides which place of its list a new session gets. The rules of the definition decide, not a person.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use utoipa::ToSchema;

use super::definition::{Definition, PlaceRules, Repetition, Replacement, Site};
use crate::phase::SessionStatus;
use crate::refusal::Refusal;
use parfocal_base::ids::SessionId;

/// A session of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = StudySession)]
pub struct Enrolled {
    /// The session.
    pub session: SessionId,
    /// The participant's code.
    pub participant: String,
    /// The corrected code; none if it was not corrected, or back to the first one.
    pub corrected_participant: Option<String>,
    /// Name of the site.
    pub site: String,
    /// Name of the protocol.
    pub protocol: String,
    /// Place in the list of this site and protocol, from 1.
    pub place: usize,
    /// State of the session.
    pub status: SessionStatus,
    /// Whether the session's policies were revealed.
    pub unblinded: bool,
    /// Whether the surgeon withdrew.
    pub withdrawn: bool,
}

impl Enrolled {
    /// The surgeon whose session it was: the corrected code if there is one, otherwise the recorded one.
    pub fn surgeon(&self) -> &str {
        self.corrected_participant.as_ref().unwrap_or(&self.participant)
    }

    /// What the rules say of the session's place; none if the session is valid, that is, neither withdrawn nor aborted.
    const fn replacement(&self, rules: PlaceRules) -> Option<Replacement> {
        match (self.withdrawn, self.status) {
            (true, _) => Some(rules.withdrawn),
            (false, SessionStatus::Aborted) => Some(rules.aborted),
            (false, SessionStatus::UnderWay | SessionStatus::Completed) => None,
        }
    }

    /// Whether another session of the same surgeon with the same protocol is a repetition: this session is valid, or
    /// its place is not replaced.
    fn stands(&self, rules: PlaceRules) -> bool {
        matches!(self.replacement(rules), None | Some(Replacement::Keep))
    }
}

/// The place (from 1) of a new session of `participant` at `site` with `protocol`. `sessions` are all sessions of the
/// study, in the order in which they were made.
///
/// # Errors
/// If the participant may not have a session, or no place is left.
pub fn next_place(
    definition: &Definition,
    sessions: &[Enrolled],
    site: &Site,
    protocol: &str,
    participant: &str,
) -> Result<usize, Refusal> {
    let rules = definition.rules;
    if sessions.iter().any(|session| session.surgeon() == participant && session.withdrawn) {
        return Err(Refusal::Conflict(format!("{participant} withdrew from the study; choose another participant")));
    }

    // Counts sessions at all sites: a surgeon who works at two sites is still one surgeon.
    let standing: Vec<&Enrolled> =
        sessions.iter().filter(|session| session.protocol == protocol && session.stands(rules)).collect();
    let repeats = standing.iter().any(|session| session.surgeon() == participant);
    if repeats && rules.repeated == Repetition::Refuse {
        return Err(Refusal::Conflict(format!(
            "{participant} has a session by this protocol, and the study allows no second one"
        )));
    }

    let list: Vec<&Enrolled> =
        sessions.iter().filter(|session| session.site == site.name && session.protocol == protocol).collect();
    let freed = freed_places(&list, rules);
    if let Some((&place, _)) = freed.iter().find(|(_, rule)| **rule == Replacement::SamePlace) {
        return Ok(place);
    }

    let next = list.iter().map(|session| session.place).max().unwrap_or(0) + 1;
    let replaced = freed.values().filter(|rule| **rule == Replacement::NextSpare).count();
    let opened = replaced + repetitions(&standing, site) + usize::from(repeats);
    let places = site.places();
    let open = places.min(site.surgeons + opened);
    if next > open {
        return Err(Refusal::Conflict(format!(
            "no place is left in the list of {}: {open} of {places} were open, all are used. {}",
            site.name, definition.when_used_up
        )));
    }
    Ok(next)
}

/// The places of a list that their latest sessions freed, and what happens to each.
fn freed_places(list: &[&Enrolled], rules: PlaceRules) -> BTreeMap<usize, Replacement> {
    let known: BTreeSet<usize> = list.iter().filter(|session| session.unblinded).map(|session| session.place).collect();
    let latest: BTreeMap<usize, &Enrolled> = list.iter().map(|session| (session.place, *session)).collect();
    let freed = latest.into_iter().filter_map(|(place, session)| {
        let rule = match session.replacement(rules)? {
            // A person who knows the order could tell it to the next surgeon.
            Replacement::SamePlace if known.contains(&place) => Replacement::NextSpare,
            rule => rule,
        };
        Some((place, rule))
    });
    freed.collect()
}

/// How many of the sessions that stand are at `site` and not their surgeon's first. Each opened a spare place there.
fn repetitions(standing: &[&Enrolled], site: &Site) -> usize {
    let mut known = BTreeSet::new();
    let repeated = standing.iter().filter(|session| !known.insert(session.surgeon()));
    repeated.filter(|session| session.site == site.name).count()
}
