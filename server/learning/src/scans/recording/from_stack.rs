//! Cuts a recorded scan out of a focal stack: windows drift over the stack, and in each of them the
//! optimum walks as in the paper's simulation. Every picture shown was really taken.

use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{PosePictures, shot};
use crate::LearningError;
use crate::scans::recorded::{evenly_spread, patch_at};
use crate::scans::stack::drift::{DRIFT, FOCUS, FOCUS_RANGE, SMOOTHING};
use crate::scans::stack::{FocalStack, cropped};
use parfocal_autofocus::mgm;
use parfocal_devices::camera::recorded::{Header, LEAST_SIDE, ScanRecording};
use parfocal_devices::simulation::gaussian::smoothed;
use parfocal_devices::simulation::walk::Walk;
use parfocal_imaging::{PATCH_SIDE, PatchArea};

/// How a scan is cut out of a stack.
#[derive(Debug, Clone)]
pub struct Cut {
    /// Name of the stack, for people.
    pub name: String,
    /// Number of planes that a pose sees: one for each focal power.
    pub planes: usize,
    /// Width and height of the window, pixels.
    pub size: usize,
    /// Number of poses.
    pub poses: usize,
    /// Seed of the walks.
    pub seed: u64,
}

/// What one pose sees: the upper left corner of its window, and its first plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub left: usize,
    /// First line.
    pub top: usize,
    /// First plane.
    pub plane: usize,
}

/// The windows of `cut` on `stack`, whose planes are evenly spaced.
///
/// # Errors
/// If stack or pictures are too small.
pub fn windows(stack: &FocalStack, cut: &Cut) -> Result<Vec<Window>, LearningError> {
    let Cut { planes, size, poses, .. } = *cut;
    let (width, height) = stack.size();
    let of = stack.planes().len();
    if planes >= of {
        bail!(
            "a pose cannot see {planes} planes of a stack of {of}: the window must have room to move; give --planes at \
             most {}",
            of - 1
        );
    }
    if size < LEAST_SIDE || size > width || size > height {
        bail!(
            "a window of {size}x{size} pixels does not fit into pictures of {width}x{height}; give a smaller --size or \
             --scale"
        );
    }

    let mut rng = ChaCha8Rng::seed_from_u64(cut.seed);
    let [mut x, mut y] = [width, height].map(|side| Walk::new((0.0, (side - size) as f64), DRIFT, &mut rng));
    let mut focus = Walk::starting(0.5, FOCUS_RANGE, FOCUS, &mut rng);
    let mut corners = Vec::with_capacity(poses);
    let mut optima = Vec::with_capacity(poses);

    for _ in 0..poses {
        corners.push((x.position() as usize, y.position() as usize));
        optima.push(focus.position());
        for walk in [&mut x, &mut y, &mut focus] {
            walk.advance(&mut rng);
        }
    }

    let sharpest: Vec<f64> = corners.iter().map(|&corner| sharpest(stack, corner, size) as f64).collect();
    let followed = smoothed(&sharpest, SMOOTHING);

    let window = |((&(left, top), optimum), at): ((&(usize, usize), &f64), &f64)| {
        let first = (at - optimum * (planes - 1) as f64).round().clamp(0.0, (of - planes) as f64);
        Window { left, top, plane: first as usize }
    };

    Ok(corners.iter().zip(&optima).zip(&followed).map(window).collect())
}

