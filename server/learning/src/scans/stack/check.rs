//! Checks from the pictures alone whether they are a focal stack of one still scene.

use super::{FocalStack, Plane};
use crate::LearningError;
use parfocal_base::statistics::mean;
use parfocal_imaging::{GrayImage, reduced};

/// Side in pixels of the places whose sharpness is followed through the stack. In smaller pictures, an eighth of their
/// side.
const TILE: usize = 64;
/// A place has a peak if its greatest sharpness is at least this many times its least.
const LEAST_PEAK: f64 = 1.2;
/// Share of a curve's range by which it must fall and rise again to have another peak.
const PROMINENCE: f64 = 0.25;
/// Two pictures show different scenes if the correlation of their brightness over all places is below this. In real
/// stacks it is 0.98 or more.
const LEAST_ALIKE: f64 = 0.8;
/// Something moves where a place's brightness changes at once by more than this many gray levels, and by more than this
/// many times the usual change.
const MOVED: (f64, f64) = (15.0, 4.0);

/// Difference in the logarithm of sharpness that two pictures at the same focus may have, from noise and light.
const ALIKE_FOCUS: f64 = 0.05;
/// Where a picture is in the wrong place or missing, focus changes more than this many times as much as on either side.
const BREAK: f64 = 3.0;

/// Notes for the person who took the stack: wrong order, jumps, motion, overexposure.
///
/// # Errors
/// If the pictures are not a focal stack: no peak, another scene, the wrong order, or overexposed.
pub fn check(stack: &FocalStack) -> Result<Vec<String>, LearningError> {
    let mut notes = Vec::new();
    overexposure(stack, &mut notes)?;
    let blocks = blocks(stack);
    scenes(stack, &blocks)?;
    let curves = sharpness(stack);
    peaks_of_focus(stack, &curves, &mut notes)?;
    let mut broken = disorder(stack, &curves, &mut notes);
    for (broken, jumped) in broken.iter_mut().zip(jumps(stack, &mut notes)) {
        *broken |= jumped;
    }
    motion(stack, &blocks, &broken, &mut notes);
    Ok(notes)
}

fn overexposure(stack: &FocalStack, notes: &mut Vec<String>) -> Result<(), LearningError> {
    let saturated = |plane: &Plane| {
        let bright = plane.picture.data.iter().filter(|&&level| level >= 254.0).count();
        bright as f64 / plane.picture.data.len().max(1) as f64
    };

    let worst = stack.planes().iter().max_by(|a, b| saturated(a).total_cmp(&saturated(b)));
    let Some((name, share)) = worst.map(|plane| (&plane.name, saturated(plane))) else { return Ok(()) };

    let note = format!("{:.0} % of {name} is overexposed", 100.0 * share);
    if share > 0.3 {
        bail!("{note}, where focus cannot be judged; shorten the exposure and take it again");
    }

    if share > 0.05 {
        notes.push(note);
    }
    Ok(())
}

/// Brightness of blocks. Focus hardly changes it. Another scene changes all blocks, and something that moves changes a
/// few.
fn blocks(stack: &FocalStack) -> Vec<GrayImage> {
    let (width, height) = stack.size();
    let block = block_side(stack);
    stack.planes().iter().map(|plane| reduced(&plane.picture, width / block, height / block)).collect()
}

fn block_side(stack: &FocalStack) -> usize {
    let (width, height) = stack.size();
    (width.min(height) / 8).clamp(1, 32)
}

/// How far each block's change in brightness from one picture to the next is from the median change.
fn changes(pair: &[GrayImage]) -> Vec<f64> {
    let steps: Vec<f64> = pair[0].data.iter().zip(&pair[1].data).map(|(a, b)| f64::from(b - a)).collect();
    let usual = median(steps.clone()).unwrap_or_default();
    steps.into_iter().map(|step| (step - usual).abs()).collect()
}

