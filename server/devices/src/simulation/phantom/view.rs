//! The camera's view: for each mosaic cell, which place of the surface it sees, how far that is out of focus, and in
//! what light.

use std::ops::Range;

use multiversion::multiversion;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::defocus::Stack;
use super::field::{Field, SIDE};
use super::hand::Pose;
use super::spectra::ENDMEMBERS;
use parfocal_imaging::ContentArea;

/// Width of one band, pixels.
pub(super) const WIDTH: usize = 512;
/// Height of one band, pixels.
pub(super) const HEIGHT: usize = 272;

/// Radius of the content area, pixels of a band: cut a little by the sensor's upper and lower edge.
const RADIUS: f32 = 150.0;
/// Radius of the disc of confusion, pixels of a band, when focal power is off by the whole range. Its
/// second moment is that of a Gaussian of half as many pixels: within the 2 to 8 of simulated
/// focal-time scans.
const BLUR: f32 = 12.0;

/// Working distances in focus at focal power 0 and 1, metres; focal power is linear in 1 / distance.
const DISTANCES: [f64; 2] = [0.42, 0.24];
/// Distance at which one texel fills one pixel of a band, metres.
const TEXEL_DISTANCE: f64 = 0.32;
/// Size of a texel on the brain, metres: a field of view of about 48 mm at [`TEXEL_DISTANCE`].
const TEXEL: f64 = 0.16e-3;

/// The fixed properties of the camera's optics.
pub(super) struct Optics {
    centre: [f32; 2],
    /// Light that reaches each pixel, 0..1: falls off to the rim of the content area and is 0 outside.
    light: Vec<f32>,
    /// The lit columns of each row.
    spans: Vec<Range<usize>>,
}

/// A part of the picture, in cells; only light within it is computed.
#[derive(Debug, Clone)]
pub(super) struct Region {
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
}

impl Region {
    pub(super) const WHOLE: Self = Self { columns: 0..WIDTH, rows: 0..HEIGHT };

    /// The region's columns within the lit `span`; `0..0` if there are none.
    pub(super) fn lit(&self, span: Range<usize>) -> Range<usize> {
        let columns = span.start.max(self.columns.start)..span.end.min(self.columns.end);
        if columns.is_empty() { 0..0 } else { columns }
    }
}

/// One cell row of the picture: abundances times light, by endmember, with one column of darkness on
/// either side.
pub(super) type Line = [Vec<f32>; ENDMEMBERS];

/// A blank [`Line`].
pub(super) fn blank_line() -> Line {
    [(); ENDMEMBERS].map(|()| vec![0.0; WIDTH + 2])
}

/// Sets a line to darkness.
pub(super) fn darken(line: &mut Line) {
    for plane in line {
        plane.fill(0.0);
    }
}

impl Optics {
    /// The optics of a seed: the content area is never quite in the middle.
    pub(super) fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(3);

        let mut centre = |middle: usize| middle as f32 / 2.0 + 10.0 * (rng.random::<f32>() - 0.5);
        let centre = [centre(WIDTH), centre(HEIGHT)];

        let light: Vec<f32> = (0..WIDTH * HEIGHT)
            .map(|index| {
                let x = (index % WIDTH) as f32 - centre[0];
                let y = (index / WIDTH) as f32 - centre[1];
                let distance = x.hypot(y);
                (RADIUS + 0.5 - distance).clamp(0.0, 1.0) * (1.0 - 0.35 * (distance / RADIUS).powi(2))
            })
            .collect();

        let spans = light.chunks_exact(WIDTH).map(lit_span).collect();
        Self { centre, light, spans }
    }

    /// The content area's place and size, in pixels of a band.
    pub(super) fn content_area(&self) -> ContentArea {
        let [x, y] = self.centre.map(f64::from);
        ContentArea { x, y, radius: f64::from(RADIUS), confidence: 1.0 }
    }

    /// Light that reaches a pixel, 0..1.
    pub(super) fn light(&self, x: usize, y: usize) -> f32 {
        self.light[y * WIDTH + x]
    }

    /// The lit columns of a row; `0..0` in the dark.
    pub(super) fn span(&self, y: usize) -> Range<usize> {
        self.spans[y].clone()
    }
}

