//! What the whole view tells of focus, tile by tile: how sharp it is, and how its blur changed since earlier frames.
//!
//! The patch holds little detail. Where everything in view lies at one distance, all of the view tells of the same
//! optimum. Where it does not, its tiles change differently, and the network can tell the two apart.

use std::collections::VecDeque;
use std::ops::Range;

use multiversion::multiversion;

use crate::bisection::motion::ViewTransform;
use crate::registration::{FLOOR, LAGS, log_ratio};
use parfocal_imaging::{PATCH_SIDE, Surroundings};

/// Pixels along each side of the view.
const SIDE: usize = Surroundings::SIDE;
/// Pixels along each side of a tile.
const TILE: usize = 16;
/// Tiles along each side of the view.
const ACROSS: usize = SIDE / TILE;
const TILES: usize = ACROSS * ACROSS;
const BANDS: usize = LAGS.len();
/// So many pixels at the ends of a picture have no second difference at the longest lag.
const EDGE: usize = LAGS[BANDS - 1];
/// Rows of a band's [`ColumnSums`]: one more than there are rows of pixels with second differences at all lags.
const SUMS: usize = SIDE - 2 * EDGE + 1;
/// How many frames ago the frames are that a new one is compared with.
const AGO: [usize; 4] = [1, 2, 4, 8];
const LONGEST: usize = AGO[AGO.len() - 1];
/// A tile is near the patch if its centre is at most so many pixels from the patch's centre along both axes.
const NEAR: usize = 40;
/// Least share of the tiles that both frames must show.
const LEAST_SHARED: f32 = 0.1;

/// Inputs from the frame by itself: energies of the patch, of the tiles near it, of all tiles, their deviation from
/// tile to tile, the change of those of all tiles, and whether there is such a view.
const BY_ITSELF: usize = 5 * BANDS + 1;
/// Inputs from one comparison: changes of the patch, of the tiles near it, of all tiles, their deviation from tile to
/// tile; how far the motion stands out, the difference of focal power, and the share of tiles in both frames.
const COMPARED: usize = 4 * BANDS + 3;
/// Length of the result of [`ViewTrace::see`].
pub const VIEW_INPUT: usize = BY_ITSELF + AGO.len() * COMPARED;

/// Place of the difference of focal power among the inputs from one comparison.
const MOVED: usize = 4 * BANDS + 1;

/// Mean squares of the second differences, down and along together, at each of [`LAGS`]; or a function of them.
type Bands = [f32; BANDS];

/// Energies of each tile, row after row; `None` for a tile that is not wholly seen.
type Tiles = Vec<Option<Bands>>;

/// An earlier frame.
#[derive(Debug, Clone)]
struct Earlier {
    energies: ColumnSums,
    focal_power: f32,
    /// How far the scene moved from the frame before to this one (right, down), in pixels.
    motion: (isize, isize),
    /// How far the peak of that motion stands out ([`ViewTransform::registered_to`]).
    stands_out: f32,
}

/// The latest frames' views.
#[derive(Debug, Clone, Default)]
pub struct ViewTrace {
    /// The latest first, one more than the [`LONGEST`] comparison needs.
    earlier: VecDeque<Earlier>,
    latest: Option<Box<ViewTransform>>,
    /// The logarithms of all tiles' energies in the latest frame.
    sharpness: Option<Bands>,
}

