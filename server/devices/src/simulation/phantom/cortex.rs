//! The phantom's relief: gyri and sulci, the fissure, and the rim of the craniotomy.

use std::f32::consts::{PI, TAU};

use multiversion::multiversion;
use rand::{Rng, RngExt};

use super::field::{Field, Spline, knots};
use crate::simulation::normal::standard_normal;

/// Texels between two knots of the fields that are made at a coarse scale.
const CELL: usize = 8;

/// The surface's shape.
pub(super) struct Cortex {
    /// Height towards the camera, in texels.
    pub(super) height: Field,
    /// Light that reaches the surface past its walls, 0..1.
    pub(super) open: Field,
    /// Share of dura and bone (1) against brain (0).
    pub(super) rim: Field,
    /// Distance from the nearest sulcus: 0 in it, about 1 on a crown.
    pub(super) crown: Field,
}

/// How a cortex is folded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Folding {
    /// Distance between neighbouring sulci, texels.
    pub(super) gyrus: f32,
    /// How much the folds prefer one direction, 0..1.
    pub(super) alignment: f32,
}

impl Cortex {
    /// A cortex of `side` texels square.
    pub(super) fn fold(side: usize, folding: Folding, rng: &mut impl Rng) -> Self {
        let waves = Spline::new(&folds(side, folding, rng), side, CELL).field();
        let depth = Spline::noise(side, 64, rng);
        let fissure = Spline::new(&fissure(side, rng), side, CELL);
        let opening = Spline::new(&opening(side, rng), side, CELL);

        let mut lines = [(); 3].map(|()| vec![0.0; side]);
        let blank = || Field::filled(side, 0.0);
        let mut cortex = Self { height: blank(), open: blank(), rim: blank(), crown: blank() };

        for y in 0..side {
            for (spline, line) in [&depth, &fissure, &opening].into_iter().zip(&mut lines) {
                spline.row_into(y, line);
            }

            let above = y.saturating_sub(1);
            let below = (y + 1).min(side - 1);
            let span = y * side..(y + 1) * side;
            shape_row(
                &Shape {
                    waves: [waves.row(above), waves.row(y), waves.row(below)],
                    depth: &lines[0],
                    fissure: &lines[1],
                    opening: &lines[2],
                    gyrus: folding.gyrus,
                },
                [
                    &mut cortex.height.data[span.clone()],
                    &mut cortex.open.data[span.clone()],
                    &mut cortex.rim.data[span.clone()],
                    &mut cortex.crown.data[span],
                ],
            );
        }

        cortex
    }
}

/// One row of the fields that shape the surface.
struct Shape<'a> {
    waves: [&'a [f32]; 3],
    depth: &'a [f32],
    fissure: &'a [f32],
    opening: &'a [f32],
    gyrus: f32,
}

/// Sulci run where the waves cross zero, at a distance of about |wave| / |gradient|.
#[multiversion(targets("x86_64+avx2+fma"))]
fn shape_row(shape: &Shape<'_>, out: [&mut [f32]; 4]) {
    let [height, open, rim, crown] = out;
    let side = height.len();
    let [above, here, below] = shape.waves.map(|row| &row[..side]);
    let depth = &shape.depth[..side];
    let fissure = &shape.fissure[..side];
    let opening = &shape.opening[..side];
    let open = &mut open[..side];
    let rim = &mut rim[..side];
    let crown = &mut crown[..side];

    let flattest = 1.2 / shape.gyrus;
    for x in 1..side - 1 {
        let across = 0.5 * (here[x + 1] - here[x - 1]);
        let down = 0.5 * (below[x] - above[x]);
        // A wave's value over its slope is about the distance to its nearest zero, the sulcus.
        let distance = here[x].abs() / (across * across + down * down).sqrt().max(flattest);

        let strength = (0.75 + 0.3 * depth[x]).clamp(0.15, 1.0);
        let broad = falloff(distance / (0.2 * shape.gyrus));
        let narrow = strength * falloff((distance / 3.0).powi(2));

        let cleft = falloff((fissure[x] / 7.0).powi(2));
        let shoulder = falloff(fissure[x] / 30.0);
        let outside = (0.5 + opening[x] / 5.0).clamp(0.0, 1.0);
        let outside = outside * outside * (3.0 - 2.0 * outside);

        let brain = -strength * (7.0 * broad + 9.0 * narrow) - 26.0 * cleft - 8.0 * shoulder;
        let bone = 14.0 + 5.0 * (1.0 - falloff((opening[x] - 6.0).max(0.0) / 12.0));
        height[x] = brain + outside * (bone - brain);

        let lit =
            (1.0 - 0.2 * strength * broad) * (1.0 - 0.4 * narrow) * (1.0 - 0.55 * cleft) * (1.0 - 0.15 * shoulder);
        let shade = 1.0 - 0.45 * falloff(opening[x] / 9.0) * (1.0 - outside);

        open[x] = (lit + outside * (1.0 - lit)) * shade;
        rim[x] = outside;
        crown[x] = (1.0 - strength * broad) * (1.0 - cleft);
    }

    for field in [height, open, rim, crown] {
        field[0] = field[1];
        field[side - 1] = field[side - 2];
    }
}

