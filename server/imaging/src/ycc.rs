//! Pictures as JPEG stores them: luma for every pixel, chroma once for two by two pixels.

/// A picture in luma and chroma as JFIF defines it (full range, ITU-R BT.601's weights), with 4:2:0 chroma:
/// a chroma value covers two by two pixels. Width and height are even.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct YccImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// All luma, then all chroma of blue, then all chroma of red; row after row without gaps.
    pub data: Vec<u8>,
}

/// Weights of red, green and blue in luma.
pub(super) const LUMA: [f32; 3] = [0.299, 0.587, 0.114];
/// Factors of chroma: it is the difference of blue, or of red, from luma, times these.
pub(super) const CHROMA: [f32; 2] = [0.5 / (1.0 - LUMA[2]), 0.5 / (1.0 - LUMA[0])];

/// Scale of the conversion's whole numbers.
const PARTS: f32 = 16_384.0;

impl YccImage {
    /// Makes room for `width` x `height` pixels, both even.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        self.width = width;
        self.height = height;
        self.data.resize(width * height / 2 * 3, 0);
    }

    /// Luma, and blue's and red's chroma.
    pub(super) fn split_mut(&mut self) -> [&mut [u8]; 3] {
        let (luma, chroma) = self.data.split_at_mut(self.width * self.height);
        let (blue, red) = chroma.split_at_mut(chroma.len() / 2);
        [luma, blue, red]
    }
}

/// A row of sRGB pixels from their luma and chroma.
pub(super) fn row_in_rgb(luma: &[u8], [blue, red]: [&[u8]; 2], pixels: &mut [u8]) {
    let chroma = blue.iter().zip(red);
    for ((pixel, &luma), (&blue, &red)) in pixels.as_chunks_mut::<3>().0.iter_mut().zip(luma).zip(chroma) {
        *pixel = in_rgb(luma, i32::from(blue) - 128, i32::from(red) - 128);
    }
}

/// A pixel in sRGB.
fn in_rgb(luma: u8, blue: i32, red: i32) -> [u8; 3] {
    const BLUE: i32 = (PARTS / CHROMA[0]) as i32;
    const RED: i32 = (PARTS / CHROMA[1]) as i32;
    const GREEN_OF_BLUE: i32 = (PARTS * LUMA[2] / LUMA[1] / CHROMA[0]) as i32;
    const GREEN_OF_RED: i32 = (PARTS * LUMA[0] / LUMA[1] / CHROMA[1]) as i32;

    let luma = i32::from(luma) * PARTS as i32 + PARTS as i32 / 2;
    let green = luma - GREEN_OF_BLUE * blue - GREEN_OF_RED * red;
    [luma + RED * red, green, luma + BLUE * blue].map(|value| (value / PARTS as i32).clamp(0, 255) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_the_standard() {
        // JFIF 1.02's equations, with 1.402, 0.344136, 0.714136 and 1.772.
        for (luma, blue, red, expected) in [
            (81, 90, 240, [238, 14, 14]),
            (128, 128, 128, [128, 128, 128]),
            (200, 100, 150, [231, 194, 150]),
            (255, 128, 255, [255, 164, 255]),
        ] {
            let mut pixel = [0; 3];
            row_in_rgb(&[luma], [&[blue], &[red]], &mut pixel);
            assert_eq!(pixel, expected);
        }
    }
}
