//! Pial vessels: arteries and veins that branch over the surface by Murray's law.

use std::f32::consts::TAU;

use rand::{Rng, RngExt};

use super::field::Field;

/// Radius in texels below which a vessel is too fine to draw.
const THINNEST: f32 = 0.55;

/// The places that vessels cover, 0..1 each, and how far the vessels stand out, in texels.
pub(super) struct Vessels {
    pub(super) arteries: Field,
    pub(super) veins: Field,
    pub(super) bulge: Field,
}

/// Numbers of vessels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Density {
    /// Large arteries.
    pub(super) arteries: usize,
    /// Large veins.
    pub(super) veins: usize,
    /// Fine vessels that surface in mid-field.
    pub(super) fine: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Artery,
    Vein,
}

/// The growing end of a vessel.
#[derive(Debug, Clone, Copy)]
struct Tip {
    x: f32,
    y: f32,
    heading: f32,
    /// Heading about which it wanders.
    course: f32,
    turn: f32,
    radius: f32,
    kind: Kind,
}

impl Vessels {
    /// Grows vessels over a square of `side` texels; `valleys` is least where veins like to run.
    pub(super) fn grow(side: usize, density: Density, valleys: &Field, rng: &mut impl Rng) -> Self {
        let blank = || Field::filled(side, 0.0);
        let mut vessels = Self { arteries: blank(), veins: blank(), bulge: blank() };

        let mut tips = Vec::new();
        for _ in 0..density.arteries {
            tips.push(tip_at_rim(side as f32, 2.5 + 2.0 * rng.random::<f32>(), Kind::Artery, rng));
        }
        for _ in 0..density.veins {
            tips.push(tip_at_rim(side as f32, 4.0 + 3.5 * rng.random::<f32>(), Kind::Vein, rng));
        }
        for _ in 0..density.fine {
            tips.push(tip_inside(side as f32, rng));
        }

        while let Some(tip) = tips.pop() {
            vessels.follow(tip, valleys, &mut tips, rng);
        }

        vessels
    }

    /// Draws one vessel from its tip to its end. Adds the tips of its branches to `tips`.
    fn follow(&mut self, mut tip: Tip, valleys: &Field, tips: &mut Vec<Tip>, rng: &mut impl Rng) {
        let side = self.bulge.side as f32;
        let mut until_branch = branch_distance(tip.radius, rng);
        while tip.radius > THINNEST {
            self.stamp(&tip);
            let stride = (0.6 * tip.radius).max(0.9);
            tip.advance(stride, valleys, rng);
            let margin = -12.0..side + 12.0;

            if !margin.contains(&tip.x) || !margin.contains(&tip.y) {
                return;
            }

            until_branch -= stride;
            if until_branch <= 0.0 {
                tips.push(tip.branch(rng));
                until_branch = branch_distance(tip.radius, rng);
            }
        }
    }

    /// Draws the vessel's cross-section here.
    fn stamp(&mut self, tip: &Tip) {
        let side = self.bulge.side;
        let reach = tip.radius + 1.0;
        let span = |centre: f32| {
            let low = (centre - reach).ceil().max(0.0) as usize;
            low..(((centre + reach).floor() + 1.0).max(0.0) as usize).min(side)
        };

        let opacity = tip.radius / (tip.radius + 0.7);
        // Fine vessels lie within the pia, large ones on it.
        let standing = 0.5 * (0.4 * (tip.radius - 0.6)).clamp(0.1, 1.0);
        let cover = match tip.kind {
            Kind::Artery => &mut self.arteries,
            Kind::Vein => &mut self.veins,
        };

        for y in span(tip.y) {
            for x in span(tip.x) {
                let square = (x as f32 - tip.x).powi(2) + (y as f32 - tip.y).powi(2);
                let index = y * side + x;
                let covered = opacity * (tip.radius + 0.5 - square.sqrt()).clamp(0.0, 1.0);
                cover.data[index] = cover.data[index].max(covered);

                let height = standing * (tip.radius * tip.radius - square).max(0.0).sqrt();
                self.bulge.data[index] = self.bulge.data[index].max(height);
            }
        }
    }
}

impl Tip {
    /// Moves on by `stride`: the tip wanders and thins, and a vein is drawn into the valleys.
    fn advance(&mut self, stride: f32, valleys: &Field, rng: &mut impl Rng) {
        let kick = 0.013 * swing(rng) / self.radius.sqrt();
        self.turn = 0.9 * self.turn - 0.006 * (self.heading - self.course) / self.radius + kick;
        self.course += 0.006 * swing(rng);

        let (sin, cos) = self.heading.sin_cos();

        if self.kind == Kind::Vein && self.radius > 1.5 {
            let left = valleys.near(self.x + 9.0 * cos + 6.0 * sin, self.y + 9.0 * sin - 6.0 * cos);
            let right = valleys.near(self.x + 9.0 * cos - 6.0 * sin, self.y + 9.0 * sin + 6.0 * cos);
            self.heading += 0.08 * (left - right) * stride / self.radius;
        }

        self.heading += self.turn * stride;
        self.x += cos * stride;
        self.y += sin * stride;
        self.radius *= 1.0 - 0.0009 * stride;
    }

    /// Splits a branch off; the radii's cubes add up to the parent's (Murray 1926).
    fn branch(&mut self, rng: &mut impl Rng) -> Self {
        let share = 0.08 + 0.4 * rng.random::<f32>();
        let side = if rng.random::<bool>() { 1.0 } else { -1.0 };
        let angle = side * (0.4 + 0.8 * rng.random::<f32>());
        let radius = self.radius * share.cbrt();

        let child = Self { heading: self.heading + angle, course: self.course + angle, turn: 0.0, radius, ..*self };
        self.radius *= (1.0 - share).cbrt();
        self.course -= 0.3 * share * angle;

        child
    }
}

/// A centred uniform draw of variance 1: cheaper than a normal one, and over a vessel's many steps the sum is still
/// nearly normal.
fn swing(rng: &mut impl Rng) -> f32 {
    3.46 * (rng.random::<f32>() - 0.5)
}

fn branch_distance(radius: f32, rng: &mut impl Rng) -> f32 {
    (11.0 + 11.0 * radius) * (0.4 + 1.4 * rng.random::<f32>())
}

/// A large vessel that enters at the rim of the craniotomy and heads inwards.
fn tip_at_rim(side: f32, radius: f32, kind: Kind, rng: &mut impl Rng) -> Tip {
    let (sin, cos) = (TAU * rng.random::<f32>()).sin_cos();
    let heading = (-sin).atan2(-cos) + (rng.random::<f32>() - 0.5) * 1.8;
    let x = side * (0.5 + 0.45 * cos);
    let y = side * (0.5 + 0.45 * sin);
    Tip { x, y, heading, course: heading, turn: 0.0, radius, kind }
}

/// A fine vessel that surfaces somewhere on the brain.
fn tip_inside(side: f32, rng: &mut impl Rng) -> Tip {
    let kind = if rng.random::<f32>() < 0.6 { Kind::Artery } else { Kind::Vein };
    let (sin, cos) = (TAU * rng.random::<f32>()).sin_cos();
    let reach = 0.45 * side * rng.random::<f32>().sqrt();
    let x = 0.5 * side + reach * cos;
    let y = 0.5 * side + reach * sin;
    let heading = TAU * rng.random::<f32>();
    // Most fine vessels are barely visible.
    let radius = 0.6 + 0.85 * rng.random::<f32>().powi(2);
    Tip { x, y, heading, course: heading, turn: 0.0, radius, kind }
}
