//! The overlay that `parfocal inspect --out` writes: content area, patch and metrics drawn in.

use super::report::Report;
use parfocal_imaging::{ContentArea, GrayImage, PatchArea, RgbImage};

const AREA_COLOUR: [u8; 3] = [0, 220, 255];
const PATCH_COLOUR: [u8; 3] = [255, 220, 0];

/// Rows and columns of a glyph.
const GLYPH: (usize, usize) = (5, 3);

/// The glyphs that values need: five rows of three pixels each, as octal digits from the top.
const GLYPHS: [(char, u16); 16] = [
    ('0', 0o75557),
    ('1', 0o26227),
    ('2', 0o71747),
    ('3', 0o71717),
    ('4', 0o55711),
    ('5', 0o74717),
    ('6', 0o74757),
    ('7', 0o71122),
    ('8', 0o75757),
    ('9', 0o75717),
    ('.', 0o00002),
    ('-', 0o00700),
    ('M', 0o57755),
    ('G', 0o34553),
    ('L', 0o44447),
    ('R', 0o65655),
];

/// Draws the content of `report` into the picture. The picture may be larger than the report's lengths by a whole
/// factor.
pub(super) fn draw(rgb: RgbImage, report: &Report) -> RgbImage {
    let times = (rgb.width / report.width.max(1)).max(1);
    let mut canvas = Canvas { scale: (rgb.width / 400).max(1), picture: rgb };

    if let Some(area) = &report.content_area {
        // Whole numbers are pixel centres.
        let enlarged = |place: f64| (place + 0.5) * times as f64 - 0.5;
        let radius = area.radius * times as f64;
        canvas.circle(&ContentArea { x: enlarged(area.x), y: enlarged(area.y), radius, ..*area });
    }

    let PatchArea { x, y, width, height } = report.patch;
    canvas.frame(PatchArea { x: times * x, y: times * y, width: times * width, height: times * height });
    canvas.text(&format!("MGM {:.2}", report.mgm), 0);
    canvas.text(&format!("MLR {:.4}", report.mlr), 1);

    canvas.picture
}

/// A gray picture as RGB.
pub(super) fn from_gray(gray: &GrayImage) -> RgbImage {
    let data = gray.data.iter().flat_map(|value| [value.round() as u8; 3]).collect();
    RgbImage { width: gray.width, height: gray.height, data }
}

struct Canvas {
    picture: RgbImage,
    /// Width of a line and side of a glyph's pixel.
    scale: usize,
}

impl Canvas {
    /// Colours a pixel; does nothing outside the picture.
    fn dot(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        if x < self.picture.width && y < self.picture.height {
            let start = 3 * (y * self.picture.width + x);
            self.picture.data[start..start + 3].copy_from_slice(&colour);
        }
    }

    fn square(&mut self, x: usize, y: usize, side: usize, colour: [u8; 3]) {
        for i in 0..side * side {
            self.dot(x + i % side, y + i / side, colour);
        }
    }

    fn circle(&mut self, area: &ContentArea) {
        let half = self.scale as f64 / 2.0;

        for y in 0..self.picture.height {
            for x in 0..self.picture.width {
                let distance = (x as f64 - area.x).hypot(y as f64 - area.y);
                if (distance - area.radius).abs() <= half {
                    self.dot(x, y, AREA_COLOUR);
                }
            }
        }
    }

    /// A line around the patch, just outside of it, so that the patch itself stays as it is.
    fn frame(&mut self, patch: PatchArea) {
        let left = patch.x as isize;
        let top = patch.y as isize;
        let right = left + patch.width as isize;
        let bottom = top + patch.height as isize;
        let line = self.scale as isize;

        for y in top - line..bottom + line {
            for x in left - line..right + line {
                let inside = (left..right).contains(&x) && (top..bottom).contains(&y);
                if let (false, Ok(x), Ok(y)) = (inside, usize::try_from(x), usize::try_from(y)) {
                    self.dot(x, y, PATCH_COLOUR);
                }
            }
        }
    }

    /// Writes `text` into the top left corner, as line `line` from 0.
    fn text(&mut self, text: &str, line: usize) {
        let (rows, columns) = GLYPH;
        let scale = 2 * self.scale;

        for (place, letter) in text.chars().enumerate() {
            let bits = GLYPHS.iter().find(|(glyph, _)| *glyph == letter).map_or(0, |(_, bits)| *bits);
            for pixel in 0..rows * columns {
                if bits >> (rows * columns - 1 - pixel) & 1 == 1 {
                    let x = scale * (1 + place * (columns + 1) + pixel % columns);
                    let y = scale * (1 + line * (rows + 1) + pixel / columns);
                    self.square(x, y, scale, PATCH_COLOUR);
                }
            }
        }
    }
}