/// Stores the scan that `cut` makes of `stack` in `out`, or continues it. `progress` is called after
/// each pose.
///
/// # Errors
/// If the stack is too small, or `out` holds another scan or cannot be written.
pub fn from_stack(stack: &FocalStack, cut: &Cut, out: &Path, progress: &dyn Fn()) -> Result<(), LearningError> {
    let windows = windows(stack, cut)?;
    let powers = evenly_spread(cut.planes);

    let camera =
        format!("focal stack {}, windows of {2}x{2} pixels over {1} planes", cut.name, stack.planes().len(), cut.size);
    let header = Header::new(&camera, cut.seed, cut.poses, powers.clone());

    let patch = middle(cut.size);
    let mut recording = ScanRecording::open(out, &header)?;

    for (pose, window) in (1..).zip(windows) {
        if !recording.folder().poses().contains_key(&pose) {
            let planes = &stack.planes()[window.plane..window.plane + cut.planes];
            let pictures = planes
                .iter()
                .map(|plane| cropped(&plane.picture, (window.left, window.top), (cut.size, cut.size)))
                .collect();
            recording.store(&shot(pose, &powers, PosePictures { pictures, patch, truth: None }))?;
        }
        progress();
    }

    Ok(())
}

fn middle(size: usize) -> PatchArea {
    let corner = (size - PATCH_SIDE) / 2;
    PatchArea { x: corner, y: corner, width: PATCH_SIDE, height: PATCH_SIDE }
}

/// The plane in which the patch in the middle of the window at `corner` has the greatest mean gradient magnitude.
fn sharpest(stack: &FocalStack, corner: (usize, usize), size: usize) -> usize {
    let area = middle(size);
    let area = PatchArea { x: corner.0 + area.x, y: corner.1 + area.y, ..area };
    let metric = |index: &usize| mgm(&patch_at(&stack.planes()[*index].picture, area));
    (0..stack.planes().len()).max_by(|a, b| metric(a).total_cmp(&metric(b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scans::stack::Plane;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;

    fn stack(count: usize, side: usize) -> FocalStack {
        let plane = |index: usize| Plane {
            name: index.to_string(),
            position: index as f64,
            picture: gaussian_blur(&texture(8, side), 0.8 * (index as f64 - (count / 2) as f64).abs()),
        };
        FocalStack::new((0..count).map(plane).collect()).unwrap()
    }

    fn cut(planes: usize, size: usize) -> Cut {
        Cut { name: "a".to_owned(), planes, size, poses: 200, seed: 3 }
    }

    #[test]
    fn windows_stay_on_the_stack_and_the_optimum_walks() {
        let stack = stack(21, 160);
        let windows = windows(&stack, &cut(9, 96)).unwrap();
        assert!(windows.iter().all(|w| w.left <= 64 && w.top <= 64 && w.plane <= 12));

        // Plane 10 is the sharpest. The walk decides where it lies within the window.
        let optima: Vec<usize> = windows.iter().map(|w| 10usize.saturating_sub(w.plane)).collect();
        let (least, most) = (optima.iter().min().unwrap(), optima.iter().max().unwrap());
        assert!(optima.iter().all(|&o| o <= 8) && most - least >= 2, "{least} to {most}");
        assert!(windows.windows(2).all(|pair| pair[0].plane.abs_diff(pair[1].plane) <= 2));
        assert_eq!(windows, super::windows(&stack, &cut(9, 96)).unwrap());
    }

    #[test]
    fn a_cut_that_does_not_fit_is_refused() {
        let stack = stack(7, 100);
        assert!(windows(&stack, &cut(7, 96)).unwrap_err().to_string().contains("give --planes at most 6"));
        assert!(
            windows(&stack, &cut(5, 128)).unwrap_err().to_string().contains("does not fit into pictures of 100x100")
        );
    }

    #[test]
    fn smoothing_keeps_what_is_even_and_mirrors_at_the_ends() {
        assert!(smoothed(&[3.0; 5], SMOOTHING).iter().all(|value| (value - 3.0).abs() < 1e-12));
        let step: Vec<f64> = (0..200).map(|index| f64::from(u8::from(index >= 100))).collect();
        let found = smoothed(&step, SMOOTHING);
        assert!((found[99] + found[100] - 1.0).abs() < 1e-9 && found[0] < 1e-9 && found[199] > 1.0 - 1e-9);
    }
}
