//! Checks that the arguments of a resumed training match the original run.

use std::path::Path;

use super::material::Sources;
use crate::LearningError;
use crate::training::recipe::{Recipe, shipped};

/// The arguments of a training that is resumed. Those not given stay as when the training was begun.
#[derive(Debug, Clone, Default)]
pub struct ResumeRequest {
    /// Name of a policy, or of a recipe that ships.
    pub name: String,
    /// The whole recipe, if one was given.
    pub recipe: Option<Recipe>,
    /// Updates of the whole training, if given.
    pub updates: Option<u64>,
    /// The seed, if given.
    pub seed: Option<u64>,
    /// Where footage and recordings are now; empty for where they were.
    pub sources: Sources,
}

impl ResumeRequest {
    /// Checks that the request matches the training in `folder`, which was begun with `recipe` and `seed`.
    pub(super) fn check(&self, folder: &Path, recipe: &Recipe, seed: u64) -> Result<(), LearningError> {
        let folder = folder.display();
        let made = &recipe.policy;

        if self.name != *made {
            let ships = shipped(&self.name).and_then(|text| Recipe::parse(text).ok());
            let same_policy = ships.as_ref().is_some_and(|ships| ships.policy == *made);
            if !same_policy {
                bail!("{folder} holds a training of {made}, not of {}; name {made} to continue", self.name);
            }
            if ships.map(|ships| ships.with_updates(recipe.updates())).as_ref() != Some(recipe) {
                bail!(
                    "{folder} holds a training of {made} by another recipe than {}; name {made} to continue",
                    self.name
                );
            }
        }

        let mut requested = self.recipe.clone().unwrap_or_else(|| recipe.clone());
        if let Some(updates) = self.updates {
            requested = requested.with_updates(updates);
        }

        if let Some((key, was, is)) = recipe.difference(&requested) {
            bail!(
                "the training in {folder} was begun with {key} = {was}, not {is}; leave out --config and --updates to \
                 continue, or start again in another folder"
            );
        }

        if let Some(other) = self.seed.filter(|other| *other != seed) {
            bail!(
                "the training in {folder} was begun with seed {seed}, not {other}; leave out --seed to continue, or \
                 start again in another folder"
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_is_reported_with_advice() {
        let ships = |name: &str| Recipe::parse(shipped(name).unwrap()).unwrap();
        let recipe = ships("mgm-learned").with_updates(2000);
        let request = |name: &str| ResumeRequest { name: name.to_owned(), ..ResumeRequest::default() };
        let check = |request: &ResumeRequest| request.check(Path::new("runs/a"), &recipe, 1);

        let fits = ResumeRequest { recipe: Some(recipe.clone()), seed: Some(1), ..request("mgm-learned") };
        check(&fits).unwrap();
        check(&ResumeRequest { updates: Some(2000), ..request("mgm-learned") }).unwrap();
        ResumeRequest { name: "parfocal-refined".to_owned(), ..ResumeRequest::default() }
            .check(Path::new("runs/a"), &ships("parfocal-refined").with_updates(7), 1)
            .unwrap();

        for (request, told) in [
            (request("parfocal"), "runs/a holds a training of mgm-learned, not of parfocal"),
            (request("mgm-learned-paper"), "by another recipe than mgm-learned-paper; name mgm-learned"),
            (
                ResumeRequest { updates: Some(3000), ..request("mgm-learned") },
                "begun with dqn.updates = 2000, not 3000; leave out",
            ),
            (ResumeRequest { recipe: Some(ships("mgm-learned-paper")), ..request("mgm-learned") }, "begun with dqn."),
            (ResumeRequest { seed: Some(2), ..request("mgm-learned") }, "begun with seed 1, not 2; leave out --seed"),
        ] {
            let error = check(&request).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }
}