fn scenes(stack: &FocalStack, blocks: &[GrayImage]) -> Result<(), LearningError> {
    for (pair, planes) in blocks.windows(2).zip(stack.planes().windows(2)) {
        // The tenth that changes most is left out: something may pass by.
        let changes = changes(pair);
        let mut sorted = changes.clone();
        sorted.sort_by(f64::total_cmp);
        let most = sorted.get(sorted.len() * 9 / 10).copied().unwrap_or(f64::INFINITY);
        let steady: Vec<usize> = (0..changes.len()).filter(|&index| changes[index] <= most).collect();
        let levels = |picture: &GrayImage| steady.iter().map(|&index| picture.data[index]).collect::<Vec<_>>();

        if correlation(&levels(&pair[0]), &levels(&pair[1])).is_some_and(|alike| alike < LEAST_ALIKE) {
            bail!(
                "{} and {} show different scenes; a focal stack is of one still scene",
                planes[0].name,
                planes[1].name
            );
        }
    }
    Ok(())
}

/// Notes what moves. Leaves out the pairs of neighbours that are `broken`, because everything changes between them.
fn motion(stack: &FocalStack, blocks: &[GrayImage], broken: &[bool], notes: &mut Vec<String>) {
    let largest = |pair: &[GrayImage]| {
        let changes = changes(pair);
        let index = best(&changes);
        (index, changes.get(index).copied().unwrap_or_default())
    };
    let largest: Vec<(usize, f64)> = blocks.windows(2).map(largest).collect();
    let usual = median(largest.iter().map(|change| change.1).collect()).unwrap_or_default();
    let side = block_side(stack);

    for ((&(index, change), planes), broken) in largest.iter().zip(stack.planes().windows(2)).zip(broken) {
        if !broken && change > MOVED.0 && change > MOVED.1 * usual {
            let x = index % blocks[0].width * side;
            let y = index / blocks[0].width * side;

            notes.push(format!("something moves at {x},{y} between {} and {}", planes[0].name, planes[1].name));
        }
    }
}

fn peaks_of_focus(stack: &FocalStack, curves: &[Vec<f64>], notes: &mut Vec<String>) -> Result<(), LearningError> {
    let ratio = |curve: &&Vec<f64>| least_and_most(curve).1 / least_and_most(curve).0.max(0.1);
    let peaked: Vec<&Vec<f64>> = curves.iter().filter(|curve| ratio(curve) >= LEAST_PEAK).collect();
    if peaked.len() * 10 < curves.len().max(1) {
        bail!(
            "the focus curve has no peak: sharpness changes by a fifth or more in only {} of {} places; \
             take a scene with texture over a wider range of focus",
            peaked.len(),
            curves.len()
        );
    }

    let count = stack.planes().len();
    let peaks = mean(&peaked.iter().map(|curve| peaks(curve) as f64).collect::<Vec<_>>());
    if peaks >= if count < 10 { 2.0 } else { 3.0 } {
        bail!(
            "sharpness rises and falls {peaks:.1} times from the first picture to the last: they are not \
             in order of focus, or not of one scene; name them so that a number gives the order, or give a --list"
        );
    }

    let at_end = |curve: &&&Vec<f64>| [0, count - 1].contains(&best(curve));
    let share = peaked.iter().filter(at_end).count() as f64 / peaked.len() as f64;
    if share > 0.7 {
        bail!(
            "the focus curve has no peak inside the stack: {:.0} % of the places are sharpest in its first \
             or last picture; take pictures beyond that",
            100.0 * share
        );
    }
    if share > 0.3 {
        notes.push(format!("{:.0} % of the places are sharpest in the first or last picture", 100.0 * share));
    }
    Ok(())
}

