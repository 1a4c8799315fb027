//! Recipes: every choice of a training, as TOML. Those that ship are in `recipes/`.

use serde::{Deserialize, Serialize};

use super::belief::BeliefRecipe;
use super::dqn_recipe::DqnRecipe;
use super::error::TrainError;
use super::evaluate::COUNT;
use crate::autofocus::shipped::{Design, design};

/// All that a training is made by, besides its seed and its footage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The policy it makes.
    pub policy: String,
    /// Pictures drawn to train on, where no footage is given.
    pub pictures: u64,
    /// Updates from one validation to the next; a checkpoint is written with each.
    pub validate_every: u64,
    /// Scans of the reference benchmark that the best weights are run on in the end, for their model card; 0: none.
    #[serde(default = "whole_benchmark")]
    pub benchmark: usize,
    /// How, for the paper's networks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dqn: Option<DqnRecipe>,
    /// How, for the belief tracker.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub belief: Option<BeliefRecipe>,
}

const fn whole_benchmark() -> usize {
    COUNT
}

/// The recipes that ship: ours by the policy's name, what comes after the belief tracker's with `-refined` behind it, the paper's
/// with `-paper`.
const SHIPPED: [(&str, &str); 8] = [
    ("mgm-learned", include_str!("recipes/mgm-learned.toml")),
    ("mlr-learned", include_str!("recipes/mlr-learned.toml")),
    ("cnn-learned", include_str!("recipes/cnn-learned.toml")),
    ("mgm-learned-paper", include_str!("recipes/mgm-learned-paper.toml")),
    ("mlr-learned-paper", include_str!("recipes/mlr-learned-paper.toml")),
    ("cnn-learned-paper", include_str!("recipes/cnn-learned-paper.toml")),
    ("parfocal", include_str!("recipes/parfocal.toml")),
    ("parfocal-refined", include_str!("recipes/parfocal-refined.toml")),
];

/// The text of the recipe that ships under `name`.
#[must_use]
pub fn shipped(name: &str) -> Option<&'static str> {
    SHIPPED.iter().find(|recipe| recipe.0 == name).map(|recipe| recipe.1)
}

/// Names of the recipes that ship.
#[must_use]
pub fn names() -> Vec<&'static str> {
    SHIPPED.iter().map(|recipe| recipe.0).collect()
}

impl Recipe {
    /// The recipe that `text` (TOML) describes.
    ///
    /// # Errors
    /// With line and key, when a key is unknown, missing or of the wrong type, or a number makes no sense.
    pub fn parse(text: &str) -> Result<Self, String> {
        let recipe: Self = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
        recipe.check()?;
        Ok(recipe)
    }

    /// What the policy is made of.
    ///
    /// # Errors
    /// When it is none that is learned.
    pub fn design(&self) -> Result<Design, TrainError> {
        let unknown = || {
            TrainError::Recipe(format!(
                "'{}' is no learned policy; there are mgm-learned, mlr-learned, cnn-learned and parfocal",
                self.policy
            ))
        };
        design(&self.policy).ok_or_else(unknown)
    }

    fn check(&self) -> Result<(), String> {
        let positive = |name: &str, value: u64| {
            if value == 0 { Err(format!("'{name}' must be at least 1")) } else { Ok(()) }
        };
        positive("pictures", self.pictures)?;
        positive("validate_every", self.validate_every)?;
        match (&self.dqn, &self.belief) {
            (Some(dqn), None) => {
                positive("dqn.scans", dqn.scans as u64)?;
                positive("dqn.frames_a_scan", dqn.frames_a_scan.into())?;
                positive("dqn.windows", dqn.windows as u64)?;
                positive("dqn.window", dqn.window as u64)?;
                if dqn.warm_up < (dqn.window * dqn.scans) as u64 {
                    return Err(format!("'dqn.warm_up' must be at least window * scans, {}", dqn.window * dqn.scans));
                }
                if dqn.replay < dqn.window * dqn.scans {
                    return Err(format!("'dqn.replay' must be at least window * scans, {}", dqn.window * dqn.scans));
                }
                Ok(())
            }
            (None, Some(belief)) => {
                positive("belief.scans", belief.scans as u64)?;
                positive("belief.window", belief.window as u64)?;
                positive("belief.windows_a_scan", belief.windows_a_scan as u64)
            }
            _ => Err("a recipe needs exactly one of [dqn] and [belief]".to_owned()),
        }
    }

    /// The same recipe for a training of `updates` updates.
    #[must_use]
    pub fn with_updates(mut self, updates: u64) -> Self {
        if let Some(dqn) = &mut self.dqn {
            dqn.updates = updates;
        }
        if let Some(belief) = &mut self.belief {
            belief.updates = updates;
        }
        self
    }

    /// Updates of the whole training.
    #[must_use]
    pub fn updates(&self) -> u64 {
        self.dqn.as_ref().map_or(0, |dqn| dqn.updates).max(self.belief.as_ref().map_or(0, |belief| belief.updates))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_recipe_is_sound_and_makes_its_policy() {
        for name in names() {
            let recipe = Recipe::parse(shipped(name).unwrap()).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(recipe.policy, name.trim_end_matches("-paper").trim_end_matches("-refined"));
        }
    }

    #[test]
    fn an_unknown_key_is_told_with_its_line() {
        let text = shipped("parfocal").unwrap().replace("clip = 1.0", "clipp = 1.0");
        let error = Recipe::parse(&text).unwrap_err();
        assert!(error.contains("clipp") && error.contains("line"), "{error}");
    }
}
