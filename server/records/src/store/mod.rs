//! The store: everything that is SQLite, and the only place with SQL. It decides nothing.
//!
//! The database is one file, `parfocal.db`, in WAL mode. A server uses three kinds of connections. The one for trial
//! data syncs every commit to the disk before it is acknowledged. The one for telemetry does not. Readers never write.
//! A lock on the folder keeps a second server out, while programs that only read come and go.

// Before those that use its macro.
#[macro_use]
mod held;

mod accesses;
mod accounts;
mod actors;
pub mod backup;
mod backups;
mod chain;
mod consents;
mod corrections;
mod database;
mod device_events;
mod erasures;
mod error;
pub mod export;
mod export_rows;
mod insert;
mod lock;
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
mod writer;
mod writes;

pub use accesses::{Access, AccessLog};
pub use accounts::{
    AccountBook, AccountEvent, AccountLine, FailedAttempt, PassphraseHash, StoredAccount, StoredSignIn,
};
pub use backups::{BackupState, Backups, FinishedBackup};
pub use chain::Head;
pub use consents::StoredConsent;
pub use corrections::{Correction, LatestCorrections, StoredCorrection};
pub use database::{LockedFolder, ServerRun, Store};
pub use erasures::{Erased, Erasure, StoredErasure};
pub use error::StoreError;
pub use motion::LensMotion;
pub use reader::Reader;
pub use remarks::{KeepOutcome, withdrawn};
pub use rows::*;
pub use schema::MIGRATOR;
pub use sessions::{NewSession, StoredSession};
pub use studies::{Enrolment, NewStudy, StoredStudy, StudyBook, StudyChange};
pub use verify::verify_database;
pub use voice::{KeptVoice, PieceKept, StoredPiece, VoicePiece, VoiceRecording};
pub use whole::look_at_database;
pub use writes::{Counts, WriteTimes, Writes};
