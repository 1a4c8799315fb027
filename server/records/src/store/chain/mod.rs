//! The chain: a row for each record that counts as evidence, each with the hash of the row before. Computing the chain
//! again finds any record that was changed, lost, inserted or put elsewhere. `docs/evidence.md` has the form and its
//! limits.

mod append;
pub mod check;
mod form;
mod kinds;
mod reading;
mod records;
mod telemetry;

pub use append::append;
pub use form::{Entry, Fields, Head, begin_sealed, netstring};
pub use kinds::{RecordKind, UNBLINDED, kinds};
pub use reading::entry;
pub use records::{Record, all};
pub use telemetry::{Block, OPEN, SEALED, begin_open, hashes, seal, unsealed};
