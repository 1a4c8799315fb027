//! Environments for a training in another program, over a pipe in each direction. `docs/python.md` describes what travels.

mod answer;
mod fleet;
mod protocol;

pub use answer::Shows;
pub use fleet::Fleet;
pub use protocol::{ProtocolError, serve};