impl ViewTrace {
    /// Takes in a frame at `focal_power`, and returns what the network gets of it, each number of the order of 1. All
    /// are 0 where there are no surroundings, as in a picture that is too small.
    pub fn see(&mut self, surroundings: Option<&Surroundings>, focal_power: f32) -> [f32; VIEW_INPUT] {
        let mut input = [0.0; VIEW_INPUT];
        let Some(surroundings) = surroundings else {
            *self = Self::default();
            return input;
        };

        let transform = ViewTransform::of(&surroundings.levels);
        let registered = self.latest.as_ref().map(|latest| latest.registered_to(&transform));
        let (motion, stands_out) = registered.unwrap_or_default();
        // A frame that is too long ago to be compared with leaves its memory to the new one.
        let spent = if self.earlier.len() > LONGEST { self.earlier.pop_back() } else { None };
        let now = Now::of(surroundings, spent.map(|earlier| earlier.energies));

        let (by_itself, compared) = input.split_at_mut(BY_ITSELF);
        self.describe(&now, by_itself);

        // Motions from frame to frame add up to those over several frames. They are as sure as the least sure of them.
        let mut moved = motion;
        let mut least = stands_out;
        for (index, earlier) in self.earlier.iter().enumerate() {
            if let Some(which) = AGO.iter().position(|&ago| ago == index + 1) {
                let part = &mut compared[which * COMPARED..][..COMPARED];
                now.compare(earlier, moved, part);
                part[4 * BANDS] = ((least - 7.0) / 5.0).clamp(-2.0, 3.0);
                part[MOVED] = 10.0 * (focal_power - earlier.focal_power);
            }
            moved = (moved.0 + earlier.motion.0, moved.1 + earlier.motion.1);
            least = least.min(earlier.stands_out);
        }

        self.earlier.push_front(Earlier { energies: now.energies, focal_power, motion, stands_out });
        self.latest = Some(Box::new(transform));
        input
    }

    /// Writes to `input` what a frame shows by itself.
    fn describe(&mut self, now: &Now, input: &mut [f32]) {
        let logarithms: Vec<Bands> = now.tiles.iter().flatten().map(|energies| energies.map(logarithm)).collect();
        let (mean, deviation) = moments(&logarithms);
        let before = self.sharpness.replace(mean).unwrap_or(mean);
        let change = std::array::from_fn(|band| 4.0 * (mean[band] - before[band]));

        let patch = seen_window(now.patch, (0, 0)).map_or([0.0; BANDS], |(x, y)| now.energies.mean(&x, &y));
        let near = pooled(&now.tiles, &now.near);
        write(input, &[patch.map(logarithm), near.map(logarithm), mean, deviation, change]);
        input[5 * BANDS] = 1.0;
    }
}

/// The frame that is compared with earlier ones.
struct Now {
    energies: ColumnSums,
    /// Column and row of the patch's upper left pixel in the view.
    patch: (usize, usize),
    tiles: Tiles,
    /// Which tiles are near the patch.
    near: Vec<bool>,
}

impl Now {
    fn of(surroundings: &Surroundings, spent: Option<ColumnSums>) -> Self {
        let Surroundings { levels, patch } = surroundings;
        let centre = |tile: usize| tile * TILE + TILE / 2;
        let is_near = |tile: usize, corner: usize| centre(tile).abs_diff(corner + PATCH_SIDE / 2) <= NEAR;
        let near = (0..TILES).map(|tile| is_near(tile % ACROSS, patch.0) && is_near(tile / ACROSS, patch.1));
        let energies = ColumnSums::of(levels, spent);
        let tiles = energies.tiles((0, 0), &(0..SIDE), &(0..SIDE));
        Self { energies, patch: *patch, tiles, near: near.collect() }
    }

    /// Writes to `input` how blur changed since the frame `before`, from where the scene has `moved` (right, down).
    fn compare(&self, before: &Earlier, moved: (isize, isize), input: &mut [f32]) {
        // Columns and rows that the frame before shows, too.
        let shared = |by: isize| by.max(0) as usize..(SIDE as isize + by.min(0)).max(0) as usize;
        let (columns, rows) = (shared(moved.0), shared(moved.1));
        if columns.len() <= 2 * EDGE || rows.len() <= 2 * EDGE {
            return;
        }

        // The whole patch, beside the same piece of the scene.
        let patch = seen_window(self.patch, moved).map_or([0.0; BANDS], |(x, y)| {
            let then = before.energies.mean(&carried_back(&x, moved.0), &carried_back(&y, moved.1));
            change(&self.energies.mean(&x, &y), &then)
        });
        write(input, &[patch]);

        let then = before.energies.tiles(moved, &columns, &rows);
        let pairs: Vec<Option<(Bands, Bands)>> =
            self.tiles.iter().zip(&then).map(|(now, then)| Some(((*now)?, (*then)?))).collect();
        let share = pairs.iter().flatten().count() as f32 / TILES as f32;
        input[4 * BANDS + 2] = share;
        if share < LEAST_SHARED {
            return;
        }

        let both: Vec<bool> = self.near.iter().zip(&pairs).map(|(near, pair)| *near && pair.is_some()).collect();
        let near = change(&pooled(&self.tiles, &both), &pooled(&then, &both));
        let changes: Vec<Bands> = pairs.iter().flatten().map(|(now, then)| change(now, then)).collect();
        let (mean, deviation) = moments(&changes);
        write(&mut input[BANDS..], &[near, mean, deviation]);
    }
}

