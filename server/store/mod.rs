//! Store: everything SQLite; the only place with SQL. Decides nothing.
//!
//! One file, `parfocal.db`, in WAL mode. Three ways in: trial data on a connection that syncs every
//! commit to the disk before it is acknowledged; telemetry on its own, which does not; readers that
//! never write. A lock on the folder keeps a second server out, while programs that only read come
//! and go.

mod accesses;
mod accounts;
mod actors;
pub mod backup;
mod chain;
mod consents;
mod corrections;
mod counts;
mod database;
pub mod device_log;
mod erasures;
mod error;
pub mod export;
mod export_rows;
mod motion;
mod motions;
mod reader;
mod remarks;
mod rows;
mod schema;
mod scrub;
mod session_events;
mod sessions;
mod sets;
mod studies;
pub mod telemetry;
mod values;
mod verify;
mod voice;
mod whole;
mod withdrawals;
mod writes;

pub use accesses::{Access, Recorder};
pub use accounts::{
    AccountBook, AccountEvent, AccountLine, FailedAttempt, PassphraseHash, StoredAccount, StoredSignIn,
};
pub use chain::Head;
pub use consents::StoredConsent;
pub use corrections::{Correction, Latest, StoredCorrection};
pub use counts::Counts;
pub use database::{Run, Store};
pub use erasures::{Erasure, StoredErasure};
pub use error::StoreError;
pub use motion::Motion;
pub use reader::Reader;
pub use remarks::Kept;
pub use rows::*;
pub use schema::MIGRATOR;
pub use sessions::{NewSession, StoredSession};
pub use studies::{Enrolment, NewStudy, StoredStudy, StudyBook, StudyChange};
pub use verify::verify_database;
pub use voice::{KeptVoice, PieceKept, Recorded, StoredPiece, VoicePiece};
pub use whole::database_state;
pub use withdrawals::Withdrawal;
pub use writes::{WriteTimes, Writes};
