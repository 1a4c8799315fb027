//! The policies' view of a frame: the patch in the middle of the view, and the same place at coarser
//! scales.

use std::sync::Arc;

use super::geometry::{PATCH_SIDE, Patch};
use super::reduce::fill_block_means;

/// The scale of a wider patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Each value is the mean of 2x2 pixels.
    Two,
    /// Each value is the mean of 4x4 pixels.
    Four,
}

/// Scales of the wider patches, finest first.
pub const WIDER: [Scale; 2] = [Scale::Two, Scale::Four];

impl Scale {
    /// Pixels along each axis whose mean is one value.
    pub const fn pixels(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Four => 4,
        }
    }
}

/// The patch of a frame, and wider ones around it.
///
/// A wider patch has 32x32 values too, each the mean of a block of pixels, so it covers a larger part of the view at a
/// coarser scale. Its centre is that of the patch, or as near to it as the picture allows. Gray levels are not rounded.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The patch at the picture's own scale: all that the paper's policies see.
    pub patch: Patch,
    /// The patches at the scales [`WIDER`]; `None` if the picture is smaller than the area that such a patch covers.
    pub wider: [Option<Patch>; WIDER.len()],
    /// The pixels that the widest patch covers; `None` if there is no such patch, or nobody made them.
    pub surroundings: Option<Surroundings>,
}

/// The pixels around a patch at the picture's own scale. Cheap to clone.
#[derive(Debug, Clone, PartialEq)]
pub struct Surroundings {
    /// Gray levels, row after row, [`Surroundings::SIDE`] in each row and as many rows.
    pub levels: Arc<[f32]>,
    /// Column and row of the patch's upper left pixel.
    pub patch: (usize, usize),
}

impl Surroundings {
    /// Pixels along each side.
    pub const SIDE: usize = PATCH_SIDE * WIDER[WIDER.len() - 1].pixels();
}

/// A square of a picture's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Square {
    /// Left column.
    pub x: usize,
    /// Top row.
    pub y: usize,
    /// Columns and rows.
    pub side: usize,
}

impl Square {
    /// The square that the patch at `scale` covers. Its centre is that of the 32x32 patch at `corner`, moved as little
    /// as needed to lie inside a picture of `width` x `height` pixels. `None` if the picture is smaller than the
    /// square.
    pub fn around(corner: (usize, usize), scale: Scale, (width, height): (usize, usize)) -> Option<Self> {
        let side = PATCH_SIDE * scale.pixels();
        let margin = (side - PATCH_SIDE) / 2;

        let first = |corner: usize, length: usize| {
            let last = length.checked_sub(side)?;
            Some(corner.saturating_sub(margin).min(last))
        };

        Some(Self { x: first(corner.0, width)?, y: first(corner.1, height)?, side })
    }
}

impl View {
    /// The view around `patch`, whose upper left corner is `corner` in a picture of `size` (width and height). `gray`
    /// makes the gray levels of a square of the picture, row after row; it is called once, with the largest square that
    /// is needed, or not at all.
    pub fn around(
        patch: Patch,
        corner: (usize, usize),
        size: (usize, usize),
        gray: impl FnOnce(Square) -> Vec<f32>,
    ) -> Self {
        let squares = WIDER.map(|scale| Square::around(corner, scale, size));

        // A square of a coarser scale contains those of all finer ones.
        let Some(largest) = squares.iter().flatten().next_back().copied() else { return Self::from(patch) };
        let levels = gray(largest);

        let means = |index: usize| {
            let square = squares[index]?;
            let first = (square.y - largest.y) * largest.side + square.x - largest.x;
            Some(block_means(levels.get(first..)?, largest.side, WIDER[index]))
        };

        let wider = std::array::from_fn(means);
        let whole = largest.side == Surroundings::SIDE && levels.len() == largest.side * largest.side;
        let place = (corner.0.saturating_sub(largest.x), corner.1.saturating_sub(largest.y));
        let surroundings = whole.then(|| Surroundings { levels: levels.into(), patch: place });

        Self { patch, wider, surroundings }
    }
}

