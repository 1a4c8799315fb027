//! The chain: a row for each record that counts as evidence, each with the hash of the row before. Any change, loss,
//! insertion or other order of records is found by computing it again. `docs/evidence.md` has the form and its limits.

mod adopt;
mod append;
pub mod check;
mod form;
pub mod kinds;
mod records;
mod telemetry;

pub use adopt::adopt;
pub use append::{append, head};
pub use form::{Entry, Head, sealed};
pub use form::{Fields, begin_sealed};
pub use records::{Record, all};
pub use telemetry::{Block, OPEN, SEALED, begin_open, hashes, seal, unsealed};