/// Makes of what [`ViewTrace::see`] returned what it would have returned if focal powers were counted from the other
/// end of the lens's range.
pub fn count_from_other_end(input: &mut [f32]) {
    for part in input[BY_ITSELF..].chunks_exact_mut(COMPARED) {
        part[MOVED] = -part[MOVED];
    }
}

fn write(input: &mut [f32], values: &[Bands]) {
    input[..values.len() * BANDS].copy_from_slice(values.as_flattened());
}

fn logarithm(energy: f32) -> f32 {
    0.5 * ((energy + FLOOR).ln() - 3.0)
}

/// How each band changed since `then`.
fn change(now: &Bands, then: &Bands) -> Bands {
    std::array::from_fn(|band| log_ratio(now[band], then[band]))
}

/// Mean and standard deviation of each band; zeros of nothing.
fn moments(values: &[Bands]) -> (Bands, Bands) {
    let count = values.len().max(1) as f32;
    let mean: Bands = std::array::from_fn(|band| values.iter().map(|value| value[band]).sum::<f32>() / count);
    let variance = |band: usize| values.iter().map(|value| (value[band] - mean[band]).powi(2)).sum::<f32>() / count;
    (mean, std::array::from_fn(|band| variance(band).sqrt()))
}

/// The mean energies of the tiles that are seen and in `which`; zeros if there are none.
fn pooled(tiles: &Tiles, which: &[bool]) -> Bands {
    let mut sum = [0.0; BANDS];
    let mut count = 0.0f32;
    for energies in tiles.iter().zip(which).filter_map(|(energies, is_in)| energies.filter(|_| *is_in)) {
        count += 1.0;
        for (sum, energy) in sum.iter_mut().zip(energies) {
            *sum += energy;
        }
    }
    sum.map(|sum| sum / count.max(1.0))
}

/// The columns and rows of the patch at `patch` whose second differences are known, both now and before the scene
/// `moved`; `None` if hardly anything of it is left.
fn seen_window(patch: (usize, usize), moved: (isize, isize)) -> Option<(Range<usize>, Range<usize>)> {
    let axis = |corner: usize, by: isize| {
        let low = corner.max(EDGE + by.max(0) as usize);
        let high = (corner + PATCH_SIDE).min((SIDE - EDGE).saturating_sub((-by).max(0) as usize));
        low..high
    };
    let (x, y) = (axis(patch.0, moved.0), axis(patch.1, moved.1));
    (x.len() >= PATCH_SIDE / 4 && y.len() >= PATCH_SIDE / 4).then_some((x, y))
}

/// Energies of a view, summed down its columns, so that those of any rectangle take two rows of them. There are
/// [`SUMS`] rows for each band, one band after another: row `y` of them is the sum of the first `y` rows of pixels,
/// beginning [`EDGE`] pixels from the view's upper end.
#[derive(Debug, Clone)]
struct ColumnSums(Box<[[f32; SIDE]]>);

impl ColumnSums {
    /// The energies of a view's `levels`, in the memory of one that is no longer needed, if there is one.
    fn of(levels: &[f32], spent: Option<Self>) -> Self {
        let mut sums = spent.unwrap_or_else(|| Self(vec![[0.0; SIDE]; BANDS * SUMS].into()));
        add_up(levels, &mut sums.0);
        sums
    }

    /// Mean energies in the columns `x` and rows `y`, which lie [`EDGE`] pixels or more from the view's ends.
    fn mean(&self, x: &Range<usize>, y: &Range<usize>) -> Bands {
        let pixels = (x.len() * y.len()).max(1) as f32;
        std::array::from_fn(|band| {
            let line = |row: usize| &self.0[band * SUMS + row - EDGE][x.clone()];
            difference(line(y.start), line(y.end)) / pixels
        })
    }

