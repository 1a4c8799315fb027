//! The brain phantom: a generated brain surface seen by a hand-held camera.

mod cortex;
mod field;
mod scene;
mod sensor;
pub mod spectra;
mod vessels;

pub use scene::{SIDE, Scene};
