//! Changes to studies: the rules decide, then the disk stores them. The server makes changes beside its sessions; a
//! command makes them while no server runs.

use std::path::Path;
use std::sync::Arc;

use jiff::Timestamp;
use rand_chacha::ChaCha12Rng;

use super::{ConductError, Library};
use parfocal_base::boxed;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::ids::SessionId;
use parfocal_records::store::{
    Enrolment, NewStudy, Reader, RunClocks, Store, StoreError, StoredStudy, StudyBook, StudyChange,
};
use parfocal_trial::allocation::Seed;
use parfocal_trial::event::{Event, EventKind};
use parfocal_trial::protocol::Protocol;
use parfocal_trial::role::Role;
use parfocal_trial::study::concerns::concerns;
use parfocal_trial::study::definition::{Definition, StudyName};
use parfocal_trial::study::event::{StudyEvent, StudyEventKind};
use parfocal_trial::study::lists::Lists;
use parfocal_trial::study::signature::{Channel, Signature};
use parfocal_trial::study::stage::Stage;
use parfocal_trial::study::state::{Change, StudyCircumstances, check_way};

/// Reads and changes studies. Nothing else may change a study at the same time: the server holds the right to write,
/// and a command keeps servers out.
#[derive(Clone)]
pub struct Studies {
    book: StudyBook,
    protocols: Vec<Protocol>,
    clock: Arc<dyn Clock>,
}

impl Studies {
    pub(super) fn of_server(store: &Store, library: &Library, clock: Arc<dyn Clock>) -> Self {
        Self { book: StudyBook::of_server(store), protocols: library.protocols(), clock }
    }

    /// The studies in data folder `folder`, for a command. Keeps servers out until it is closed.
    ///
    /// # Errors
    /// If there is no database, a server has it open, or it is not of this version.
    pub async fn open(folder: &Path, library: &Library, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        let book = StudyBook::open(folder).await?;
        Ok(Self { book, protocols: library.protocols(), clock })
    }

    /// Reads the database.
    pub fn reader(&self) -> &Reader {
        self.book.reader()
    }

    /// Closes the connections, if it has its own.
    pub async fn close(&self) {
        self.book.close().await;
    }

    /// Plans the study that `definition`, the text of `file`, describes. This database runs its sites `sites`, or all
    /// sites if none are named.
    ///
    /// # Errors
    /// If the definition is malformed, a study of that name exists, or it has no such site.
    #[boxed]
    pub async fn plan(
        &self,
        way: Channel,
        definition: &str,
        file: &str,
        sites: &[String],
        signature: Signature,
    ) -> Result<StudyName, ConductError> {
        check_way(way)?;
        let definition = Definition::parse(definition, file, &self.protocols)
            .map_err(|error| ConductError::Invalid(error.to_string()))?;
        let sites = sites_here(&definition, sites)?;

        let name = definition.name.clone();
        if self.reader().study_names().await?.iter().any(|known| known == name.as_str()) {
            return Err(ConductError::Conflict(format!(
                "there is already a study '{name}'; a changed plan is a new study and needs a new name"
            )));
        }

        let wall = self.clock.wall();
        let event = StudyEvent { number: 1, way, signature, wall, kind: StudyEventKind::Planned };
        let planned = StudyChange { event, at: self.at(), seed: None, sessions: Vec::new() };
        self.book.plan(&NewStudy { definition, sites, wall }, &planned).await?;
        Ok(name)
    }

    /// Changes study `name`. Its orders are drawn from `random`; `on_screens` is the session that the operator's page
    /// shows.
    ///
    /// # Errors
    /// If there is no such study, the rules refuse the change, or the disk failed.
    #[boxed]
    pub async fn change(
        &self,
        way: Channel,
        name: &str,
        change: Change,
        signature: Signature,
        on_screens: Option<SessionId>,
        random: &mut ChaCha12Rng,
    ) -> Result<(), ConductError> {
        let study = self.stored(name).await?;
        let state = study.state();
        let outstanding = match change {
            Change::Lock { .. } => outstanding_sessions(self.reader(), &study, |clocks| self.now(clocks)).await?,
            _ => 0,
        };
        let concerns = match change {
            Change::Open { .. } => plan_concerns(self.reader(), &study).await?,
            _ => Vec::new(),
        };
        let circumstances = StudyCircumstances {
            concerns: &concerns,
            definition: &study.definition,
            sessions: &study.sessions,
            on_screens,
            outstanding,
            has_accounts: self.reader().has_accounts().await?,
        };
        state.check(change, way, &signature, circumstances)?;

        let mut seed = None;
        let mut sessions = Vec::new();
        let kind = match change {
            Change::Open { .. } => {
                let commitment = if study.seed.is_none() {
                    let drawn = Seed::random(random);
                    seed = Some(drawn);
                    Some(Lists::draw(&study.definition, &study.sites, drawn).commitment())
                } else {
                    None
                };
                StudyEventKind::Opened { commitment }
            }
            Change::Close => StudyEventKind::Closed,
            Change::Lock { .. } => StudyEventKind::Locked,
            Change::Unblind => {
                sessions = self.unblindings(&study, &signature).await?;
                StudyEventKind::Unblinded
            }
            Change::Withdraw { session } => {
                let withdrawn = EventKind::Withdrawn { reason: signature.reason.clone() };
                sessions.push((session, vec![self.next_event(session, withdrawn, &signature).await?]));
                StudyEventKind::SessionWithdrawn { session }
            }
        };

        let event = StudyEvent { number: state.events + 1, way, signature, wall: self.clock.wall(), kind };
        let change = StudyChange { event, at: self.at(), seed, sessions };
        Ok(self.book.change(&study.definition.name, &change).await?)
    }