/// For each pair of neighbours, whether the order of focus breaks: a picture is in the wrong place, or some are
/// missing.
fn disorder(stack: &FocalStack, curves: &[Vec<f64>], notes: &mut Vec<String>) -> Vec<bool> {
    let planes = stack.planes();
    let curves: Vec<Vec<f64>> =
        curves.iter().map(|curve| curve.iter().map(|sharpness| sharpness.max(0.1).ln()).collect()).collect();
    let change = |one: usize, other: usize| {
        let differences = curves.iter().map(|curve| curve[one] - curve[other]);
        root_mean_square(differences).max(ALIKE_FOCUS)
    };

    // The neighbours of a picture in the wrong place are like each other and unlike it.
    let mut broken = vec![false; planes.len().saturating_sub(1)];
    for index in 1..planes.len().saturating_sub(1) {
        let aside = root_mean_square(curves.iter().map(|curve| stands_out(curve, index)));
        if aside > BREAK * change(index - 1, index + 1) {
            broken[index - 1..=index].fill(true);
            notes.push(format!(
                "{} is not in order of focus: the pictures before and after it are like each other and unlike it",
                planes[index].name
            ));
        }
    }

    // Where pictures are missing, focus changes more than before and after.
    for index in 1..planes.len().saturating_sub(2) {
        let beside = change(index - 1, index).max(change(index + 1, index + 2));
        let is_sound = !broken[index - 1..=index + 1].contains(&true);
        if is_sound && change(index, index + 1) > BREAK * beside {
            broken[index] = true;
            notes.push(format!(
                "focus jumps between {} and {}: pictures are missing between them, or they are not in order of focus",
                planes[index].name,
                planes[index + 1].name
            ));
        }
    }
    broken
}

/// How far a picture lies above or below both of its neighbours in a focus curve. 0 at the curve's peak, which may
/// stand out.
fn stands_out(curve: &[f64], index: usize) -> f64 {
    if best(curve) == index {
        return 0.0;
    }
    let (before, here, after) = (curve[index - 1], curve[index], curve[index + 1]);
    (here - before.max(after)).max(before.min(after) - here).max(0.0)
}

/// For each pair of neighbours, whether the whole picture jumps.
fn jumps(stack: &FocalStack, notes: &mut Vec<String>) -> Vec<bool> {
    /// Width in pixels to which pictures are reduced before their shift is measured, and the farthest shift.
    const WIDTH: usize = 240;
    const FARTHEST: isize = 4;
    let (width, height) = stack.size();
    let scale = (width / WIDTH).max(1);
    let small = |plane: &Plane| reduced(&plane.picture, width / scale, height / scale);
    let small: Vec<GrayImage> = stack.planes().iter().map(small).collect();

    let mut jumped = Vec::new();
    for (pair, planes) in small.windows(2).zip(stack.planes().windows(2)) {
        let (dx, dy) = shift(&pair[0], &pair[1], FARTHEST);
        let pixels = scale as f64 * dx.hypot(dy);
        jumped.push(dx.hypot(dy) > 1.5 && pixels > 3.0);
        if jumped.last() == Some(&true) {
            notes.push(format!(
                "the picture jumps by {pixels:.0} pixels between {} and {}",
                planes[0].name, planes[1].name
            ));
        }
    }

    jumped
}

/// The shift of `b` against `a`, in pixels, at which they differ least; at most `farthest` along each axis.
pub fn shift(a: &GrayImage, b: &GrayImage, farthest: isize) -> (f64, f64) {
    let width = a.width;
    let height = a.height;
    let reach = farthest.unsigned_abs();
    if width <= 4 * reach || height <= 4 * reach {
        return (0.0, 0.0);
    }

    let difference = |dx: isize, dy: isize| {
        let mut sum = 0.0;
        for y in reach..height - reach {
            let from = &a.data[y * width + reach..(y + 1) * width - reach];
            let start = (y.wrapping_add_signed(dy)) * width + reach.wrapping_add_signed(dx);
            let to = &b.data[start..start + from.len()];
            sum += from.iter().zip(to).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
        }
        f64::from(sum)
    };

    let places = (-farthest..=farthest).flat_map(|dy| (-farthest..=farthest).map(move |dx| (dx, dy)));
    let found = places.map(|(dx, dy)| (dx, dy, difference(dx, dy))).min_by(|a, b| a.2.total_cmp(&b.2));
    let Some((dx, dy, least)) = found else { return (0.0, 0.0) };

    let inside = |value: isize| value.abs() < farthest;
    // The vertex of the parabola through three differences.
    let vertex = |before: f64, after: f64| {
        let bend = before - 2.0 * least + after;
        if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 }
    };
    let fine_x = if inside(dx) { vertex(difference(dx - 1, dy), difference(dx + 1, dy)) } else { 0.0 };
    let fine_y = if inside(dy) { vertex(difference(dx, dy - 1), difference(dx, dy + 1)) } else { 0.0 };
    (dx as f64 + fine_x, dy as f64 + fine_y)
}

