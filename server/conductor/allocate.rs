//! Making a session: who, by which protocol, and the order drawn for it.

use rand::Rng;
use rand_chacha::ChaCha12Rng;
use uuid::Uuid;

use super::course::Course;
use super::{ConductError, Shared};
use crate::autofocus::PolicyName;
use crate::ids::{SegmentId, SessionId};
use crate::store::{NewSession, Stamp};
use crate::trial::allocation::Seed;
use crate::trial::commitment::Allocation;
use crate::trial::event::{Event, EventKind};
use crate::trial::permission::{self, CurrentSession, Request};
use crate::trial::protocol::Protocol;
use crate::trial::role::Role;

impl Shared {
    pub(super) async fn create(&self, by: Role, participant: &str, protocol: &str) -> Result<SessionId, ConductError> {
        let mut pen = self.pen.lock().await;
        self.record_stops(&mut pen).await?;
        let current = CurrentSession::of(self.live().course.as_ref().map(|course| course.state.phase()));
        permission::check(by, Request::MakeSession, current)?;

        self.check_participant(participant).await?;
        let protocol = self.runnable(protocol)?;

        let pen = &mut *pen;
        let random = if protocol.practice { &mut pen.practice_random } else { &mut pen.random };
        let (seed, place) = self.draw_place(&protocol, random).await?;
        let made = self.make(participant, &protocol, seed, place, random);
        let Stamp { at, wall } = made.stamp;
        let created = Event { number: 1, by, at, wall, kind: EventKind::Created };
        self.store.create_session(&made, &created).await?;

        let session = made.session;
        let mut live = self.live();
        live.course = Some(Course::new(made, protocol, created, self.run_clock.clone()));
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

    /// The seed, and the place in the set that shares it: the first free place of a set that is
    /// still open, or a fresh seed.
    async fn draw_place(&self, protocol: &Protocol, random: &mut ChaCha12Rng) -> Result<(Seed, usize), ConductError> {
        let algorithm = protocol.order.algorithm();
        let size = algorithm.set_size(protocol.policies.len());

        if size > 1 {
            let latest = self.store.reader().latest_set(&hex::encode(protocol.sha256()), algorithm).await?;
            let free = latest.and_then(|set| Some((set.seed, set.free_place(size)?)));
            if let Some(place) = free {
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
        place: usize,
        random: &mut ChaCha12Rng,
    ) -> NewSession {
        let session = SessionId(random_uuid(random));
        let allocation = Allocation::draw(session, protocol, seed, place);
        let commitment = allocation.commitment();
        let with_id = |policy: PolicyName| (SegmentId(random_uuid(random)), policy);
        NewSession {
            session,
            stamp: Stamp { wall: self.clock.wall(), at: self.clock.now() },
            participant: participant.to_owned(),
            protocol: protocol.name.clone(),
            protocol_toml: protocol.source.to_string(),
            protocol_sha256: hex::encode(protocol.sha256()),
            practice: protocol.practice,
            algorithm: allocation.algorithm,
            seed,
            set_index: place,
            commitment,
            segments: allocation.schedule.into_iter().map(with_id).collect(),
        }
    }
}

fn random_uuid(random: &mut ChaCha12Rng) -> Uuid {
    let mut bytes = [0; 16];
    random.fill_bytes(&mut bytes);
    uuid::Builder::from_random_bytes(bytes).into_uuid()
}