    /// Records an emergency unblinding in its study, together with `events`, which include `unblinding`.
    pub(super) async fn session_unblinded(
        &self,
        enrolment: &Enrolment,
        session: SessionId,
        events: &[Event],
        unblinding: &Event,
        signature: &Signature,
    ) -> Result<(), ConductError> {
        let study = self.stored(&enrolment.study).await?;

        let event = StudyEvent {
            number: study.state().events + 1,
            way: Channel::Role(unblinding.by),
            signature: signature.clone(),
            wall: unblinding.wall,
            kind: StudyEventKind::SessionUnblinded { session },
        };
        let sessions = vec![(session, events.to_vec())];
        let change = StudyChange { event, at: Some(unblinding.at), seed: None, sessions };
        Ok(self.book.change(&study.definition.name, &change).await?)
    }

    /// The study called `name`.
    pub(crate) async fn stored(&self, name: &str) -> Result<StoredStudy, ConductError> {
        if let Some(study) = self.reader().study(name).await? {
            return Ok(study);
        }
        let name: String = name.chars().take(40).collect();
        let known = self.reader().study_names().await?;
        let known = if known.is_empty() { "none yet".to_owned() } else { known.join(", ") };
        Err(ConductError::NotFound(format!("there is no study '{name}'; there are: {known}")))
    }

    /// The studies that accept new sessions now.
    pub(crate) async fn taking_sessions(&self) -> Result<Vec<StoredStudy>, ConductError> {
        let mut open = Vec::new();
        for name in self.reader().study_names().await? {
            let study = self.stored(&name).await?;
            if study.state().stage == Stage::Open {
                open.push(study);
            }
        }
        Ok(open)
    }

    /// The present moment on the monotonic clock of the sessions; `None` in a command, which has none.
    fn at(&self) -> Option<Moment> {
        self.book.run().map(|_| self.clock.now())
    }

    /// The present time, on the clock that continues over the server's restarts.
    pub(crate) fn now(&self, clocks: &RunClocks) -> Timestamp {
        match self.book.run() {
            Some(run) => clocks.wall(run, self.clock.now()),
            None => self.clock.wall(),
        }
    }

    /// The unblinding of each session of `study` that is still blinded.
    async fn unblindings(
        &self,
        study: &StoredStudy,
        signature: &Signature,
    ) -> Result<Vec<(SessionId, Vec<Event>)>, ConductError> {
        let mut unblindings = Vec::new();
        for enrolled in study.sessions.iter().filter(|enrolled| !enrolled.unblinded) {
            let kind = EventKind::Unblinded { reason: signature.reason.clone(), emergency: false };
            unblindings.push((enrolled.session, vec![self.next_event(enrolled.session, kind, signature).await?]));
        }
        Ok(unblindings)
    }

    /// The next event of a session that is not under way, by the person who signed.
    async fn next_event(
        &self,
        session: SessionId,
        kind: EventKind,
        signature: &Signature,
    ) -> Result<Event, ConductError> {
        let events = self.reader().events(session).await?;
        let number = events.last().map_or(0, |(_, event)| event.number) + 1;
        let account = signature.account.clone();
        Ok(Event { number, by: Role::Researcher, account, at: self.clock.now(), wall: self.clock.wall(), kind })
    }
}

/// The sites that a database runs: those in `wanted`, or all if it is empty.
fn sites_here(definition: &Definition, wanted: &[String]) -> Result<Vec<String>, ConductError> {
    let known: Vec<String> = definition.sites.iter().map(|site| site.name.clone()).collect();
    if let Some(unknown) = wanted.iter().find(|site| !known.contains(site)) {
        let unknown: String = unknown.chars().take(40).collect();
        return Err(ConductError::Invalid(format!("the study has no site '{unknown}'; it has: {}", known.join(", "))));
    }
    Ok(if wanted.is_empty() { known } else { known.into_iter().filter(|site| wanted.contains(site)).collect() })
}

/// What in the plan of `study` cannot work as it is meant.
pub(crate) async fn plan_concerns(reader: &Reader, study: &StoredStudy) -> Result<Vec<String>, StoreError> {
    let mut enabled = reader.accounts().await?;
    enabled.retain(|account| !account.disabled);
    Ok(concerns(&study.definition, &enabled, &study.sites))
}

/// Number of sessions of `study` for which a surgeon's device may still hold something that counts. Nothing of a
/// withdrawn session does. `now` tells the present time by the clocks of the server's runs.
pub(crate) async fn outstanding_sessions(
    reader: &Reader,
    study: &StoredStudy,
    now: impl FnOnce(&RunClocks) -> Timestamp,
) -> Result<usize, StoreError> {
    let clocks = reader.run_clocks().await?;
    let now = now(&clocks);
    let mut outstanding = 0;
    for enrolled in study.sessions.iter().filter(|enrolled| !enrolled.withdrawn) {
        let Some(stored) = reader.session(enrolled.session).await? else { continue };
        let left = super::outstanding(reader, &clocks, enrolled.session, stored.grace(&clocks), now).await?;
        outstanding += usize::from(left.is_some());
    }
    Ok(outstanding)
}
