//! Balanced sets: sessions whose orders were drawn together from one seed.
//!
//! Within a set, every order is a relabelling of every other, and two sessions at the same place have the same order.
//! So one known order reveals something about the others, and the seed reveals them all. The rules here keep sessions
//! blinded in spite of that.

use jiff::Timestamp;

use super::allocation::Seed;
use super::phase::SessionStatus;
use super::refusal::Refusal;
use parfocal_base::ids::SessionId;

/// The sessions that share a seed.
#[derive(Debug, Clone, PartialEq)]
pub struct BalancedSet {
    /// Seed from which all orders of the set are drawn.
    pub seed: Seed,
    /// The set's sessions, in the order in which they were made.
    pub members: Vec<Member>,
}

/// A session of a balanced set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Id of the session.
    pub session: SessionId,
    /// Code of the session's participant.
    pub participant: String,
    /// When the session was made, by the server's wall clock.
    pub made: Timestamp,
    /// The session's place in the set, from 0. Sessions at the same place have the same order.
    pub place: usize,
    /// Whether the session is under way, completed or aborted.
    pub status: SessionStatus,
    /// Whether the session was unblinded.
    pub unblinded: bool,
    /// Whether the participant withdrew.
    pub withdrawn: bool,
}

impl Member {
    /// Whether its order must stay secret: its answers count, or may still count, and it is blinded.
    fn needs_its_secret(&self) -> bool {
        self.status != SessionStatus::Aborted && !self.withdrawn && !self.unblinded
    }
}

impl BalancedSet {
    /// The first of the set's `size` places that a new session may take. None if the set is full or closed.
    pub fn free_place(&self, size: usize) -> Option<usize> {
        // Unblinding one session closes the set, because its order would help to identify the policies of the others.
        if self.members.iter().any(|member| member.unblinded) {
            return None;
        }

        // An aborted session frees its place, so that completed sessions fill the set.
        let is_taken =
            |place| self.members.iter().any(|member| member.place == place && member.status != SessionStatus::Aborted);
        (0..size).find(|&place| !is_taken(place))
    }

    /// Checks that the other sessions of the set stay blinded when `session` is unblinded.
    ///
    /// # Errors
    /// If the unblinding would reveal the order of a session under way, or of a blinded session at the same place.
    pub fn check_unblinding(&self, session: SessionId) -> Result<(), Refusal> {
        let others = || self.members.iter().filter(|member| member.session != session);

        if others().any(|other| other.status == SessionStatus::UnderWay) {
            return Err(Refusal::conflict(
                "a session of the same balanced set is under way, and this one's order would reveal its order; \
                 wait until it has ended",
            ));
        }

        // Two sessions have the same place if the first was aborted or withdrawn and freed it.
        let place = self.members.iter().find(|member| member.session == session).map(|member| member.place);
        let blinded_twin = others().find(|other| Some(other.place) == place && other.needs_its_secret());
        if let Some(Member { participant, made, .. }) = blinded_twin {
            return Err(Refusal::Conflict(format!(
                "the session of {participant} made at {made} took this one's place and has the same order; \
                 unblind that one first"
            )));
        }

        Ok(())
    }

    /// Whether the seed may be revealed. It gives away the order of every session of the set, so all of them must be
    /// unblinded.
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
            withdrawn: false,
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
    fn the_session_that_took_the_place_of_a_withdrawn_one_can_be_unblinded() {
        let withdrawn = Member { withdrawn: true, ..completed(1, 0) };
        let both = [withdrawn, completed(2, 0)];
        assert_eq!(set(both.clone()).check_unblinding(session(2)), Ok(()));
        let refused = set(both).check_unblinding(session(1)).unwrap_err();
        assert!(refused.to_string().contains("session of S-02 made at"), "{refused}");
    }

    #[test]
    fn the_seed_is_revealed_once_every_session_of_the_set_is_unblinded() {
        assert!(!set([unblinded(completed(1, 0)), completed(2, 1)]).may_tell_seed());
        assert!(!set([unblinded(completed(1, 0)), aborted(2, 1)]).may_tell_seed(), "an aborted session counts too");
        assert!(set([unblinded(completed(1, 0)), unblinded(completed(2, 1))]).may_tell_seed());
    }
}