fn lit_span(row: &[f32]) -> Range<usize> {
    let first = row.iter().position(|light| *light > 0.0).unwrap_or(0);
    let end = row.iter().rposition(|light| *light > 0.0).map_or(0, |last| last + 1);
    first..end
}

/// The mapping from pixels to the surface at one pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mapping {
    centre: [f32; 2],
    /// Place on the surface under the content area's centre, texels from the scene's corner.
    origin: [f32; 2],
    /// Texels rightwards and downwards on the surface for one pixel rightwards; for one pixel downwards
    /// the same turned by 90 degrees.
    across: [f32; 2],
    /// Focal power that is sharp on the flat surface at the centre, and its change for one pixel right
    /// and down.
    focus: [f32; 3],
    /// Change of that focal power for one texel of height.
    per_height: f32,
    /// Radius of the disc of confusion in texels for a whole range's error of focal power, squared.
    blur_square: f32,
}

impl Mapping {
    pub(super) fn new(optics: &Optics, pose: &Pose) -> Self {
        let [far, near] = DISTANCES.map(f64::recip);
        let distance = (far + pose.focus * (near - far)).recip();
        let texels = distance / TEXEL_DISTANCE;
        let (sin, cos) = pose.roll.sin_cos();

        // d(1 / distance) = height / distance^2, in units of the lens's whole range.
        let per_height = TEXEL / (distance * distance * (near - far));
        let lean = pose.tilt.map(|tilt| texels * tilt.tan() * per_height);

        let middle = SIDE as f64 / 2.0;
        Self {
            centre: optics.centre,
            origin: pose.place.map(|place| (middle + place) as f32),
            across: [(texels * cos) as f32, (texels * sin) as f32],
            focus: [pose.focus as f32, lean[0] as f32, lean[1] as f32],
            per_height: per_height as f32,
            blur_square: (f64::from(BLUR) * texels).powi(2) as f32,
        }
    }

    /// Place on the surface that a pixel sees, texels.
    #[inline(always)]
    pub(super) fn place(&self, x: f32, y: f32) -> (f32, f32) {
        let x = x - self.centre[0];
        let y = y - self.centre[1];
        let [cos, sin] = self.across;
        (self.origin[0] + cos * x - sin * y, self.origin[1] + sin * x + cos * y)
    }

    /// Focal power that would be sharp at a pixel that sees a place of this height; may lie outside
    /// 0..=1.
    #[inline(always)]
    pub(super) fn sharp_at(&self, x: f32, y: f32, height: f32) -> f32 {
        let x = x - self.centre[0];
        let y = y - self.centre[1];
        self.focus[0] + self.focus[1] * x + self.focus[2] * y + self.per_height * height
    }
}

/// Height of the surface at a place, from the relief of every second texel.
#[inline(always)]
pub(super) fn height_at(relief: &Field, u: f32, v: f32) -> f32 {
    let last = (relief.side - 1) as f32;
    let x = (0.5 * u).clamp(0.0, last) as u32;
    let y = (0.5 * v).clamp(0.0, last) as u32;
    relief.data[y as usize * relief.side + x as usize]
}

/// Writes what one cell row sees at `focal_power` into `line`, in `columns` and the ones beside them.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(super) fn look(
    line: &mut Line,
    y: usize,
    optics: &Optics,
    mapping: &Mapping,
    surface: (&Stack, &Field),
    focal_power: f32,
    columns: &Range<usize>,
) {
    darken(line);

    let lit = &optics.spans[y];
    for x in lit.start.max(columns.start.saturating_sub(1))..lit.end.min(columns.end + 1) {
        let cell = look_at(x, y, optics, mapping, surface, focal_power);
        for (plane, light) in line.iter_mut().zip(cell) {
            plane[x + 1] = light;
        }
    }
}

/// The light that one cell sees at `focal_power`: abundances times light.
#[inline(always)]
pub(super) fn look_at(
    x: usize,
    y: usize,
    optics: &Optics,
    mapping: &Mapping,
    (stack, relief): (&Stack, &Field),
    focal_power: f32,
) -> [f32; ENDMEMBERS] {
    let column = x as f32;
    let row = y as f32;
    let (u, v) = mapping.place(column, row);
    let miss = focal_power - mapping.sharp_at(column, row, height_at(relief, u, v));
    let light = optics.light[y * WIDTH + x];
    stack.at(u, v, mapping.blur_square * miss * miss).map(|abundance| light * abundance)
}
