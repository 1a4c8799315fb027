//! Making a session: who, by which protocol, and the order drawn for it.

use rand::Rng;
use rand_chacha::ChaCha12Rng;
use uuid::Uuid;

use super::course::Course;
use super::{ConductError, Shared, operator_only};
use crate::autofocus::PolicyName;
use crate::ids::{SegmentId, SessionId};
use crate::store::{NewSession, SetMember, Stamp};
use crate::trial::allocation::Seed;
use crate::trial::commitment::Allocation;
use crate::trial::event::{Event, EventKind};
use crate::trial::protocol::Protocol;
use crate::trial::role::Role;

impl Shared {
    pub(super) async fn create(&self, by: Role, participant: &str, protocol: &str) -> Result<SessionId, ConductError> {
        operator_only(by)?;
        let mut pen = self.pen.lock().await;
        self.record_stops(&mut pen).await?;
        if self.live().course.as_ref().is_some_and(|course| !course.state.ended()) {
            let text = "a session is under way; complete or abort it first";
            return Err(ConductError::Conflict(text.to_owned()));
        }
        self.check_participant(participant).await?;
        let protocol = self.runnable(protocol)?;
        let pen = &mut *pen;
        let random = if protocol.practice { &mut pen.practice_random } else { &mut pen.random };
        let (seed, set_index) = self.draw_place(&protocol, random).await?;
        let made = self.make(participant, &protocol, seed, set_index, random);
        let Stamp { at, wall } = made.stamp;
        let created = Event { number: 1, by, at, wall, kind: EventKind::Created };
        self.store.create_session(&made, &created).await?;
        let session = made.session;
        let mut live = self.live();
        live.course = Some(Course::new(made, protocol, created, self.run_clock()));
        self.publish(&live);
        self.wake();
        Ok(session)
    }

    async fn check_participant(&self, code: &str) -> Result<(), ConductError> {
        let known = self.store.reader().participants().await?;
        if known.iter().any(|participant| participant.code == code) {
            return Ok(());
        }
        let code: String = code.chars().take(40).collect();
        Err(ConductError::NotFound(format!("there is no participant '{code}'; add the code first")))
    }

    /// Protocol `name`, if every policy of it can run now.
    fn runnable(&self, name: &str) -> Result<Protocol, ConductError> {
        let protocol = self.library.get(name).ok_or_else(|| {
            let name: String = name.chars().take(40).collect();
            ConductError::NotFound(format!("there is no protocol '{name}'; there are: {}", self.library.names()))
        })?;
        for policy in &protocol.policies {
            self.registry
                .build(policy)
                .map_err(|error| ConductError::Conflict(format!("protocol '{name}' cannot run: {error}")))?;
        }
        Ok(protocol.clone())
    }

    /// The seed, and the place in the set that shares it: the first free place of a set still open, or a fresh seed.
    async fn draw_place(&self, protocol: &Protocol, random: &mut ChaCha12Rng) -> Result<(Seed, usize), ConductError> {
        let algorithm = protocol.order.algorithm();
        let size = algorithm.set_size(protocol.policies.len());
        if size > 1 {
            let set = self.store.reader().latest_set(&hex::encode(protocol.sha256()), algorithm).await?;
            if let Some(place) = free_place(&set, size) {
                return Ok(place);
            }
        }
        Ok((Seed::random(random), 0))
    }

    fn make(
        &self,
        participant: &str,
        protocol: &Protocol,
        seed: Seed,
        set_index: usize,
        random: &mut ChaCha12Rng,
    ) -> NewSession {
        let algorithm = protocol.order.algorithm();
        let order = algorithm.draw(seed, protocol.policies.len(), protocol.repeats, set_index);
        let schedule: Vec<PolicyName> = order.into_iter().map(|policy| protocol.policies[policy].clone()).collect();
        let session = SessionId(random_uuid(random));
        let allocation = Allocation {
            session,
            algorithm,
            seed,
            index: set_index,
            protocol_sha256: protocol.sha256(),
            schedule: schedule.clone(),
        };
        NewSession {
            session,
            stamp: Stamp { wall: self.clock.wall(), at: self.clock.now() },
            participant: participant.to_owned(),
            protocol: protocol.name.clone(),
            protocol_toml: protocol.source.to_string(),
            protocol_sha256: hex::encode(protocol.sha256()),
            practice: protocol.practice,
            algorithm,
            seed,
            set_index,
            commitment: allocation.commitment(),
            segments: schedule.into_iter().map(|policy| (SegmentId(random_uuid(random)), policy)).collect(),
        }
    }
}

/// The first place of an open set that no session holds. An aborted session gives its place back; unblinding one closes
/// the set, because its order tells the others' apart.
fn free_place(set: &[SetMember], size: usize) -> Option<(Seed, usize)> {
    let seed = set.first()?.seed;
    if set.iter().any(|member| member.unblinded) {
        return None;
    }
    let taken = |index: &usize| set.iter().any(|member| member.index == *index && !member.aborted);
    (0..size).find(|index| !taken(index)).map(|index| (seed, index))
}

fn random_uuid(random: &mut ChaCha12Rng) -> Uuid {
    let mut bytes = [0; 16];
    random.fill_bytes(&mut bytes);
    uuid::Builder::from_random_bytes(bytes).into_uuid()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn member(index: usize, aborted: bool, unblinded: bool) -> SetMember {
        SetMember { seed: Seed([7; 32]), index, aborted, unblinded }
    }

    #[test]
    fn places_are_taken_in_order_and_an_aborted_sessions_is_given_back() {
        assert_eq!(free_place(&[], 6), None);
        let set = [member(0, false, false), member(1, true, false), member(2, false, false)];
        assert_eq!(free_place(&set, 6), Some((Seed([7; 32]), 1)));
        assert_eq!(free_place(&set[..1], 6), Some((Seed([7; 32]), 1)));
    }

    #[test]
    fn a_full_or_unblinded_set_is_closed() {
        let full: Vec<SetMember> = (0..6).map(|index| member(index, false, false)).collect();
        assert_eq!(free_place(&full, 6), None);
        assert_eq!(free_place(&[member(0, false, true)], 6), None);
    }
}
