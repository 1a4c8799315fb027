//! Training: how a policy learns from focal-time scans, from its recipe to the weights in a run folder.

pub mod belief;
pub mod dqn;
pub mod environment;
pub mod optimiser;
pub mod recipe;
pub mod run;
pub mod served;
pub mod trainer;
