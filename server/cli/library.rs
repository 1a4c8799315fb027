//! The policies and protocols that a command works with.

use std::path::Path;

use super::output::Failure;
use parfocal_autofocus::{Registry, shipped};
use parfocal_base::BlurRate;
use parfocal_session::conductor::Library;

/// The policies that ship, which know how fast the optic blurs if `blur` is given; with the weights in the folder
/// `weights` instead of those that ship.
pub fn policies(weights: Option<&Path>, blur: Option<BlurRate>) -> Result<Registry, Failure> {
    let registry = Registry::standard().knowing(blur);
    Ok(match weights {
        Some(folder) => shipped::with_folder(registry, folder)?,
        None => registry,
    })
}

/// The shipped protocols and those of `folder`; without `folder`, those of `trial-protocols` if it exists.
pub fn protocols(folder: Option<&Path>, registry: &Registry) -> Result<Library, Failure> {
    let beside = Path::new("trial-protocols");

    let folder = folder.or_else(|| beside.is_dir().then_some(beside));
    let known: Vec<_> = registry.entries().into_iter().map(|entry| entry.name).collect();
    Ok(Library::load(folder, &known)?)
}
