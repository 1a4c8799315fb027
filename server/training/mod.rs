//! Training: focal-time scans, replay memory, DQN, evaluation. Knows no web.

pub mod belief;
pub mod checkpoint;
pub mod clip;
mod curves;
pub mod defocus;
pub mod dqn;
mod dqn_batch;
pub mod dqn_recipe;
mod encoder;
pub mod evaluate;
pub mod footage;
pub mod optimiser;
pub mod pictures;
pub mod plot;
pub mod recipe;
pub mod recorded;
pub mod recording;
pub mod replay;
pub mod report;
pub mod rollout;
pub mod run;
pub mod scan;
pub mod session;
pub mod statistics;
pub mod tensorboard;
pub mod texture;
mod values;