/// 1 at 0, falling as 1 / (1 + x^2).
#[inline(always)]
fn falloff(x: f32) -> f32 {
    1.0 / (1.0 + x * x)
}

/// Waves of one length and many directions, as knots.
fn folds(side: usize, folding: Folding, rng: &mut impl Rng) -> Field {
    const WAVES: usize = 28;
    let mut sum = Field::filled(knots(side, CELL), 0.0);
    let preferred = PI * rng.random::<f32>();

    for _ in 0..WAVES {
        let free = PI * (rng.random::<f32>() - 0.5);
        let direction = preferred + free * (1.0 - folding.alignment);

        let length = 2.0 * folding.gyrus * (1.0 + 0.22 * standard_normal(rng) as f32).clamp(0.55, 1.8);
        let number = TAU * CELL as f32 / length;
        let phase = TAU * rng.random::<f32>();
        let (sin, cos) = direction.sin_cos();

        add_wave(&mut sum, [number * cos, number * sin], phase, (2.0 / WAVES as f32).sqrt());
    }
    sum
}

/// Adds `amplitude * cos(number . place + phase)`, by turning a phasor along each row.
fn add_wave(field: &mut Field, number: [f32; 2], phase: f32, amplitude: f32) {
    let (turn_sin, turn_cos) = number[0].sin_cos();
    for (y, row) in field.data.chunks_exact_mut(field.side).enumerate() {
        let (mut sin, mut cos) = (phase + number[1] * y as f32).sin_cos();

        for value in row {
            *value += amplitude * cos;
            (sin, cos) = (sin * turn_cos + cos * turn_sin, cos * turn_cos - sin * turn_sin);
        }
    }
}

/// Distance to the line of the fissure, in texels, as knots. The line meanders through the field.
fn fissure(side: usize, rng: &mut impl Rng) -> Field {
    let middle = 0.5 * side as f32;
    let direction = PI * rng.random::<f32>();
    let offset = 0.16 * side as f32 * if rng.random::<bool>() { 1.0 } else { -1.0 } * (0.5 + rng.random::<f32>());
    let phases: [f32; 3] = std::array::from_fn(|_| TAU * rng.random::<f32>());
    let (sin, cos) = direction.sin_cos();

    Field::from_fn(knots(side, CELL), |x, y| {
        let x = place(x) - middle;
        let y = place(y) - middle;
        let along = (x * cos + y * sin) * TAU / side as f32;
        let meander = 26.0 * (1.3 * along + phases[0]).sin() + 11.0 * (3.1 * along + phases[1]).sin();
        (y * cos - x * sin - offset - meander - 4.0 * (7.7 * along + phases[2]).sin()).abs()
    })
}

/// Distance outwards from the edge of the craniotomy, in texels, as knots; negative over the brain.
fn opening(side: usize, rng: &mut impl Rng) -> Field {
    let middle = 0.5 * side as f32;
    let phases: [f32; 3] = std::array::from_fn(|_| TAU * rng.random::<f32>());

    Field::from_fn(knots(side, CELL), |x, y| {
        let x = place(x) - middle;
        let y = place(y) - middle;
        let angle = y.atan2(x);
        let wobble = 0.05 * (2.0 * angle + phases[0]).sin()
            + 0.03 * (3.0 * angle + phases[1]).sin()
            + 0.006 * (11.0 * angle + phases[2]).sin();

        x.hypot(y) - 0.41 * side as f32 * (1.0 + wobble)
    })
}

/// Place of a knot, in texels: the spline's first knot is one cell before the field.
fn place(knot: usize) -> f32 {
    (knot as f32 - 1.0) * CELL as f32
}
