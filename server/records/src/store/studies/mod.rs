//! Studies as the database keeps them: read in `reading`, written in `writing`, opened from the command line in `book`,
//! checked in `verify` and `replay`.

mod book;
mod reading;
mod replay;
mod verify;
mod writing;

use jiff::Timestamp;

use parfocal_base::clock::Moment;
use parfocal_base::ids::SessionId;
use parfocal_trial::allocation::Seed;
use parfocal_trial::event::Event;
use parfocal_trial::study::definition::Definition;
use parfocal_trial::study::event::StudyEvent;
use parfocal_trial::study::places::Enrolled;
use parfocal_trial::study::state::StudyState;

pub use book::StudyBook;
pub(super) use verify::check_studies;
pub(super) use writing::enrol;

/// A study to be planned.
#[derive(Debug, Clone)]
pub struct NewStudy {
    /// Definition of the study.
    pub definition: Definition,
    /// Names of its sites that this database runs.
    pub sites: Vec<String>,
    /// When it is planned, by the wall clock.
    pub wall: Timestamp,
}

/// A study read back.
#[derive(Debug, Clone)]
pub struct StoredStudy {
    /// Definition of the study, with the protocols as they were when it was planned.
    pub definition: Definition,
    /// Names of its sites that this database runs.
    pub sites: Vec<String>,
    /// Seed of its orders; `None` until they are drawn.
    pub seed: Option<Seed>,
    /// Its events, in order.
    pub events: Vec<StudyEvent>,
    /// Its sessions, in the order in which they were made.
    pub sessions: Vec<Enrolled>,
}

impl StoredStudy {
    /// The state that its events lead to.
    pub fn state(&self) -> StudyState {
        StudyState::after(&self.events)
    }
}

/// What is written with a change of a study, in one transaction.
#[derive(Debug, Clone)]
pub struct StudyChange {
    /// The event.
    pub event: StudyEvent,
    /// When it happened, by the monotonic clock; `None` from the command line.
    pub at: Option<Moment>,
    /// Seed of the orders, if this change draws them.
    pub seed: Option<Seed>,
    /// Events of sessions that are written with it.
    pub sessions: Vec<(SessionId, Vec<Event>)>,
}

/// The place of a session in a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Enrolment {
    /// The study's name.
    pub study: String,
    /// SHA-256 of its definition.
    pub definition_sha256: String,
    /// Name of the site.
    pub site: String,
    /// Name of the protocol.
    pub protocol: String,
    /// Place in the list of this site and protocol, from 1.
    pub place: usize,
}
