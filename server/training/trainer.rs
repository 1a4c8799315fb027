//! The steps that a training repeats, whichever kind of policy learns.

use tch::nn;

use super::run::checkpoint::{Checkpoint, CheckpointError};
use crate::autofocus::weights::{self, WeightsError};

/// One that learns. What it does depends on its recipe, its seed, its scenery and the seeds of its legs alone.
pub trait Trainer: Send {
    /// The variables of the network that is trained.
    fn store(&self) -> &nn::VarStore;

    /// Updates done.
    fn updates(&self) -> u64;

    /// Begins all scans anew, drawn from `seed`.
    fn begin_leg(&mut self, seed: u64);

    /// Plays some frames, learns from them, and returns the loss.
    fn update(&mut self) -> f64;

    /// Share of random actions at present, for those that explore so.
    fn epsilon(&self) -> Option<f64> {
        None
    }

    /// Begins with the weights in `bytes` (safetensors) in the place of random ones.
    ///
    /// # Errors
    /// When they are damaged or another network's.
    fn begin_from(&mut self, bytes: &[u8]) -> Result<(), WeightsError> {
        weights::load(self.store(), bytes)
    }

    /// Adds all that [`Trainer::restore`] needs, between two legs.
    fn save<'a>(&'a self, checkpoint: &mut Checkpoint<'a>);

    /// Takes back what [`Trainer::save`] added.
    ///
    /// # Errors
    /// When the checkpoint is of another training.
    fn restore(&mut self, checkpoint: &mut Checkpoint<'_>) -> Result<(), CheckpointError>;
}