impl From<Patch> for View {
    /// A view of `patch` alone.
    fn from(patch: Patch) -> Self {
        Self { patch, wider: [None; WIDER.len()], surroundings: None }
    }
}

/// The patch at `scale`: its values are the means of blocks of `levels`, which has `width` pixels per row and begins
/// with the patch's first block.
pub fn block_means(levels: &[f32], width: usize, scale: Scale) -> Patch {
    let mut patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
    match scale {
        Scale::Two => fill_block_means::<2>(levels, width, PATCH_SIDE, &mut patch.0),
        Scale::Four => fill_block_means::<4>(levels, width, PATCH_SIDE, &mut patch.0),
    }
    patch
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(x: usize, y: usize) -> f32 {
        ((x * x * 7 + y * 13 + x * y) % 256) as f32
    }

    /// The view at `corner` of a picture of these levels.
    fn view(corner: (usize, usize), size: (usize, usize)) -> View {
        let patch = Patch(std::array::from_fn(|i| level(corner.0 + i % PATCH_SIDE, corner.1 + i / PATCH_SIDE)));
        View::around(patch, corner, size, |Square { x, y, side }| {
            (0..side * side).map(|i| level(x + i % side, y + i / side)).collect()
        })
    }

    /// The mean of a block, summed directly.
    fn mean(x: usize, y: usize, scale: usize) -> f32 {
        let sum: f32 = (0..scale * scale).map(|i| level(x + i % scale, y + i / scale)).sum();
        sum / (scale * scale) as f32
    }

    #[test]
    fn wider_patches_are_means_of_blocks_around_the_same_centre() {
        let seen = view((100, 90), (300, 250));
        for (patch, (scale, left, top)) in seen.wider.into_iter().zip([(2, 84, 74), (4, 52, 42)]) {
            let patch = patch.unwrap();
            for (i, found) in patch.0.iter().enumerate() {
                let expected = mean(left + scale * (i % PATCH_SIDE), top + scale * (i / PATCH_SIDE), scale);
                assert!((found - expected).abs() < 1e-3, "scale {scale}, {i}: {found} {expected}");
            }
        }
    }

    #[test]
    fn wider_patches_keep_inside_the_picture() {
        assert_eq!(Square::around((3, 200), Scale::Four, (300, 240)), Some(Square { x: 0, y: 112, side: 128 }));
        let seen = view((3, 200), (300, 240));
        assert!((seen.wider[1].unwrap().0[0] - mean(0, 112, 4)).abs() < 1e-3);
        // The square of the middle scale is moved too: to the right, and up by 8 pixels.
        assert_eq!(Square::around((3, 200), Scale::Two, (300, 240)), Some(Square { x: 0, y: 176, side: 64 }));
        assert!((seen.wider[0].unwrap().0[33] - mean(2, 178, 2)).abs() < 1e-3);
    }

    #[test]
    fn surroundings_are_the_pixels_of_the_widest_patch() {
        for (corner, place) in [((100, 90), (48, 48)), ((3, 200), (3, 88))] {
            let around = view(corner, (300, 240)).surroundings.unwrap();
            assert_eq!((around.patch, around.levels.len()), (place, 128 * 128));
            let (left, top) = (corner.0 - place.0, corner.1 - place.1);
            let expected = |i: usize| level(left + i % 128, top + i / 128);
            assert!((0..128 * 128).all(|i| (around.levels[i] - expected(i)).abs() < f32::EPSILON));
        }
        assert_eq!(view((10, 10), (500, 127)).surroundings, None);
    }

    #[test]
    fn where_the_picture_is_too_small_there_is_none() {
        let wider = |size| view((10, 10), size).wider.map(|patch| patch.is_some());
        assert_eq!(wider((128, 128)), [true, true]);
        assert_eq!(wider((500, 127)), [true, false]);
        assert_eq!(wider((63, 500)), [false, false]);
    }
}
