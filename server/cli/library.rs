//! The protocols that a command works with.

use std::path::Path;

use super::output::Failure;
use parfocal_autofocus::Registry;
use parfocal_session::conductor::Library;

/// The shipped protocols and those of `folder`; without `folder`, those of `trial-protocols` if it exists.
pub fn protocols(folder: Option<&Path>, registry: &Registry) -> Result<Library, Failure> {
    let beside = Path::new("trial-protocols");

    let folder = folder.or_else(|| beside.is_dir().then_some(beside));
    let known: Vec<_> = registry.entries().into_iter().map(|entry| entry.name).collect();
    Ok(Library::load(folder, &known)?)
}