    /// Energies of the tiles that lie [`EDGE`] pixels or more within `columns` and `rows` of a view before which the
    /// scene `moved`, so that this one shows them elsewhere.
    fn tiles(&self, moved: (isize, isize), columns: &Range<usize>, rows: &Range<usize>) -> Tiles {
        let place = |tile: usize, seen: &Range<usize>, by: isize| {
            let tile = tile * TILE..(tile + 1) * TILE;
            (tile.start >= seen.start + EDGE && tile.end + EDGE <= seen.end).then(|| carried_back(&tile, by))
        };
        let tile = |tile: usize| {
            let x = place(tile % ACROSS, columns, moved.0)?;
            let y = place(tile / ACROSS, rows, moved.1)?;
            Some(self.mean(&x, &y))
        };
        (0..TILES).map(tile).collect()
    }
}

/// Where the pixels `place` of an axis were before they moved `by`.
const fn carried_back(place: &Range<usize>, by: isize) -> Range<usize> {
    place.start.wrapping_add_signed(-by)..place.end.wrapping_add_signed(-by)
}

/// Writes to `sums` the energies of a view's `levels` at each lag, as [`ColumnSums`] keeps them.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn add_up(levels: &[f32], sums: &mut [[f32; SIDE]]) {
    let rows = levels.as_chunks::<SIDE>().0;
    for (sums, lag) in sums.chunks_exact_mut(SUMS).zip(LAGS) {
        for y in EDGE..SIDE - EDGE {
            let (above, here, below) = (&rows[y - lag], &rows[y], &rows[y + lag]);
            let (before, after) = sums[y - EDGE..].split_at_mut(1);
            let (before, after) = (&before[0], &mut after[0]);
            for x in EDGE..SIDE - EDGE {
                let down = above[x] - 2.0 * here[x] + below[x];
                let along = here[x - lag] - 2.0 * here[x] + here[x + lag];
                after[x] = before[x] + down * down + along * along;
            }
        }
    }
}

