//! What whoever goes on with a training says of it: it must be what the training was begun with.

use std::path::{Path, PathBuf};

use crate::training::error::TrainError;
use crate::training::recipe::{Recipe, shipped};

/// What is asked of a training that goes on. What is not given is as it was at the beginning.
#[derive(Debug, Clone, Default)]
pub struct Asked {
    /// The policy, or the name of a recipe that ships.
    pub name: String,
    /// The whole recipe.
    pub recipe: Option<Recipe>,
    /// Updates in all.
    pub updates: Option<u64>,
    /// The seed.
    pub seed: Option<u64>,
    /// Where the footage lies.
    pub footage: Vec<PathBuf>,
}

impl Asked {
    /// That the training in `folder`, begun by `recipe` with `seed`, is the one asked for.
    pub(super) fn check(&self, folder: &Path, recipe: &Recipe, seed: u64) -> Result<(), TrainError> {
        let (folder, made) = (folder.display(), &recipe.policy);
        let differs = |text: String| Err(TrainError::Differs(text));
        if self.name != *made {
            let ships = shipped(&self.name).and_then(|text| Recipe::parse(text).ok());
            let same_policy = ships.as_ref().is_some_and(|ships| ships.policy == *made);
            if !same_policy {
                return differs(format!(
                    "{folder} holds a training of {made}, not of {}; name {made} to continue",
                    self.name
                ));
            }
            if ships.map(|ships| ships.with_updates(recipe.updates())).as_ref() != Some(recipe) {
                return differs(format!(
                    "{folder} holds a training of {made} by another recipe than {}; name {made} to continue",
                    self.name
                ));
            }
        }
        let mut wanted = self.recipe.clone().unwrap_or_else(|| recipe.clone());
        if let Some(updates) = self.updates {
            wanted = wanted.with_updates(updates);
        }
        if let Some((key, was, is)) = recipe.difference(&wanted) {
            return differs(format!(
                "the training in {folder} was begun with {key} = {was}, not {is}; leave out --config and --updates to \
                 continue, or start again in another folder"
            ));
        }
        match self.seed {
            Some(other) if other != seed => differs(format!(
                "the training in {folder} was begun with seed {seed}, not {other}; leave out --seed to continue, or start \
                 again in another folder"
            )),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_is_told_with_what_to_do() {
        let ships = |name: &str| Recipe::parse(shipped(name).unwrap()).unwrap();
        let recipe = ships("mgm-learned").with_updates(2000);
        let asked = |name: &str| Asked { name: name.to_owned(), ..Asked::default() };
        let check = |asked: &Asked| asked.check(Path::new("runs/a"), &recipe, 1);
        let fits = Asked { recipe: Some(recipe.clone()), seed: Some(1), ..asked("mgm-learned") };
        check(&fits).unwrap();
        check(&Asked { updates: Some(2000), ..asked("mgm-learned") }).unwrap();
        Asked { name: "parfocal-refined".to_owned(), ..Asked::default() }
            .check(Path::new("runs/a"), &ships("parfocal-refined").with_updates(7), 1)
            .unwrap();
        for (asked, told) in [
            (asked("parfocal"), "runs/a holds a training of mgm-learned, not of parfocal"),
            (asked("mgm-learned-paper"), "by another recipe than mgm-learned-paper; name mgm-learned"),
            (
                Asked { updates: Some(3000), ..asked("mgm-learned") },
                "begun with dqn.updates = 2000, not 3000; leave out",
            ),
            (Asked { recipe: Some(ships("mgm-learned-paper")), ..asked("mgm-learned") }, "begun with dqn."),
            (Asked { seed: Some(2), ..asked("mgm-learned") }, "begun with seed 1, not 2; leave out --seed"),
        ] {
            let error = check(&asked).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }
}
