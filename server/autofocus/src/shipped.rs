//! The policies that ship with the program, and the use of weights that people trained themselves.

use std::fmt::Display;
use std::io::ErrorKind;
use std::path::Path;

use super::belief::BeliefTracker;
use super::learned::{Input, Learned};
use super::weights::WeightsError;
use super::{Bisection, Fixed, HillClimber, Policy, Registry, mgm, mlr};

/// The kind of network that a learned policy's weights are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Design {
    /// The paper's value networks.
    Values(Input),
    /// The belief tracker.
    Belief,
}

/// A learned policy: its name, what it does, its network, and the weights that ship.
struct Shipped {
    name: &'static str,
    summary: &'static str,
    design: Design,
    weights: &'static [u8],
}

const SHIPPED: [Shipped; 4] = [
    Shipped {
        name: "mgm-learned",
        summary: "learned optimiser of the mean gradient magnitude",
        design: Design::Values(Input::Mgm),
        weights: include_bytes!("../../../policies/mgm-learned.safetensors"),
    },
    Shipped {
        name: "mlr-learned",
        summary: "learned optimiser of the mean local ratio",
        design: Design::Values(Input::Mlr),
        weights: include_bytes!("../../../policies/mlr-learned.safetensors"),
    },
    Shipped {
        name: "cnn-learned",
        summary: "learned end to end from the last eight patches",
        design: Design::Values(Input::Patch),
        weights: include_bytes!("../../../policies/cnn-learned.safetensors"),
    },
    Shipped {
        name: "parfocal",
        summary: "tracks a belief about the optimum and goes where it is most likely in focus",
        design: Design::Belief,
        weights: include_bytes!("../../../policies/parfocal.safetensors"),
    },
];

impl Registry {
    /// All policies that ship, in the order of docs/scripting.md.
    pub fn standard() -> Self {
        let classical = Self::default()
            .with("fixed", "the lens stays where it is", || Box::new(Fixed::default()))
            .with("mgm-hill-climber", "climbs the mean gradient magnitude, a step a frame", || {
                Box::new(HillClimber::new(mgm))
            })
            .with("mlr-hill-climber", "climbs the mean local ratio, a step a frame", || Box::new(HillClimber::new(mlr)))
            .with("mgm-bisection", "halves where the optimum may be, by which of two frames is sharper", || {
                Box::new(Bisection::default())
            });

        with_shipped(classical)
    }
}

/// The design of the learned policy `name`; `None` if no learned policy has that name.
pub fn design(name: &str) -> Option<Design> {
    SHIPPED.iter().find(|shipped| shipped.name == name).map(|shipped| shipped.design)
}

/// Adds all learned policies to `registry`. One with damaged weights is listed but unavailable.
pub fn with_shipped(registry: Registry) -> Registry {
    SHIPPED.iter().fold(registry, |registry, shipped| {
        let &Shipped { name, summary, design, weights } = shipped;
        match build(design, weights) {
            Ok(_) => registry.made_of_weights(name, summary, weights.into(), move |bytes| build(design, bytes)),
            Err(error) => registry.without(name, summary, &format!("{error}; replace them with undamaged weights")),
        }
    })
}

/// Why weights in a folder cannot be used, with the folder or the file.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct FolderError(String);

/// Replaces the weights that ship by those in `folder`, called `NAME.safetensors`. A policy without a file there keeps
/// its weights.
///
/// # Errors
/// If there are no weights at all, or some are damaged or cannot be read.
pub fn with_folder(registry: Registry, folder: &Path) -> Result<Registry, FolderError> {
    let file_of = |name: &str| folder.join(format!("{name}.safetensors"));
    let unfit =
        |file: &Path, reason: &dyn Display| FolderError(format!("cannot use the weights {}: {reason}", file.display()));

    let mut there = Vec::new();
    for shipped in &SHIPPED {
        let file = file_of(shipped.name);
        match std::fs::read(&file) {
            Ok(bytes) => there.push((shipped, file, bytes)),
            Err(error) if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&error.kind()) => {}
            Err(error) => return Err(unfit(&file, &error)),
        }
    }
    if there.is_empty() {
        let names: Vec<_> = SHIPPED.iter().map(|shipped| format!("{}.safetensors", shipped.name)).collect();
        let names = names.join(", ");
        return Err(FolderError(format!("there are no weights in {}: none of {names}", folder.display())));
    }

    there.into_iter().try_fold(registry, |registry, (&Shipped { name, summary, design, .. }, file, bytes)| {
        build(design, &bytes).map_err(|error| unfit(&file, &error))?;
        Ok(registry.made_of_weights(name, summary, bytes.into(), move |bytes| build(design, bytes)))
    })
}

/// A policy of `design` with the weights in `bytes` (safetensors).
///
/// # Errors
/// If the weights are damaged or belong to another network.
pub fn build(design: Design, bytes: &[u8]) -> Result<Box<dyn Policy>, WeightsError> {
    Ok(match design {
        Design::Values(input) => Box::new(Learned::new(input, bytes)?),
        Design::Belief => Box::new(BeliefTracker::new(bytes)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_base::PolicyName;

    #[test]
    fn what_ships_is_sound() {
        let registry = with_shipped(Registry::default());
        for shipped in SHIPPED {
            assert!(registry.build(&PolicyName::new(shipped.name)).is_ok(), "{}", shipped.name);
        }
        // What the last trainings begin with.
        for (name, design) in [("cnn-learned", Design::Values(Input::Patch)), ("parfocal", Design::Belief)] {
            let drawn = std::fs::read(format!("../../policies/{name}-drawn.safetensors")).unwrap();
            assert!(build(design, &drawn).is_ok(), "{name}");
        }
    }

    #[test]
    fn damaged_and_missing_weights_in_a_folder_are_reported_and_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let with = || with_folder(with_shipped(Registry::default()), folder.path());
        assert!(with().err().unwrap().to_string().contains("mgm-learned.safetensors"));

        let file = folder.path().join("mgm-learned.safetensors");
        std::fs::write(&file, b"damaged").unwrap();
        let error = with().err().unwrap().to_string();
        assert!(error.contains("mgm-learned.safetensors") && error.contains("the weights are damaged"), "{error}");

        std::fs::copy("../../policies/mgm-learned.safetensors", &file).unwrap();
        assert!(with().unwrap().build(&PolicyName::new("parfocal")).is_ok());
    }
}
