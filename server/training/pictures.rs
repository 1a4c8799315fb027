//! Which sharp pictures training, validation and the reference benchmark are made of: never the same ones.

#![allow(clippy::cast_precision_loss, reason = "a few strengths of contrast")]

use std::sync::Arc;

use super::scan::{Clip, ClipError};
use super::texture::{texture, vary_contrast};
use crate::camera::phantom::Scene;
use crate::imaging::GrayImage;

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
    (0..count).map(|index| Clip::still(sharp_phantom(split, index)).map(Arc::new)).collect()
}

/// The middle of brain phantom `index` of `split`, sharp.
#[must_use]
pub fn sharp_phantom(split: Split, index: u64) -> GrayImage {
    Scene::new(split.first_seed() + index).sharp_gray(SIDE, SIDE)
}

/// Pictures to train on, `count` of them: one in three a phantom's, the others textures of many kinds, half of all with a
/// contrast that varies from place to place.
///
/// # Errors
/// None in practice: the pictures are large enough.
pub fn varied(split: Split, count: u64) -> Result<Vec<Arc<Clip>>, ClipError> {
    (0..count)
        .map(|index| {
            let seed = split.first_seed() + index;
            let mut picture = if index % 3 == 0 { sharp_phantom(split, index) } else { texture(seed, SIDE) };
            if index % 2 == 0 {
                vary_contrast(&mut picture, 0.2 + 0.2 * (index / 2 % 5) as f32, seed);
            }
            Clip::still(picture).map(Arc::new)
        })
        .collect()
}
