//! What a training does over and over, whichever kind of policy learns.

use tch::{Device, nn};

use super::belief::BeliefTrainer;
use super::dqn::DqnTrainer;
use super::error::TrainError;
use super::recipe::Recipe;
use super::run::checkpoint::{Checkpoint, CheckpointError};
use crate::autofocus::shipped::Design;
use crate::autofocus::weights::{self, WeightsError};
use crate::scans::scenery::Scenery;

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

/// A trainer from nothing, by `recipe`, of a policy of `design`; its network on `device`.
///
/// # Errors
/// When the recipe holds no section for such a policy.
pub fn trainer(
    design: Design,
    recipe: &Recipe,
    scenery: Scenery,
    seed: u64,
    device: Device,
) -> Result<Box<dyn Trainer>, TrainError> {
    Ok(match (design, &recipe.dqn, &recipe.belief) {
        (Design::Values(sight), Some(dqn), _) => Box::new(DqnTrainer::new(sight, dqn.clone(), scenery, seed, device)),
        (Design::Belief, _, Some(belief)) => Box::new(BeliefTrainer::new(belief.clone(), scenery, seed, device)),
        _ => return Err(TrainError::Recipe(format!("the recipe's section does not fit '{}'", recipe.policy))),
    })
}
