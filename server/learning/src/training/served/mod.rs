//! Environments for a training in another program, over a pipe in each direction. `docs/python.md` describes what travels.

mod fleet;
mod protocol;

pub use fleet::{Fleet, Shows};
pub use protocol::{ProtocolError, serve};
