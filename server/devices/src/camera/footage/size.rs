//! The sizes that pictures of footage may have.

use std::path::Path;

use super::video::FootageError;

/// Largest width in pixels: the blur can keep up with it in real time.
pub(super) const WIDTH: usize = 1024;
/// Largest height in pixels, for the same reason.
pub(super) const HEIGHT: usize = 384;
/// Least width and height in pixels.
pub(super) const LEAST: usize = 64;

/// Refuses pictures of fewer than [`LEAST`] pixels either way.
pub(super) fn large_enough(path: &Path, width: usize, height: usize) -> Result<(), FootageError> {
    if width >= LEAST && height >= LEAST {
        return Ok(());
    }
    Err(FootageError::TooSmall { path: path.to_owned(), width, height, least: LEAST })
}
