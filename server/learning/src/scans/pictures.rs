//! The sharp pictures of training, validation and the reference benchmark. No picture is in two of them.

use std::sync::Arc;

use super::clip::Clip;
use crate::LearningError;
use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_devices::simulation::phantom::Scene;
use parfocal_devices::simulation::texture::{texture, vary_contrast};
use parfocal_imaging::GrayImage;

/// Side in pixels of drawn pictures: the height of the paper's clips.
const SIDE: usize = 480;

/// What pictures are for. Each split has its own seeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Split {
    /// To learn from.
    Training,
    /// To choose by.
    Validation,
    /// To report results: the scenes of the reference benchmark.
    Test,
}

impl Split {
    pub(super) const fn first_seed(self) -> u64 {
        match self {
            Self::Training => 0,
            Self::Validation => 1 << 32,
            Self::Test => 2 << 32,
        }
    }
}

/// How much the contrast of the reference benchmark's pictures varies from place to place; chosen together with
/// [`super::simulated::ScanSettings::reference`].
const UNEVEN: f32 = 1.0;

/// Pictures `0..count` of the reference benchmark's `split`: brain phantoms of uneven contrast.
///
/// # Errors
/// None in practice: the pictures are large enough.
pub fn reference(split: Split, count: u64) -> Result<Vec<Arc<Clip>>, LearningError> {
    (0..count)
        .map(|index| {
            let mut picture = sharp_phantom(split, index);
            vary_contrast(&mut picture, UNEVEN, split.first_seed() + index);
            Clip::still(picture).map(Arc::new)
        })
        .collect()
}

/// The middle of brain phantom `index` of `split`, sharp.
pub fn sharp_phantom(split: Split, index: u64) -> GrayImage {
    sharp_phantom_of(split, index, SIDE)
}

/// The middle `side` x `side` pixels of brain phantom `index` of `split`, sharp.
pub fn sharp_phantom_of(split: Split, index: u64, side: usize) -> GrayImage {
    Scene::new(split.first_seed() + index).sharp_gray(side, side)
}

/// Pictures to train on, `count` of them: one in three a phantom's, the others textures of many kinds. In half of them
/// contrast varies from place to place. Half of them are soft, as footage is after optics, demosaicing and compression.
///
/// # Errors
/// None in practice: the pictures are large enough.
pub fn varied(split: Split, count: u64) -> Result<Vec<Arc<Clip>>, LearningError> {
    (0..count)
        .map(|index| {
            let seed = split.first_seed() + index;
            let mut picture = if index % 3 == 0 { sharp_phantom(split, index) } else { texture(seed, SIDE) };

            if index % 2 == 0 {
                vary_contrast(&mut picture, 0.2 + 0.2 * (index / 2 % 6) as f32, seed);
            }

            if index % 4 < 2 {
                picture = gaussian_blur(&picture, 0.3 + 0.1 * (index / 4 % 10) as f64);
            }

            Clip::still(picture).map(Arc::new)
        })
        .collect()
}