/// The sum of `after` less that of `before`, which is as long.
fn difference(before: &[f32], after: &[f32]) -> f32 {
    const LANES: usize = 8;

    let mut sums = [0.0f32; LANES];
    let (before, before_rest) = before.as_chunks::<LANES>();
    let (after, after_rest) = after.as_chunks::<LANES>();
    for (before, after) in before.iter().zip(after) {
        for lane in 0..LANES {
            sums[lane] += after[lane] - before[lane];
        }
    }

    let rest: f32 = before_rest.iter().zip(after_rest).map(|(before, after)| after - before).sum();
    rest + sums.iter().sum::<f32>()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::GrayImage;

    const SCENE: usize = 300;

    /// What is seen of `scene` from `(x, y)` on, with the patch in its middle.
    fn seen(scene: &GrayImage, (x, y): (usize, usize)) -> Surroundings {
        let level = |i: usize| scene.data[(y + i / SIDE) * scene.width + x + i % SIDE].round();
        Surroundings { levels: (0..SIDE * SIDE).map(level).collect(), patch: (48, 48) }
    }

    /// The inputs from the comparison with the frame so many frames ago.
    fn compared(input: &[f32; VIEW_INPUT], ago: usize) -> &[f32] {
        let which = AGO.iter().position(|&frames| frames == ago).unwrap();
        &input[BY_ITSELF + which * COMPARED..][..COMPARED]
    }

    #[test]
    fn energies_are_those_of_a_wave() {
        // The second difference of A sin(w x) at lag l is -2 A (1 - cos(w l)) sin(w x), and the mean square of a sine
        // is 1/2. A wave along both axes has the sum of both.
        let (amplitude, rate) = (40.0, [TAU / 8.0, TAU / 16.0]);
        let wave = |i: usize| {
            let place = [i % SIDE, i / SIDE];
            let sum: f64 = place.iter().zip(rate).map(|(at, rate)| (rate * *at as f64).sin()).sum();
            (128.0 + amplitude * sum) as f32
        };
        let levels: Vec<f32> = (0..SIDE * SIDE).map(wave).collect();
        let expected = LAGS.map(|lag| {
            let along = |rate: f64| 0.5 * (2.0 * amplitude * (1.0 - (rate * lag as f64).cos())).powi(2);
            (along(rate[0]) + along(rate[1])) as f32
        });

        let alike =
            |found: &Bands| found.iter().zip(expected).all(|(found, expected)| (found / expected - 1.0).abs() < 1e-3);
        let energies = ColumnSums::of(&levels, None);
        let tiles = energies.tiles((0, 0), &(0..SIDE), &(0..SIDE));
        assert_eq!(tiles.iter().flatten().count(), (ACROSS - 2) * (ACROSS - 2), "the outermost are not wholly seen");
        assert!(tiles.iter().flatten().all(alike), "{tiles:?} {expected:?}");
        assert!(alike(&energies.mean(&(16..48), &(32..64))));
    }

    #[test]
    fn what_moves_unblurred_has_not_changed_however_long_ago() {
        let scene = texture(3, SCENE);
        let mut trace = ViewTrace::default();
        let mut input = [0.0; VIEW_INPUT];
        for frame in 0..9 {
            input = trace.see(Some(&seen(&scene, (40 + 3 * frame, 60 - 2 * frame))), 0.5);
        }

        for ago in AGO {
            let part = compared(&input, ago);
            assert!(part[..4 * BANDS].iter().all(|change| change.abs() < 1e-5), "{ago}: {part:?}");
            assert!(part[4 * BANDS] > 0.5 && part[4 * BANDS + 1] == 0.0, "{ago}: {part:?}");
            // Tiles that both frames show, of the 36 that one shows.
            let across = (2..ACROSS - 1).filter(|tile| tile * TILE < SIDE - 3 * ago - EDGE).count();
            assert!(part[4 * BANDS + 2] <= (across + 1) as f32 * 6.0 / 64.0, "{ago}: {part:?}");
        }
    }

    #[test]
    fn blur_shows_in_the_patch_near_it_and_everywhere_and_most_in_what_is_fine() {
        let sharp = texture(5, SCENE);
        let blurred = gaussian_blur(&sharp, 0.8);
        let mut trace = ViewTrace::default();
        trace.see(Some(&seen(&sharp, (60, 60))), 0.4);
        let input = trace.see(Some(&seen(&blurred, (64, 57))), 0.5);

        let part = compared(&input, 1);
        for bands in part[..3 * BANDS].chunks_exact(BANDS) {
            // Of the finest detail the scene has hardly more than the noise that is allowed for.
            assert!(bands.iter().all(|change| *change < -0.1) && bands[1..].is_sorted(), "{part:?}");
        }
        assert!((part[4 * BANDS + 1] - 1.0).abs() < 1e-6, "ten times the difference of focal power: {part:?}");
        assert!(input[4 * BANDS..5 * BANDS].iter().all(|change| *change < 0.0), "the frame's own energies fell");
    }

    #[test]
    fn where_half_of_the_view_is_blurred_tiles_differ() {
        let sharp = texture(6, SCENE);
        let blurred = gaussian_blur(&sharp, 1.5);
        let mut half = sharp.clone();
        for (i, level) in half.data.iter_mut().enumerate().filter(|(i, _)| i % SCENE < 60 + SIDE / 2) {
            *level = blurred.data[i];
        }

        let deviation = |now: &GrayImage| {
            let mut trace = ViewTrace::default();
            trace.see(Some(&seen(&sharp, (60, 60))), 0.5);
            compared(&trace.see(Some(&seen(now, (60, 60))), 0.5), 1)[3 * BANDS]
        };
        assert!(deviation(&half) > 3.0 * deviation(&blurred), "{} {}", deviation(&half), deviation(&blurred));
    }

    #[test]
    fn without_surroundings_nothing_is_told_and_nothing_remembered() {
        let scene = texture(7, SCENE);
        let mut trace = ViewTrace::default();
        trace.see(Some(&seen(&scene, (60, 60))), 0.5);
        assert!(trace.see(None, 0.5).iter().all(|input| input.to_bits() == 0));
        let first = ViewTrace::default().see(Some(&seen(&scene, (61, 60))), 0.6);
        assert_eq!(trace.see(Some(&seen(&scene, (61, 60))), 0.6).map(f32::to_bits), first.map(f32::to_bits));
    }
}
