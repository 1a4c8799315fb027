//! Gray from RGB: Rec. 709 weights on the 0..255 scale.

use super::frame::{GrayImage, RgbImage};
use super::geometry::{PATCH_SIDE, Patch, PatchArea};
use super::view::{Square, View};

/// Makes `gray` from `rgb`: 0.2126 R + 0.7152 G + 0.0722 B of the encoded values (ITU-R BT.709
/// weights), as the content-area method does. `gray` is resized as needed.
pub fn rgb_to_gray(rgb: &RgbImage, gray: &mut GrayImage) {
    gray.width = rgb.width;
    gray.height = rgb.height;
    gray.data.clear();

    let (pixels, _) = rgb.data.as_chunks::<3>();
    gray.data.extend(pixels.iter().map(|pixel| luma(pixel.map(f32::from))));
    gray.data.resize(rgb.width * rgb.height, 0.0);
}

/// The gray patch of `rgb` at `area`, computing just those pixels; black where `area` leaves the
/// picture.
pub fn rgb_patch(rgb: &RgbImage, area: PatchArea) -> Patch {
    let (pixels, _) = rgb.data.as_chunks::<3>();
    Patch(std::array::from_fn(|i| {
        let x = area.x + i % PATCH_SIDE;
        let y = area.y + i / PATCH_SIDE;
        let pixel = if x < rgb.width { pixels.get(y * rgb.width + x) } else { None };
        pixel.map_or(0.0, |pixel| luma(pixel.map(f32::from)))
    }))
}

/// The policies' view of `rgb` with the patch at `area`, computing just those pixels.
pub fn rgb_view(rgb: &RgbImage, area: PatchArea) -> View {
    let (pixels, _) = rgb.data.as_chunks::<3>();
    View::around(rgb_patch(rgb, area), (area.x, area.y), (rgb.width, rgb.height), |Square { x, y, side }| {
        let lines = pixels.chunks_exact(rgb.width).skip(y).take(side);
        lines.flat_map(|line| line[x..x + side].iter().map(|pixel| luma(pixel.map(f32::from)))).collect()
    })
}

pub(super) fn luma([red, green, blue]: [f32; 3]) -> f32 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scale, block_means};

    #[test]
    fn weights_are_those_of_rec_709() {
        let rgb = RgbImage::new(5, 1, vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255, 0, 0, 0]).unwrap();
        let mut gray = GrayImage::default();
        rgb_to_gray(&rgb, &mut gray);
        for (found, expected) in gray.data.iter().zip([54.213, 182.376, 18.411, 255.0, 0.0]) {
            assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        }
    }

    #[test]
    fn patch_is_the_same_pixels() {
        let data = (0..60 * 50 * 3).map(|i| u8::try_from(i * 7 % 251).unwrap()).collect();
        let rgb = RgbImage::new(60, 50, data).unwrap();
        let mut gray = GrayImage::default();
        rgb_to_gray(&rgb, &mut gray);
        let patch = rgb_patch(&rgb, PatchArea { x: 11, y: 5, width: 32, height: 32 });
        assert_eq!(patch.0[0].to_bits(), gray.data[5 * 60 + 11].to_bits());
        assert_eq!(patch.0[33].to_bits(), gray.data[6 * 60 + 12].to_bits());
        assert_eq!(patch.0[1023].to_bits(), gray.data[36 * 60 + 42].to_bits());
        let beyond = rgb_patch(&rgb, PatchArea { x: 59, y: 49, width: 32, height: 32 });
        assert_eq!(beyond.0[0].to_bits(), gray.data[49 * 60 + 59].to_bits());
        assert!(beyond.0[1..].iter().all(|&value| value == 0.0));
    }

    #[test]
    fn wider_patches_are_those_of_the_whole_gray_picture() {
        let data = (0..160 * 140 * 3).map(|i| u8::try_from(i * 7 % 251).unwrap()).collect();
        let rgb = RgbImage::new(160, 140, data).unwrap();
        let area = PatchArea { x: 60, y: 50, width: 32, height: 32 };
        let mut gray = GrayImage::default();
        rgb_to_gray(&rgb, &mut gray);
        let seen = rgb_view(&rgb, area);
        assert_eq!(seen.patch, rgb_patch(&rgb, area));
        for (patch, (scale, left, top)) in seen.wider.into_iter().zip([(Scale::Two, 44, 34), (Scale::Four, 12, 2)]) {
            assert_eq!(patch.unwrap(), block_means(&gray.data[top * 160 + left..], 160, scale));
        }
    }
}
