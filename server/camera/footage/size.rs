//! How large the pictures of footage may be.

use std::path::Path;

use super::video::FootageError;

/// Most pixels across and down: what the blur can follow in real time.
pub(super) const WIDTH: usize = 1024;
/// See [`WIDTH`].
pub(super) const HEIGHT: usize = 384;
/// Least pixels across and down.
pub(super) const LEAST: usize = 64;

/// Refuses pictures of fewer than [`LEAST`] pixels either way.
pub(super) fn large_enough(path: &Path, width: usize, height: usize) -> Result<(), FootageError> {
    if width >= LEAST && height >= LEAST {
        return Ok(());
    }
    Err(FootageError::TooSmall { path: path.to_owned(), width, height, least: LEAST })
}
