//! Which sharp pictures training, validation and the reference benchmark are made of: never the same ones.

use std::sync::Arc;

use super::scan::{Clip, ClipError};
use super::texture::texture;

/// Side in pixels of drawn pictures: the height of the paper's clips.
const SIDE: usize = 480;

/// What pictures are for. Each split draws from seeds of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// To learn from.
    Training,
    /// To choose the best of the learned.
    Validation,
    /// To report.
    Test,
}

impl Split {
    const fn first_seed(self) -> u64 {
        match self {
            Self::Training => 0,
            Self::Validation => 1 << 32,
            Self::Test => 2 << 32,
        }
    }
}

/// The pictures of the reference benchmark's `split`, `0..count`.
///
/// # Errors
/// None in practice: the pictures are large enough.
pub fn reference(split: Split, count: u64) -> Result<Vec<Arc<Clip>>, ClipError> {
    drawn(split, count)
}

/// Drawn pictures `0..count` of `split`.
///
/// # Errors
/// None in practice: drawn pictures are large enough.
pub fn drawn(split: Split, count: u64) -> Result<Vec<Arc<Clip>>, ClipError> {
    (0..count).map(|index| Clip::still(texture(split.first_seed() + index, SIDE)).map(Arc::new)).collect()
}