/// Mean gradient magnitude of each place in each picture: one curve for each place.
fn sharpness(stack: &FocalStack) -> Vec<Vec<f64>> {
    let (width, height) = stack.size();
    let tile = TILE.min(width.min(height) / 8).max(8);
    let across = width / tile;
    let down = height / tile;
    let mut curves = vec![Vec::with_capacity(stack.planes().len()); across * down];

    for plane in stack.planes() {
        let mut sums = vec![0.0; across * down];
        let data = &plane.picture.data;
        for y in 1..(down * tile).min(height - 1) {
            let row = |offset: usize| &data[(y + offset - 1) * width..(y + offset) * width];
            let above = row(0);
            let at = row(1);
            let below = row(2);

            for x in 1..(across * tile).min(width - 1) {
                let dx = above[x + 1] - above[x - 1] + 2.0 * (at[x + 1] - at[x - 1]) + below[x + 1] - below[x - 1];
                let dy = below[x - 1] - above[x - 1] + 2.0 * (below[x] - above[x]) + below[x + 1] - above[x + 1];
                sums[y / tile * across + x / tile] += f64::from(dx.hypot(dy));
            }
        }
        curves.iter_mut().zip(sums).for_each(|(curve, sum)| curve.push(sum / (tile * tile) as f64));
    }
    curves
}

/// The least and the greatest value of a curve.
pub(super) fn least_and_most(curve: &[f64]) -> (f64, f64) {
    curve.iter().fold((f64::INFINITY, 0.0), |(least, most), &value| (f64::min(least, value), f64::max(most, value)))
}

/// Where a curve is greatest.
pub(super) fn best(curve: &[f64]) -> usize {
    (0..curve.len()).max_by(|&a, &b| curve[a].total_cmp(&curve[b])).unwrap_or(0)
}

/// How often a curve rises to a peak, by at least [`PROMINENCE`] of its range.
fn peaks(curve: &[f64]) -> usize {
    let (least, most) = least_and_most(curve);
    let enough = PROMINENCE * (most - least);
    let mut rising = true;
    let mut extreme = f64::NEG_INFINITY;
    let mut count = 0;

    for &value in curve {
        if rising {
            extreme = extreme.max(value);
            if value < extreme - enough {
                count += 1;
                (rising, extreme) = (false, value);
            }
        } else {
            extreme = extreme.min(value);
            if value > extreme + enough {
                (rising, extreme) = (true, value);
            }
        }
    }

    count + usize::from(rising)
}

