//! Recipes: the settings of a training, as TOML. Those that ship are in `policies/`.

pub mod belief;
mod check;
pub mod dqn;

use serde::{Deserialize, Serialize};

use crate::LearningError;
use crate::scans::benchmark::COUNT;
use belief::BeliefRecipe;
pub use check::MAX_UPDATES;
use dqn::DqnRecipe;
use parfocal_autofocus::shipped::{Design, design};

/// Updates of a leg. A training may stop only between two legs. Each leg begins with new scans, so that a checkpoint
/// need not hold scans.
pub const LEG: u64 = 100;

/// All settings of a training except its seed and its footage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Name of the policy that is trained.
    pub policy: String,
    /// Pictures drawn to train on, unless footage takes the place of all. Validation draws as many others, at most 60.
    pub pictures: u64,
    /// Share of the scans over flat scenes that are over footage, if some is given; the others are over drawn pictures.
    #[serde(default = "all", skip_serializing_if = "is_all")]
    pub footage_share: f64,
    /// Scenes with relief drawn to train on besides. Validation draws as many others, at most 60. 0: none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub reliefs: u64,
    /// Share of the scans that are over scenes with relief.
    #[serde(default, skip_serializing_if = "is_nothing")]
    pub relief_share: f64,
    /// Share of the scans that are over a bench's own recordings, if some are given.
    #[serde(default = "half", skip_serializing_if = "is_half")]
    pub bench_share: f64,
    /// Updates between two validations, a multiple of [`LEG`]. A checkpoint is written with each.
    pub validate_every: u64,
    /// Scans of the reference benchmark on which the best weights are evaluated at the end, for their model card. 0:
    /// none.
    #[serde(default = "whole_benchmark")]
    pub benchmark: usize,
    /// How to train one of the paper's networks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dqn: Option<DqnRecipe>,
    /// How to train the belief tracker.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub belief: Option<BeliefRecipe>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over references")]
const fn is_zero(count: &u64) -> bool {
    *count == 0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over references")]
fn is_nothing(share: &f64) -> bool {
    *share <= 0.0
}

const fn all() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over references")]
fn is_all(share: &f64) -> bool {
    *share >= 1.0
}

const fn half() -> f64 {
    0.5
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over references")]
fn is_half(share: &f64) -> bool {
    (share - half()).abs() < f64::EPSILON
}

const fn whole_benchmark() -> usize {
    COUNT
}

/// The recipes that ship. Ours have the policy's name; those that train its weights further end in `-refined`,
/// `-relief`, `-glass` or `-adapted`. The paper's end in `-paper`.
const SHIPPED: [(&str, &str); 13] = [
    ("mgm-learned", include_str!("../../../../../policies/mgm-learned.toml")),
    ("mlr-learned", include_str!("../../../../../policies/mlr-learned.toml")),
    ("cnn-learned", include_str!("../../../../../policies/cnn-learned.toml")),
    ("cnn-learned-refined", include_str!("../../../../../policies/cnn-learned-refined.toml")),
    ("cnn-learned-glass", include_str!("../../../../../policies/cnn-learned-glass.toml")),
    ("mgm-learned-paper", include_str!("../../../../../policies/mgm-learned-paper.toml")),
    ("mlr-learned-paper", include_str!("../../../../../policies/mlr-learned-paper.toml")),
    ("cnn-learned-paper", include_str!("../../../../../policies/cnn-learned-paper.toml")),
    ("parfocal", include_str!("../../../../../policies/parfocal.toml")),
    ("parfocal-refined", include_str!("../../../../../policies/parfocal-refined.toml")),
    ("parfocal-relief", include_str!("../../../../../policies/parfocal-relief.toml")),
    ("parfocal-glass", include_str!("../../../../../policies/parfocal-glass.toml")),
    ("parfocal-adapted", include_str!("../../../../../policies/parfocal-adapted.toml")),
];

/// Endings of the names of recipes that train weights further.
const LATER_STAGES: [&str; 4] = ["-refined", "-relief", "-glass", "-adapted"];

/// The text of the recipe that ships under `name`.
pub fn shipped(name: &str) -> Option<&'static str> {
    SHIPPED.iter().find(|recipe| recipe.0 == name).map(|recipe| recipe.1)
}

/// Whether the recipe that ships under `name` trains the weights of an earlier stage further.
pub fn is_later_stage(name: &str) -> bool {
    LATER_STAGES.iter().any(|ending| name.ends_with(ending))
}

/// Names of the recipes that ship.
pub fn names() -> Vec<&'static str> {
    SHIPPED.iter().map(|recipe| recipe.0).collect()
}

