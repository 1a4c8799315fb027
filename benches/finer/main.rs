//! Measures what a policy could gain from finer luminance: how often the mean gradient magnitude tells a step towards
//! focus from a step away from it. It looks at squares of the picture, coarsely (32x32) and twice as fine (64x64). Each
//! step lies within three planes of the sharpest one. The scene stands still, or drifts between the two pictures as it
//! does below a hand. `cargo bench --bench finer -- DIR...`, with a focal stack in each folder.

use std::path::Path;

use parfocal_autofocus::mgm;
use parfocal_imaging::{GrayImage, PATCH_SIDE, Patch, in_blocks};
use parfocal_learning::scans::stack::FocalStack;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Places looked at in each stack.
const PLACES: usize = 400;
/// Furthest drift between two pictures, along each axis, in coarse pixels.
const DRIFT: i32 = 5;
/// Furthest step from the sharpest plane.
const NEAR: usize = 3;

/// Pictures of a stack at two scales.
struct Stack {
    fine: Vec<GrayImage>,
    coarse: Vec<GrayImage>,
}

/// Steps whose direction was told correctly, and all steps.
#[derive(Default, Clone, Copy)]
struct Count {
    right: usize,
    all: usize,
}

impl Count {
    fn add(&mut self, right: bool) {
        self.right += usize::from(right);
        self.all += 1;
    }

    fn share(self) -> f64 {
        100.0 * self.right as f64 / self.all.max(1) as f64
    }
}

/// The patch with its corner at `x`, `y`.
fn patch(picture: &GrayImage, x: usize, y: usize) -> Patch {
    let value = |place: usize| picture.data[(y + place / PATCH_SIDE) * picture.width + x + place % PATCH_SIDE];
    Patch(std::array::from_fn(value))
}

/// Sharpness at `scale` of the square of 32x32 coarse pixels with its corner at `x`, `y`.
fn sharpness(picture: &GrayImage, scale: usize, x: usize, y: usize) -> f64 {
    let corners = (0..scale * scale).map(|tile| (tile % scale * PATCH_SIDE, tile / scale * PATCH_SIDE));
    corners.map(|(right, down)| mgm(&patch(picture, scale * x + right, scale * y + down))).sum()
}

fn largest(values: &[f64]) -> usize {
    let best = values.iter().enumerate().max_by(|one, other| one.1.total_cmp(other.1));
    best.map_or(0, |(index, _)| index)
}

fn read(folder: &Path) -> Stack {
    let whole = FocalStack::load(folder, None, 1, None, None).unwrap();
    // About 1000 pixels wide.
    let scale = (whole.size().0 + 500) / 1000;
    let fine: Vec<GrayImage> = whole.planes().iter().map(|plane| in_blocks(&plane.picture, scale.max(1))).collect();
    let coarse = fine.iter().map(|picture| in_blocks(picture, 2)).collect();
    Stack { fine, coarse }
}

/// Counts of correct steps: coarse and fine, standing still; coarse and fine, drifting.
fn counts(stack: &Stack) -> [Count; 4] {
    let mut counts = [Count::default(); 4];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let margin = DRIFT as usize;
    let GrayImage { width, height, .. } = stack.coarse[0];

    for _ in 0..PLACES {
        let x = rng.random_range(margin..width - PATCH_SIDE - margin);
        let y = rng.random_range(margin..height - PATCH_SIDE - margin);
        let coarse: Vec<f64> = stack.coarse.iter().map(|picture| sharpness(picture, 1, x, y)).collect();
        let fine: Vec<f64> = stack.fine.iter().map(|picture| sharpness(picture, 2, x, y)).collect();

        // Uses only places where both scales agree on the sharpest plane, so that they are judged by the same truth.
        let best = largest(&coarse);
        if best.abs_diff(largest(&fine)) > 1 {
            continue;
        }

        for nearer in best.saturating_sub(NEAR)..=(best + NEAR).min(coarse.len() - 1) {
            let further = if nearer < best { nearer.checked_sub(1) } else { Some(nearer + 1) };
            let Some(further) = further.filter(|&plane| plane < coarse.len() && nearer != best) else { continue };

            counts[0].add(coarse[nearer] > coarse[further]);
            counts[1].add(fine[nearer] > fine[further]);

            let moved = |place: usize, by: i32| place.saturating_add_signed(by as isize);
            let right = moved(x, rng.random_range(-DRIFT..=DRIFT));
            let down = moved(y, rng.random_range(-DRIFT..=DRIFT));
            counts[2].add(coarse[nearer] > sharpness(&stack.coarse[further], 1, right, down));
            counts[3].add(fine[nearer] > sharpness(&stack.fine[further], 2, right, down));
        }
    }
    counts
}

fn main() {
    let folders: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();

    println!("| stack | steps | still, coarse | still, fine | drifting, coarse | drifting, fine |");
    println!("|---|---|---|---|---|---|");
    for folder in &folders {
        let counts = counts(&read(Path::new(folder)));
        let shares = counts.map(|count| format!("{:.1} %", count.share()));
        let name = Path::new(folder).file_name().unwrap_or_default().to_string_lossy().into_owned();
        println!("| {name} | {} | {} |", counts[0].all, shares.join(" | "));
    }
}
