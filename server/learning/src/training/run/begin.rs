//! Makes the trainer that a recipe describes.

use tch::Device;

use crate::scans::scenery::Scenery;
use crate::training::belief::BeliefTrainer;
use crate::training::dqn::DqnTrainer;
use crate::training::error::TrainError;
use crate::training::recipe::Recipe;
use crate::training::trainer::Trainer;
use parfocal_autofocus::shipped::Design;

/// A trainer, with random weights, of a policy of `design` as `recipe` says, with its networks on `device`.
///
/// # Errors
/// If the recipe has no section for such a policy.
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
        _ => return Err(recipe.has_the_wrong_section()),
    })
}
