//! The registry: all policies by name. Every part of the program uses the same names.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::Arc;

use serde::Serialize;
use sha2::{Digest, Sha256};

use parfocal_base::{BlurRate, PolicyName};

use super::Policy;

/// One line of the registry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PolicyEntry {
    /// The policy's name, by which [`Registry::build`] finds it.
    pub name: PolicyName,
    /// What it does, in one sentence.
    pub summary: &'static str,
    /// SHA-256 of its weights, in hexadecimal, if it was learned; of its program's files, if it runs in another process.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
    /// Whether the policy can run now. A learned policy cannot run without its weights.
    pub available: bool,
    /// Why the policy cannot run and what to do; `None` if it is available.
    pub reason: Option<String>,
}

/// Why a policy could not be built.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// The registry has no policy of that name.
    #[error("there is no policy '{name}'; there are: {known}")]
    Unknown {
        /// The name asked for.
        name: PolicyName,
        /// All known names, separated by commas.
        known: String,
    },
    /// The policy is listed but unavailable: its weights or its file are missing or damaged.
    #[error("policy '{name}' cannot run: {reason}")]
    Unavailable {
        /// The policy.
        name: PolicyName,
        /// Why, and what to do.
        reason: String,
    },
    /// The policy runs in another process, which is being started.
    #[error("policy '{name}' is starting{}", again(failed.as_deref()))]
    Starting {
        /// The policy.
        name: PolicyName,
        /// Why its last process failed; `None` if it did not.
        failed: Option<String>,
    },
}

fn again(failed: Option<&str>) -> String {
    failed.map_or_else(String::new, |why| format!(" again, because it failed: {why}"))
}

/// All policies. Cheap to clone: the clones share the learned weights.
#[derive(Clone, Default)]
pub struct Registry {
    policies: Vec<Registered>,
    blur: Option<BlurRate>,
}

/// A policy, and what builds it if it is available.
#[derive(Clone)]
struct Registered {
    entry: PolicyEntry,
    build: Option<Build>,
    /// Tells whether it can run now, where building an instance would disturb one that runs.
    check: Option<Check>,
}

type Build = Arc<dyn Fn() -> Result<Box<dyn Policy>, PolicyError> + Send + Sync>;
type Check = Arc<dyn Fn() -> Result<(), PolicyError> + Send + Sync>;

impl Registry {
    /// Adds policy `name`, made by `build`. Replaces a policy of that name, or appends it at the end.
    #[must_use]
    pub fn with(
        self,
        name: &str,
        summary: &'static str,
        build: impl Fn() -> Box<dyn Policy> + Send + Sync + 'static,
    ) -> Self {
        self.trying(name, summary, move || Ok(build()))
    }

    /// Adds policy `name`, which `build` makes of the `weights`, which were checked before. While that fails nevertheless,
    /// for example for want of memory, the policy is unavailable.
    #[must_use]
    pub fn made_of_weights<E: Display>(
        self,
        name: &str,
        summary: &'static str,
        weights: Arc<[u8]>,
        build: impl Fn(&[u8]) -> Result<Box<dyn Policy>, E> + Send + Sync + 'static,
    ) -> Self {
        let hash = hex::encode(Sha256::digest(&weights));
        let of = PolicyName::new(name);
        let made = move || {
            build(&weights).map_err(|error| PolicyError::Unavailable { name: of.clone(), reason: error.to_string() })
        };
        self.trying(name, summary, made).identified(name, Some(hash))
    }

    /// Adds policy `name`, made by `build`, which may fail now and succeed later.
    #[must_use]
    pub fn trying(
        self,
        name: &str,
        summary: &'static str,
        build: impl Fn() -> Result<Box<dyn Policy>, PolicyError> + Send + Sync + 'static,
    ) -> Self {
        self.put(name, summary, Ok(Arc::new(build)))
    }

    /// Lists policy `name` as unavailable. `reason` says why and what to do.
    #[must_use]
    pub fn without(self, name: &str, summary: &'static str, reason: &str) -> Self {
        self.put(name, summary, Err(reason.to_owned()))
    }

    /// Adds policy `name`, with what builds it or why it cannot run.
    fn put(mut self, name: &str, summary: &'static str, source: Result<Build, String>) -> Self {
        let name = PolicyName::new(name);
        let (build, reason) = match source {
            Ok(build) => (Some(build), None),
            Err(reason) => (None, Some(reason)),
        };
        let entry = PolicyEntry { name, summary, weights: None, available: build.is_some(), reason };
        let new = Registered { entry, build, check: None };

        match self.policies.iter_mut().find(|old| old.entry.name == new.entry.name) {
            Some(old) => *old = new,
            None => self.policies.push(new),
        }
        self
    }

    /// Records `hash`, a SHA-256 in hexadecimal, as what identifies policy `name`.
    #[must_use]
    pub fn identified(mut self, name: &str, hash: Option<String>) -> Self {
        if let Some(policy) = self.policies.iter_mut().find(|policy| policy.entry.name.as_str() == name) {
            policy.entry.weights = hash;
        }
        self
    }

