//! Files and folders that a command line names, often by a shell's `*`.

use std::path::Path;

use parfocal_base::files::is_systems_own;
use parfocal_base::notices::tell;

/// The `paths` without files that an operating system keeps beside people's own, such as `Thumbs.db`; standard error
/// names each that is passed over. If there are no others, all of them: somebody means them.
pub fn without_systems_own<P: AsRef<Path>>(paths: &[P]) -> Vec<&P> {
    let is_own = |path: &&P| {
        let path = path.as_ref();
        path.is_file() && path.file_name().is_some_and(is_systems_own)
    };
    let (own, others): (Vec<&P>, Vec<&P>) = paths.iter().partition(is_own);
    if others.is_empty() {
        return own;
    }

    for path in own {
        tell(format_args!("passed over: {}, a file of the operating system", path.as_ref().display()));
    }
    others
}
