//! An answer of the environments, as bytes.

use parfocal_imaging::{PATCH_SIDE, WIDER};

/// Bytes of a patch: a gray level for each of its pixels.
pub const PATCH_BYTES: usize = PATCH_SIDE * PATCH_SIDE;

/// What an environment shows of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// The patch.
    Patch,
    /// The patch, and those at coarser scales around it.
    View,
}

impl Shows {
    /// Patches of a frame.
    #[must_use]
    pub const fn patches(self) -> usize {
        match self {
            Self::Patch => 1,
            Self::View => 1 + WIDER.len(),
        }
    }

    /// Bytes of a frame.
    #[must_use]
    pub const fn bytes(self) -> usize {
        self.patches() * PATCH_BYTES
    }
}

/// The bytes of an answer.
#[derive(Debug, Default)]
pub struct Answer(Vec<u8>);

/// The parts of an answer, each with a value for each environment.
pub struct Parts<'a> {
    /// Patches.
    pub pictures: &'a mut [u8],
    /// Focal powers, f32.
    pub focal_powers: &'a mut [u8],
    /// Optimal focal powers, f32.
    pub optima: &'a mut [u8],
    /// Whether the scan has ended.
    pub ended: &'a mut [u8],
}

impl Answer {
    /// The parts of an answer of `count` environments.
    pub fn parts(&mut self, count: usize, shows: Shows) -> Parts<'_> {
        self.0.resize(count * (shows.patches() * PATCH_BYTES + 4 + 4 + 1), 0);
        let (pictures, rest) = self.0.split_at_mut(count * shows.bytes());
        let (focal_powers, rest) = rest.split_at_mut(4 * count);
        let (optima, ended) = rest.split_at_mut(4 * count);
        Parts { pictures, focal_powers, optima, ended }
    }

    /// All of it.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}
