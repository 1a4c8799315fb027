//! Everything that measures or makes a policy away from a patient: scans, evaluation and training.
//!
//! A focal-time scan ([`scans`]) is a scene over time that can be seen at any focal power, with the optimum known at
//! every frame. [`evaluation`] lets policies run over scans and compares them; [`training`] learns policies from them.

#[macro_use(bail)]
extern crate parfocal_base;

mod error;
pub mod evaluation;
pub mod scans;
pub mod training;

pub use error::LearningError;