    /// Lets `check` tell whether policy `name` can run now. By default an instance is built and dropped.
    #[must_use]
    pub fn checked_by(
        mut self,
        name: &str,
        check: impl Fn() -> Result<(), PolicyError> + Send + Sync + 'static,
    ) -> Self {
        if let Some(policy) = self.policies.iter_mut().find(|policy| policy.entry.name.as_str() == name) {
            policy.check = Some(Arc::new(check));
        }
        self
    }

    /// Whether there is a policy `name`, whether it can run or not.
    pub fn has(&self, name: &PolicyName) -> bool {
        self.policies.iter().any(|policy| policy.entry.name == *name)
    }

    /// Gives the blur rate of the optics, if known, to every policy that is built.
    #[must_use]
    pub const fn knowing(mut self, blur: Option<BlurRate>) -> Self {
        self.blur = blur;
        self
    }

    /// The SHA-256 of each learned policy's weights, and of the files of each that runs in another process.
    pub fn weights(&self) -> BTreeMap<PolicyName, String> {
        let entries = self.policies.iter().map(|policy| &policy.entry);
        entries.filter_map(|entry| Some((entry.name.clone(), entry.weights.clone()?))).collect()
    }

    /// Every policy, in the order in which they were added.
    pub fn entries(&self) -> Vec<PolicyEntry> {
        self.policies.iter().map(|policy| policy.entry.clone()).collect()
    }

    /// Checks that policy `name` can run now.
    ///
    /// # Errors
    /// If there is no such policy or it cannot run.
    pub fn check(&self, name: &PolicyName) -> Result<(), PolicyError> {
        match &self.find(name)?.check {
            Some(check) => check(),
            None => self.build(name).map(drop),
        }
    }

    /// Builds a new instance of policy `name`, with an empty memory.
    ///
    /// # Errors
    /// If there is no such policy or it cannot run.
    pub fn build(&self, name: &PolicyName) -> Result<Box<dyn Policy>, PolicyError> {
        let Registered { entry, build, .. } = self.find(name)?;
        let Some(build) = build else {
            let reason = entry.reason.clone().unwrap_or_default();
            return Err(PolicyError::Unavailable { name: name.clone(), reason });
        };

        let mut policy = build()?;
        if let Some(blur) = self.blur {
            policy.learn_of(blur);
        }
        Ok(policy)
    }

    fn find(&self, name: &PolicyName) -> Result<&Registered, PolicyError> {
        self.policies.iter().find(|policy| policy.entry.name == *name).ok_or_else(|| {
            let known: Vec<_> = self.policies.iter().map(|policy| policy.entry.name.as_str()).collect();
            PolicyError::Unknown { name: name.clone(), known: known.join(", ") }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Fixed;
    use crate::Observation;
    use parfocal_base::FocalPower;
    use parfocal_imaging::{PATCH_SIDE, Patch};

    fn names(registry: &Registry) -> Vec<String> {
        registry.entries().iter().map(|entry| entry.name.to_string()).collect()
    }

    #[test]
    fn the_standard_registry_has_the_promised_names_in_the_promised_order() {
        let classical = ["fixed", "mgm-hill-climber", "mlr-hill-climber", "mgm-bisection"];
        let learned = ["mgm-learned", "mlr-learned", "cnn-learned", "parfocal"];
        let promised = [classical, learned].concat();
        assert_eq!(names(&Registry::standard())[..promised.len()], promised);
    }

    #[test]
    fn an_entry_is_available_exactly_when_it_can_be_built() {
        let registry = Registry::standard();
        for entry in registry.entries() {
            assert_eq!(registry.build(&entry.name).is_ok(), entry.available, "{}", entry.name);
            assert_eq!(entry.reason.is_none(), entry.available, "{}", entry.name);
        }
    }

    #[test]
    fn instances_share_no_memory() {
        let registry = Registry::standard();
        let fixed = PolicyName::new("fixed");
        let patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        for start in [0.2, 0.7] {
            let focal_power = FocalPower::new(start).unwrap();
            let decision = registry.build(&fixed).unwrap().step(&Observation { view: &patch.into(), focal_power });
            assert!((decision.target - start).abs() < f64::EPSILON);
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        let registry = Registry::default().with("a", "", || Box::new(Fixed::default())).without(
            "b",
            "",
            "it is not here: fetch it",
        );

        let error = |name| registry.build(&PolicyName::new(name)).err().map(|error| error.to_string());
        assert_eq!(error("c").as_deref(), Some("there is no policy 'c'; there are: a, b"));
        assert_eq!(error("b").as_deref(), Some("policy 'b' cannot run: it is not here: fetch it"));
    }

    #[test]
    fn a_policy_registered_again_keeps_its_place() {
        let registry = Registry::standard().with("mgm-learned", "trained", || Box::new(Fixed::default()));
        assert_eq!(names(&registry), names(&Registry::standard()));
        assert!(registry.build(&PolicyName::new("mgm-learned")).is_ok());
    }
}
