//! Makes a session: checks the participant, finds the protocol, and draws the session's order.

use rand::Rng;
use rand_chacha::ChaCha12Rng;
use uuid::Uuid;

use super::course::Course;
use super::{ConductError, Pen, Shared, StudyPlace};
use parfocal_base::PolicyName;
use parfocal_base::boxed;
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_records::store::{Enrolment, NewSession, Stamp};
use parfocal_trial::account::Actor;
use parfocal_trial::allocation::Seed;
use parfocal_trial::commitment::Allocation;
use parfocal_trial::event::{Event, EventKind};
use parfocal_trial::permission::{self, CurrentSession, Request};
use parfocal_trial::protocol::Protocol;
use parfocal_trial::refusal::Refusal;
use parfocal_trial::study::lists::List;
use parfocal_trial::study::places::next_place;

/// The protocol and the place in an order that a new session gets.
struct DrawnOrder {
    protocol: Protocol,
    /// The seed of the session's set.
    seed: Seed,
    /// The session's index in the set.
    index: usize,
    /// The session's place in a study; `None` outside studies.
    enrolment: Option<Enrolment>,
}

impl Shared {
    #[boxed]
    pub(super) async fn create(
        &self,
        by: Actor,
        participant: &str,
        protocol: &str,
        place: Option<StudyPlace>,
    ) -> Result<SessionId, ConductError> {
        let mut pen = self.pen.lock().await;
        if let Some(course) = self.live().course.as_mut() {
            course.record_movement();
        }
        self.record_stops(&mut pen).await?;
        let current = CurrentSession::of(self.live().course.as_ref().map(|course| course.state.phase()));
        permission::check(by.role, Request::MakeSession, current)?;
        self.check_participant(participant).await?;

        let pen = &mut *pen;
        let drawn = match place {
            Some(place) => self.draw_in_study(place, protocol, participant).await?,
            None => self.draw_outside(protocol, pen).await?,
        };

        let DrawnOrder { protocol, seed, index, enrolment } = drawn;
        let random = if protocol.practice { &mut pen.practice_random } else { &mut pen.random };
        let made = self.make(participant, &protocol, seed, index, random);
        let Stamp { at, wall } = made.stamp;
        let Actor { role: by, account } = by;
        let created = Event { number: 1, by, account, at, wall, kind: EventKind::Created };
        self.store.create_session(&made, &created, enrolment.as_ref()).await?;

        let session = made.session;
        let study = enrolment.map(|enrolment| enrolment.study);
        let before = {
            let mut live = self.live();
            let before = live.course.replace(Course::new(made, protocol, created, study, self.run_clock.clone()));
            self.publish(&live);
            before
        };
        self.wake();
        if let Some(before) = before {
            self.record_last_of(before).await;
        }
        Ok(session)
    }

    /// Records what was not on disk yet of `course` when another session took its place: somebody may have moved the
    /// lens by hand meanwhile.
    async fn record_last_of(&self, mut course: Course) {
        course.record_movement();
        let (events, _) = course.unrecorded();
        if events.is_empty() {
            return;
        }
        if let Err(error) = self.store.append_events(course.session(), events).await {
            tracing::error!("how the lens was moved by hand after session {} is lost: {error}", course.session());
        }
    }

    /// An order for a session outside any study, by the installed protocol.
    async fn draw_outside(&self, protocol: &str, pen: &mut Pen) -> Result<DrawnOrder, ConductError> {
        let protocol = self.library.get(protocol).cloned().ok_or_else(|| {
            let name: String = protocol.chars().take(40).collect();
            ConductError::NotFound(format!("there is no protocol '{name}'; there are: {}", self.library.names()))
        })?;
        self.check_runnable(&protocol)?;

        let random = if protocol.practice { &mut pen.practice_random } else { &mut pen.random };
        let (seed, index) = self.draw_place(&protocol, random).await?;
        Ok(DrawnOrder { protocol, seed, index, enrolment: None })
    }

    /// The next place in the list of a study's site, by the protocol as it was when the study was planned.
    async fn draw_in_study(
        &self,
        StudyPlace { study, site }: StudyPlace,
        protocol: &str,
        participant: &str,
    ) -> Result<DrawnOrder, ConductError> {
        let stored = self.studies.stored(&study).await?;
        stored.state().check_takes_sessions()?;

        let definition = &stored.definition;
        let here = definition.site(&site).filter(|site| stored.sites.contains(&site.name));
        let site = here.ok_or_else(|| {
            let here = stored.sites.join(", ");
            Refusal::Invalid(format!("the study has no site '{site}' here; there are: {here}"))
        })?;
        let protocol = definition.protocol(protocol).ok_or_else(|| {
            let name: String = protocol.chars().take(40).collect();
            let known: Vec<&str> = definition.protocols.iter().map(|protocol| protocol.name.as_str()).collect();
            Refusal::Invalid(format!("the study has no protocol '{name}'; it has: {}", known.join(", ")))
        })?;
        self.check_runnable(protocol)?;

        let place = next_place(definition, &stored.sessions, site, &protocol.name, participant)?;
        let missing = || ConductError::Storage(format!("the orders of study {study} are not in the database"));
        let list = List::draw(&site.name, protocol, site.places(), stored.seed.ok_or_else(missing)?);
        let drawn = list.places.get(place - 1).ok_or_else(missing)?;

        let enrolment = Enrolment {
            study: definition.name.as_str().to_owned(),
            definition_sha256: definition.sha256(),
            site: site.name.clone(),
            protocol: protocol.name.clone(),
            place,
        };
        Ok(DrawnOrder { protocol: protocol.clone(), seed: drawn.seed, index: drawn.index, enrolment: Some(enrolment) })
    }

    async fn check_participant(&self, code: &str) -> Result<(), ConductError> {
        let known = self.store.reader().participants().await?;
        if known.iter().any(|known| known == code) {
            return Ok(());
        }
        let code: String = code.chars().take(40).collect();
        Err(ConductError::NotFound(format!("there is no participant '{code}'; add the code first")))
    }

    /// Checks that every policy of `protocol` can run now.
    fn check_runnable(&self, protocol: &Protocol) -> Result<(), ConductError> {
        for policy in &protocol.policies {
            let name = &protocol.name;
            self.registry
                .check(policy)
                .map_err(|error| ConductError::Conflict(format!("protocol '{name}' cannot run: {error}")))?;
        }
        Ok(())
    }

    /// A seed, and a place in the set of sessions that share it: the first free place of the latest set if that is
    /// still open, otherwise place 0 of a new seed.
    async fn draw_place(&self, protocol: &Protocol, random: &mut ChaCha12Rng) -> Result<(Seed, usize), ConductError> {
        let size = protocol.set_size();
        if size > 1 {
            let algorithm = protocol.order.algorithm();
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
            stamp: self.stamp(),
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
