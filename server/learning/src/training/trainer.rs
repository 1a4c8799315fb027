//! The interface of everything that learns: the steps that a training repeats for every kind of policy.

use std::sync::{Mutex, PoisonError};

use tch::nn;

use super::run::checkpoint::Checkpoint;
use crate::LearningError;
use parfocal_autofocus::weights::{self, WeightsError};

/// Draws random weights by `draw`, the same for the same `seed`. libtorch draws all of a process's weights from one
/// generator, so two trainings take turns.
pub(in crate::training) fn drawn_with<Networks>(seed: u64, draw: impl FnOnce() -> Networks) -> Networks {
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    tch::manual_seed(i64::from_ne_bytes(seed.to_ne_bytes()));
    draw()
}

/// Trains one policy. Its results depend only on its recipe, its seed, its scenery and the seeds of its legs.
pub trait Trainer: Send {
    /// The variables of the network in training.
    fn store(&self) -> &nn::VarStore;

    /// Updates done so far.
    fn updates(&self) -> u64;

    /// Replaces all scans by new ones drawn with `seed`.
    fn begin_leg(&mut self, seed: u64);

    /// Plays some frames, learns from them, and returns the loss.
    fn update(&mut self) -> f64;

    /// The present share of random actions; `None` if the policy does not explore with random actions.
    fn epsilon(&self) -> Option<f64> {
        None
    }

    /// Begins with the weights in `bytes` (safetensors) instead of random ones.
    ///
    /// # Errors
    /// If they are damaged or belong to another network.
    fn begin_from(&mut self, bytes: &[u8]) -> Result<(), WeightsError> {
        weights::load(self.store(), bytes)
    }

    /// Adds to `checkpoint` all that [`Trainer::restore`] needs. Called between two legs.
    fn save<'a>(&'a self, checkpoint: &mut Checkpoint<'a>);

    /// Restores what [`Trainer::save`] added.
    ///
    /// # Errors
    /// If the checkpoint is damaged or belongs to another training.
    fn restore(&mut self, checkpoint: &mut Checkpoint<'_>) -> Result<(), LearningError>;
}
