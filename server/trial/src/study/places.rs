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
    /// The corrected code; none if it was not corrected.
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

    /// What happens to the session's place; none if the session is valid, that is, neither withdrawn nor aborted.
    const fn replacement(&self, rules: PlaceRules) -> Option<Replacement> {
        let rule = match (self.withdrawn, self.status) {
            (true, _) => rules.withdrawn,
            (false, SessionStatus::Aborted) => rules.aborted,
            (false, SessionStatus::UnderWay | SessionStatus::Completed) => return None,
        };
        // A person who knows the order could tell it to the next surgeon.
        Some(match rule {
            Replacement::SamePlace if self.unblinded => Replacement::NextSpare,
            rule => rule,
        })
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

    let list: Vec<&Enrolled> =
        sessions.iter().filter(|session| session.site == site.name && session.protocol == protocol).collect();
    // Counts sessions at all sites: a surgeon who works at two sites is still one surgeon.
    let repeats = sessions
        .iter()
        .any(|session| session.surgeon() == participant && session.protocol == protocol && session.stands(rules));
    if repeats && rules.repeated == Repetition::Refuse {
        return Err(Refusal::Conflict(format!(
            "{participant} has a session by this protocol, and the study allows no second one"
        )));
    }

    if let Some(place) = given_back(&list, rules) {
        return Ok(place);
    }

    let next = list.iter().map(|session| session.place).max().unwrap_or(0) + 1;
    let opened = spares_opened(&list, rules) + usize::from(repeats);
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

/// The first place that its latest session freed.
fn given_back(list: &[&Enrolled], rules: PlaceRules) -> Option<usize> {
    let places: BTreeSet<usize> = list.iter().map(|session| session.place).collect();
    places.into_iter().find(|&place| {
        let mut at_this_place = list.iter().filter(move |session| session.place == place);
        // Once the order of a place is known, no session may take it again.
        let known = at_this_place.clone().any(|session| session.unblinded);
        let latest = at_this_place.next_back();
        !known && latest.is_some_and(|session| session.replacement(rules) == Some(Replacement::SamePlace))
    })
}

/// The number of spare places that the sessions of a list have opened.
fn spares_opened(list: &[&Enrolled], rules: PlaceRules) -> usize {
    let mut latest = BTreeMap::new();
    for session in list {
        latest.insert(session.place, session);
    }
    let opens = latest.into_values().filter(|session| session.replacement(rules) == Some(Replacement::NextSpare));
    let replaced = opens.count();

    let mut standing = BTreeSet::new();
    let standing_sessions = list.iter().filter(|session| session.stands(rules));
    let repeated = standing_sessions.filter(|session| !standing.insert(session.surgeon())).count();
    replaced + repeated
}