impl Recipe {
    /// The first key (as `section.key`) whose value differs in `other`, with this recipe's value and the other's.
    pub fn difference(&self, other: &Self) -> Option<(String, String, String)> {
        let table = |recipe: &Self| toml::Table::try_from(recipe).unwrap_or_default();
        difference("", &table(self), &table(other))
    }

    /// The design of the recipe's policy.
    ///
    /// # Errors
    /// If it is not a learned policy, or the recipe has the section of another kind of policy.
    pub fn design(&self) -> Result<Design, LearningError> {
        let unknown = || {
            LearningError::new(format!(
                "'{}' is not a learned policy; those are mgm-learned, mlr-learned, cnn-learned and parfocal",
                self.policy
            ))
        };

        let design = design(&self.policy).ok_or_else(unknown)?;

        let fits = match design {
            Design::Values(_) => self.dqn.is_some(),
            Design::Belief => self.belief.is_some(),
        };

        if fits { Ok(design) } else { Err(self.has_the_wrong_section()) }
    }

    /// The error that the recipe lacks the section that its policy is trained by.
    pub(super) fn has_the_wrong_section(&self) -> LearningError {
        let policy = &self.policy;
        LearningError::new(format!(
            "the recipe has the wrong section for '{policy}': [dqn] trains networks of values, [belief] the tracker"
        ))
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
    pub fn updates(&self) -> u64 {
        self.dqn.as_ref().map_or(0, |dqn| dqn.updates).max(self.belief.as_ref().map_or(0, |belief| belief.updates))
    }
}

fn difference(section: &str, one: &toml::Table, other: &toml::Table) -> Option<(String, String, String)> {
    let nothing = || "not given".to_owned();

    one.keys().chain(other.keys()).find_map(|key| {
        let name = format!("{section}{key}");
        match (one.get(key), other.get(key)) {
            (Some(toml::Value::Table(one)), Some(toml::Value::Table(other))) => {
                difference(&format!("{name}."), one, other)
            }
            (one, other) if one == other => None,
            (one, other) => {
                let [one, other] = [one, other].map(|value| value.map_or_else(nothing, ToString::to_string));
                Some((name, one, other))
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_recipe_is_sound_and_makes_its_policy() {
        for name in names() {
            let recipe = Recipe::parse(shipped(name).unwrap()).unwrap_or_else(|error| panic!("{name}: {error}"));
            let suffixes = LATER_STAGES.iter().chain(&["-paper"]);
            let policy = suffixes.fold(name, |name, suffix| name.trim_end_matches(suffix));
            assert_eq!(recipe.policy, policy);
        }
    }

    #[test]
    fn an_unknown_key_is_reported_with_its_line() {
        let text = shipped("parfocal").unwrap().replace("clip = 1.0", "clipp = 1.0");
        let error = Recipe::parse(&text).unwrap_err();
        assert!(error.starts_with("line ") && error.contains("clipp") && !error.contains('\n'), "{error}");
        let error = Recipe::parse("policy = \"a\"\npictures 3\n").unwrap_err();
        assert!(error.starts_with("line 2: ") && !error.contains('\n'), "{error}");
    }

    #[test]
    fn two_recipes_differ_in_a_key() {
        let one = Recipe::parse(shipped("mgm-learned").unwrap()).unwrap();
        assert_eq!(one.difference(&one), None);

        let other = one.clone().with_updates(7);
        let (key, one, other) = one.difference(&other).unwrap();
        assert_eq!([key, one, other], ["dqn.updates", "24000", "7"]);
    }
}
