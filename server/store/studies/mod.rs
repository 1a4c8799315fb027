//! Studies as the database keeps them: read here, written in `writing`, opened from the command line in `book`.

mod book;
mod reading;
mod replay;
mod verify;
mod writing;

use jiff::Timestamp;

use crate::clock::Moment;
use crate::ids::SessionId;
use crate::trial::allocation::Seed;
use crate::trial::event::Event;
use crate::trial::study::definition::Definition;
use crate::trial::study::event::StudyEvent;
use crate::trial::study::places::Enrolled;
use crate::trial::study::state::StudyState;

pub use book::StudyBook;
pub(super) use verify::check_studies;
pub(super) use writing::enrol;

/// A study to be planned.
#[derive(Debug, Clone)]
pub struct NewStudy {
    /// What is planned.
    pub definition: Definition,
    /// The sites of it that this database runs.
    pub sites: Vec<String>,
    /// When, by the wall clock.
    pub wall: Timestamp,
}

/// A study read back.
#[derive(Debug, Clone)]
pub struct StoredStudy {
    /// What was planned, with the protocols as they were then.
    pub definition: Definition,
    /// The sites of it that this database runs.
    pub sites: Vec<String>,
    /// What its orders were drawn from, once they were.
    pub seed: Option<Seed>,
    /// Its events.
    pub events: Vec<StudyEvent>,
    /// Its sessions, in the order in which they were made.
    pub sessions: Vec<Enrolled>,
}

impl StoredStudy {
    /// Where it stands.
    #[must_use]
    pub fn state(&self) -> StudyState {
        StudyState::after(&self.events)
    }
}

/// What is written with a change of a study, in one transaction.
#[derive(Debug, Clone)]
pub struct StudyChange {
    /// What happened.
    pub event: StudyEvent,
    /// When it happened by the monotonic clock; only a server has one.
    pub at: Option<Moment>,
    /// The seed of its orders, where they were drawn.
    pub seed: Option<Seed>,
    /// Events of its sessions that go with it.
    pub sessions: Vec<(SessionId, Vec<Event>)>,
}

/// Where a session belongs in a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Enrolment {
    /// The study's name.
    pub study: String,
    /// SHA-256 of its definition.
    pub definition_sha256: String,
    /// The site.
    pub site: String,
    /// The protocol.
    pub protocol: String,
    /// The place in the list of both, from 1.
    pub place: usize,
}
