//! The learned policies that ship with the program, and those that people train themselves.

use std::path::Path;
use std::sync::Arc;

use super::belief::BeliefTracker;
use super::learned::{Learned, Sight};
use super::weights::WeightsError;
use super::{Fixed, Policy, Registry};

/// What a learned policy's weights are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Design {
    /// The paper's action values.
    Values(Sight),
    /// The belief tracker.
    Belief,
}

/// A learned policy: its name, what it does, its network, and the weights that ship, if any.
struct Shipped {
    name: &'static str,
    summary: &'static str,
    design: Design,
    weights: Option<&'static [u8]>,
}

const SHIPPED: [Shipped; 4] = [
    Shipped {
        name: "mgm-learned",
        summary: "learned optimiser of the mean gradient magnitude",
        design: Design::Values(Sight::Mgm),
        weights: Some(include_bytes!("../../policies/mgm-learned.safetensors")),
    },
    Shipped {
        name: "mlr-learned",
        summary: "learned optimiser of the mean local ratio",
        design: Design::Values(Sight::Mlr),
        weights: Some(include_bytes!("../../policies/mlr-learned.safetensors")),
    },
    Shipped {
        name: "cnn-learned",
        summary: "learned end to end from the last eight patches",
        design: Design::Values(Sight::Patch),
        weights: Some(include_bytes!("../../policies/cnn-learned.safetensors")),
    },
    Shipped {
        name: "parfocal",
        summary: "tracks a belief about the optimum and goes to its median",
        design: Design::Belief,
        weights: Some(include_bytes!("../../policies/parfocal.safetensors")),
    },
];

/// The design behind a learned policy's name.
#[must_use]
pub fn design(name: &str) -> Option<Design> {
    SHIPPED.iter().find(|shipped| shipped.name == name).map(|shipped| shipped.design)
}

/// `registry` with all learned policies, those available whose weights ship and are sound.
#[must_use]
pub fn with_shipped(registry: Registry) -> Registry {
    SHIPPED.iter().fold(registry, |registry, shipped| {
        let Shipped { name, summary, design, weights } = shipped;
        match weights {
            None => registry.without(name, summary, "its weights are missing: make them with `parfocal train`"),
            Some(bytes) => put(registry, name, summary, *design, Arc::from(*bytes)),
        }
    })
}

/// `registry` with the learned policies whose weights lie in `folder` as `NAME.safetensors` in the place of those that
/// ship; damaged ones are listed with the reason and not available.
#[must_use]
pub fn with_folder(registry: Registry, folder: &Path) -> Registry {
    SHIPPED.iter().fold(registry, |registry, Shipped { name, summary, design, .. }| {
        let file = folder.join(format!("{name}.safetensors"));
        match std::fs::read(&file) {
            Ok(bytes) => put(registry, name, summary, *design, bytes.into()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => registry,
            Err(error) => registry.without(name, summary, &format!("cannot read {}: {error}", file.display())),
        }
    })
}

fn put(registry: Registry, name: &str, summary: &'static str, design: Design, bytes: Arc<[u8]>) -> Registry {
    match build(design, &bytes) {
        Err(error) => registry.without(name, summary, &format!("{error}; put sound weights in their place")),
        // The same bytes were sound a moment ago; should libtorch fail all the same, the lens stays where it is.
        Ok(_) => {
            registry.with(name, summary, move || build(design, &bytes).unwrap_or_else(|_| Box::new(Fixed::default())))
        }
    }
}

/// A policy of `design` with the weights in `bytes` (safetensors).
///
/// # Errors
/// When the weights are damaged or another network's.
pub fn build(design: Design, bytes: &[u8]) -> Result<Box<dyn Policy>, WeightsError> {
    Ok(match design {
        Design::Values(sight) => Box::new(Learned::new(sight, bytes)?),
        Design::Belief => Box::new(BeliefTracker::new(bytes)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::autofocus::PolicyName;

    #[test]
    fn what_ships_is_sound() {
        let registry = with_shipped(Registry::default());
        for shipped in SHIPPED.iter().filter(|shipped| shipped.weights.is_some()) {
            assert!(registry.build(&PolicyName::new(shipped.name)).is_ok(), "{}", shipped.name);
        }
    }

    #[test]
    fn damaged_weights_in_a_folder_are_told_and_missing_ones_leave_what_ships() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("mgm-learned.safetensors"), b"damaged").unwrap();
        let registry = with_folder(with_shipped(Registry::default()), folder.path());
        let error = registry.build(&PolicyName::new("mgm-learned")).err().unwrap().to_string();
        assert!(error.contains("the weights are damaged"), "{error}");
        assert!(registry.build(&PolicyName::new("parfocal")).is_ok());
    }
}
