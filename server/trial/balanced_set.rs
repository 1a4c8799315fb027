//! Balanced sets: sessions whose orders were drawn together, from one seed.
//!
//! Within a set every order is a relabelling of every other, and two sessions at the same place
//! have the same order. So whoever knows one order knows something of the others, and whoever knows
//! the seed knows them all. The rules here keep sessions blinded in spite of that.

use jiff::Timestamp;

use super::allocation::Seed;
use super::phase::SessionStatus;
use super::refusal::Refusal;
use crate::ids::SessionId;

/// The sessions that share a seed.
#[derive(Debug, Clone, PartialEq)]
pub struct BalancedSet {
    /// The seed.
    pub seed: Seed,
    /// The sessions, in the order in which they were made.
    pub members: Vec<Member>,
}

/// A session of a set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// The session.
    pub session: SessionId,
    /// Its participant's code.
    pub participant: String,
    /// When it was made, by the server's wall clock.
    pub made: Timestamp,
    /// Its place in the set, from 0.
    pub place: usize,
    /// How far it came.
    pub status: SessionStatus,
    /// Whether it was unblinded.
    pub unblinded: bool,
}

impl BalancedSet {
    /// The first place, of `size` in the set, that a new session may take. None where the set is
    /// full or closed.
    #[must_use]
    pub fn free_place(&self, size: usize) -> Option<usize> {
        // Unblinding one session closes the set: its order tells the others' apart.
        if self.members.iter().any(|member| member.unblinded) {
            return None;
        }

        // An aborted session gives its place back, so that completed sessions fill the set.
        let is_taken =
            |place| self.members.iter().any(|member| member.place == place && member.status != SessionStatus::Aborted);
        (0..size).find(|&place| !is_taken(place))
    }

    /// Whether unblinding `session` leaves the other sessions of the set blinded.
    ///
    /// # Errors
    /// When it would tell the order of a session under way, or of one that took its place.
    pub fn check_unblinding(&self, session: SessionId) -> Result<(), Refusal> {
        let others = || self.members.iter().filter(|member| member.session != session);

        if others().any(|other| other.status == SessionStatus::UnderWay) {
            return Err(Refusal::conflict(
                "a session of the same balanced set is under way, and this one's order would tell its own; \
                 wait for its end",
            ));
        }

        // Two sessions have the same place where the first was aborted and gave it back.
        let place = self.members.iter().find(|member| member.session == session).map(|member| member.place);
        let blinded_twin = others()
            .find(|other| Some(other.place) == place && other.status != SessionStatus::Aborted && !other.unblinded);
        if let Some(Member { participant, made, .. }) = blinded_twin {
            return Err(Refusal::Conflict(format!(
                "the session of {participant} made at {made} took this one's place and has the same order; \
                 unblind that one first"
            )));
        }

        Ok(())
    }

    /// Whether the seed may be told: it tells the order of every session of the set.
    #[must_use]
    pub fn may_tell_seed(&self) -> bool {
        self.members.iter().all(|member| member.unblinded)
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    fn session(number: u128) -> SessionId {
        SessionId(Uuid::from_u128(number))
    }

    fn member(number: u128, place: usize, status: SessionStatus) -> Member {
        Member {
            session: session(number),
            participant: format!("S-{number:02}"),
            made: Timestamp::UNIX_EPOCH,
            place,
            status,
            unblinded: false,
        }
    }

    fn completed(number: u128, place: usize) -> Member {
        member(number, place, SessionStatus::Completed)
    }

    fn aborted(number: u128, place: usize) -> Member {
        member(number, place, SessionStatus::Aborted)
    }

    fn unblinded(member: Member) -> Member {
        Member { unblinded: true, ..member }
    }

    fn set(members: impl Into<Vec<Member>>) -> BalancedSet {
        BalancedSet { seed: Seed([7; 32]), members: members.into() }
    }

    #[test]
    fn places_are_taken_in_order_and_an_aborted_session_gives_its_place_back() {
        let members = [completed(1, 0), aborted(2, 1), completed(3, 2)];
        assert_eq!(set(members.clone()).free_place(6), Some(1));
        assert_eq!(set(&members[..1]).free_place(6), Some(1));
        assert_eq!(set([member(1, 0, SessionStatus::UnderWay)]).free_place(6), Some(1));
    }

    #[test]
    fn a_full_or_unblinded_set_is_closed() {
        let full: Vec<Member> = (0..6).map(|place| completed(place as u128, place)).collect();
        assert_eq!(set(full).free_place(6), None);
        assert_eq!(set([unblinded(completed(1, 0))]).free_place(6), None);
        assert_eq!(set([unblinded(aborted(1, 0))]).free_place(6), None);
    }

    #[test]
    fn a_session_is_not_unblinded_while_another_of_its_set_is_under_way() {
        let under_way = member(2, 1, SessionStatus::UnderWay);
        let refused = set([completed(1, 0), under_way.clone()]).check_unblinding(session(1)).unwrap_err();
        assert!(refused.to_string().contains("same balanced set is under way"), "{refused}");

        // In an emergency the session under way itself can be unblinded.
        assert_eq!(set([completed(1, 0), under_way]).check_unblinding(session(2)), Ok(()));
        assert_eq!(set([completed(1, 0), completed(2, 1)]).check_unblinding(session(1)), Ok(()));
    }

    #[test]
    fn the_session_that_took_the_place_of_an_aborted_one_is_unblinded_first() {
        let refused = set([aborted(1, 0), completed(2, 0)]).check_unblinding(session(1)).unwrap_err();
        assert!(refused.to_string().contains("session of S-02 made at 1970-01-01T00:00:00Z"), "{refused}");

        assert_eq!(set([aborted(1, 0), completed(2, 0)]).check_unblinding(session(2)), Ok(()));
        assert_eq!(set([aborted(1, 0), unblinded(completed(2, 0))]).check_unblinding(session(1)), Ok(()));
        assert_eq!(set([aborted(1, 0), aborted(2, 0)]).check_unblinding(session(1)), Ok(()));
        assert_eq!(set([aborted(1, 0), completed(2, 1)]).check_unblinding(session(1)), Ok(()));
    }

    #[test]
    fn the_seed_is_told_once_every_session_of_the_set_is_unblinded() {
        assert!(!set([unblinded(completed(1, 0)), completed(2, 1)]).may_tell_seed());
        assert!(!set([unblinded(completed(1, 0)), aborted(2, 1)]).may_tell_seed(), "an aborted session counts too");
        assert!(set([unblinded(completed(1, 0)), unblinded(completed(2, 1))]).may_tell_seed());
    }
}