/// The median; `None` if there are no values.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Correlation of two pictures; `None` if one hardly varies.
fn correlation(a: &[f32], b: &[f32]) -> Option<f64> {
    let [a, b] = [a, b].map(|values| values.iter().map(|&value| f64::from(value)).collect::<Vec<f64>>());
    let mean_a = mean(&a);
    let mean_b = mean(&b);

    let products: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (a - mean_a) * (b - mean_b)).collect();
    let variance = |values: &[f64], centre: f64| mean(&values.iter().map(|v| (v - centre).powi(2)).collect::<Vec<_>>());
    let variance_a = variance(&a, mean_a);
    let variance_b = variance(&b, mean_b);

    (variance_a > 4.0 && variance_b > 4.0).then(|| mean(&products) / (variance_a * variance_b).sqrt())
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    mean(&values.map(|value| value.powi(2)).collect::<Vec<_>>()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;

    const SIDE: usize = 160;

    /// `count` pictures of a texture, sharpest in the middle, each changed by `change`.
    fn stack(count: usize, change: impl Fn(usize, GrayImage) -> GrayImage) -> FocalStack {
        let sigma = |index: usize| 1.2 * (index as f64 - (count / 2) as f64).abs();
        blurred_by((0..count).map(sigma), change)
    }

    /// Pictures of a texture, each blurred by one of `sigmas` and changed by `change`.
    fn blurred_by(sigmas: impl Iterator<Item = f64>, change: impl Fn(usize, GrayImage) -> GrayImage) -> FocalStack {
        let plane = |(index, sigma): (usize, f64)| {
            let picture = gaussian_blur(&texture(8, SIDE), sigma);
            Plane { name: format!("{index:02}.png"), position: index as f64, picture: change(index, picture) }
        };
        FocalStack::new(sigmas.enumerate().map(plane).collect()).unwrap()
    }

    fn refused(stack: &FocalStack) -> String {
        check(stack).unwrap_err().to_string()
    }

    #[test]
    fn a_sound_stack_gets_no_notes() {
        assert_eq!(check(&stack(11, |_, picture| picture)).unwrap(), Vec::<String>::new());
    }

    #[test]
    fn pictures_that_are_not_a_stack_are_rejected() {
        let sharp = |_, _| texture(8, SIDE);
        assert!(refused(&stack(11, sharp)).contains("no peak"));
        let one_side = stack(21, |_, picture| picture).planes()[10..].to_vec();
        assert!(refused(&FocalStack::new(one_side).unwrap()).contains("no peak inside the stack"));
        let other = |index, picture| if index < 6 { picture } else { gaussian_blur(&texture(9, SIDE), 2.0) };
        assert!(refused(&stack(11, other)).contains("05.png and 06.png show different scenes"));
        let white = |_, mut picture: GrayImage| {
            picture.data.iter_mut().for_each(|level| *level = (4.0 * *level).min(255.0));
            picture
        };
        assert!(refused(&stack(11, white)).contains("is overexposed"));

        let mut shuffled = stack(11, |_, picture| picture).planes().to_vec();
        for (position, index) in [5, 0, 6, 1, 7, 2, 8, 3, 9, 4, 10].into_iter().enumerate() {
            shuffled[index].position = position as f64;
        }
        assert!(refused(&FocalStack::new(shuffled).unwrap()).contains("not in order of focus"));
    }

    #[test]
    fn pictures_out_of_order_are_noted() {
        let mut planes = stack(21, |_, picture| picture).planes().to_vec();
        planes[12].position = 2.5;
        let notes = check(&FocalStack::new(planes).unwrap()).unwrap();
        assert!(notes.len() == 1 && notes[0].starts_with("12.png is not in order of focus"), "{notes:?}");

        // Pictures with blur from 3.8 to 1.8 pixels are missing.
        let sigmas = [4.4, 4.2, 4.0].into_iter().chain((0..17_i32).map(|step| 0.2 * f64::from((8 - step).abs())));
        let notes = check(&blurred_by(sigmas, |_, picture| picture)).unwrap();
        assert!(notes.len() == 1 && notes[0].starts_with("focus jumps between 02.png and 03.png"), "{notes:?}");
    }

    #[test]
    fn a_jump_and_something_that_moves_are_noted() {
        let jumped = |index, picture: GrayImage| {
            let mut moved = picture.clone();
            if index > 6 {
                moved.data.rotate_left(4 * SIDE + 3);
            }
            moved
        };
        assert_eq!(check(&stack(11, jumped)).unwrap(), ["the picture jumps by 5 pixels between 06.png and 07.png"]);

        let passing = |index, mut picture: GrayImage| {
            for y in 40..60 {
                let level = if index < 4 { 20.0 } else { 200.0 };
                picture.data[y * SIDE + 80..y * SIDE + 100].fill(level);
            }
            picture
        };
        let notes = check(&stack(11, passing)).unwrap();
        assert!(notes.iter().any(|note| note.contains("moves at 80,40 between 03.png and 04.png")), "{notes:?}");
    }
}
