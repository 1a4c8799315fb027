//! Focal stacks in memory: one scene at several positions of the focal plane, and where each patch of it is sharpest.

use multiversion::multiversion;
use sha2::{Digest, Sha256};

use crate::LearningError;
use parfocal_imaging::{GrayImage, PATCH_SIDE, Patch, Square, View};

/// Pixels between two neighbouring places at which the sharpest position is known.
const STRIDE: usize = 4;

/// A scene's pictures in order of focus, 8 bits a pixel, and the position at which each patch of it is sharpest.
///
/// A position says where the focal plane lies: in pixels of blur for simulated scenes, in planes for photographed ones.
#[derive(Debug, Clone)]
pub struct PlaneStack {
    width: usize,
    height: usize,
    /// Where the focal plane lay for each picture, rising.
    positions: Vec<f32>,
    planes: Vec<Box<[u8]>>,
    /// The mean gradient magnitude over all positions, for each of the patches whose corners lie [`STRIDE`] pixels
    /// apart, row after row.
    curves: Vec<f32>,
    /// Where each of these curves peaks.
    sharpest: Vec<f32>,
}

impl PlaneStack {
    /// A stack of `pictures`, each with the position of its focal plane. Positions must rise. Gray levels beyond
    /// 0..=255 are clipped.
    ///
    /// # Errors
    /// If there are fewer than three pictures, positions do not rise, sizes differ, or pictures are smaller than 64x64
    /// pixels.
    pub fn new(pictures: &[(f32, GrayImage)]) -> Result<Self, LearningError> {
        let too_few = || {
            let count = pictures.len();
            LearningError::new(format!("a focal stack needs at least 3 pictures at rising positions, but has {count}"))
        };
        let (Some((_, first)), 3..) = (pictures.first(), pictures.len()) else { return Err(too_few()) };
        let width = first.width;
        let height = first.height;
        if width < 64 || height < 64 {
            bail!("the pictures of the focal stack need at least 64x64 pixels, but have {width}x{height}");
        }
        if let Some(index) = pictures.iter().position(|(_, picture)| (picture.width, picture.height) != (width, height))
        {
            let number = index + 1;
            bail!("picture {number} of the focal stack differs in size from the first");
        }
        if !pictures.is_sorted_by(|a, b| a.0 < b.0) {
            return Err(too_few());
        }

        let positions: Vec<f32> = pictures.iter().map(|picture| picture.0).collect();
        let sharpness: Vec<Vec<f32>> = pictures.iter().map(|(_, picture)| sharpness(picture)).collect();
        let corners = 0..sharpness[0].len();
        let curves: Vec<f32> = corners.flat_map(|place| sharpness.iter().map(move |plane| plane[place])).collect();
        let sharpest = curves.chunks_exact(positions.len()).map(|curve| peak(&positions, curve)).collect();

        let bytes = |picture: &GrayImage| picture.data.iter().map(|value| value.round() as u8).collect();
        let planes = pictures.iter().map(|(_, picture)| bytes(picture)).collect();

        Ok(Self { width, height, positions, planes, curves, sharpest })
    }

    /// Adds everything that can be seen to `hash`.
    pub(crate) fn digest(&self, hash: &mut Sha256) {
        hash.update((self.width as u64).to_le_bytes());
        for (position, plane) in self.positions.iter().zip(&self.planes) {
            hash.update(position.to_le_bytes());
            hash.update(plane);
        }
    }

    /// Width and height in pixels.
    pub const fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// First and last position.
    pub fn range(&self) -> (f64, f64) {
        (f64::from(self.positions[0]), f64::from(self.positions[self.positions.len() - 1]))
    }

    /// The position at which the patch with its corner at `(x, y)` is sharpest: where its mean
    /// gradient magnitude peaks, refined by a parabola through the peak and its neighbours.
    pub fn sharpest(&self, corner: (usize, usize)) -> f64 {
        f64::from(self.sharpest[self.place(corner)])
    }

    /// As [`PlaneStack::sharpest`], but only among the positions from `low` to `high`. A patch that holds several
    /// depths has several peaks, and the highest may lie outside.
    pub fn sharpest_within(&self, corner: (usize, usize), (low, high): (f64, f64)) -> f64 {
        let sharpest = self.sharpest(corner);
        if (low..=high).contains(&sharpest) {
            return sharpest;
        }

        let count = self.positions.len();
        let place = self.place(corner);
        let curve = &self.curves[place * count..][..count];
        let first = self.positions.partition_point(|&at| f64::from(at) <= low);
        let end = self.positions.partition_point(|&at| f64::from(at) < high).max(first);

        // The curve over the whole range. At its ends pictures are mixed, and so is their sharpness.
        let inner = self.positions[first..end].iter().copied().zip(curve[first..end].iter().copied());
        let ends = [low, high].map(|at| (at as f32, mixed_at(&self.positions, curve, at as f32)));
        let (positions, curve): (Vec<f32>, Vec<f32>) = [ends[0]].into_iter().chain(inner).chain([ends[1]]).unzip();
        f64::from(peak(&positions, &curve)).clamp(low, high)
    }

    /// The index of the patch at `corner` among those whose sharpness is known.
    fn place(&self, (x, y): (usize, usize)) -> usize {
        let (columns, rows) = grid(self.width, self.height);
        let column = ((x + STRIDE / 2) / STRIDE).min(columns - 1);
        let row = ((y + STRIDE / 2) / STRIDE).min(rows - 1);
        row * columns + column
    }

    /// The patch with its corner at `corner` and the focal plane at `position`: a mix of the two pictures around that
    /// position. Beyond the first or last picture, that picture. If `corner` is too close to the border or beyond it,
    /// the nearest patch inside.
    pub fn patch(&self, corner: (usize, usize), position: f64) -> Patch {
        let (x, y) = self.inside(corner);
        let mut patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        self.mix(Square { x, y, side: PATCH_SIDE }, position, &mut patch.0);
        patch
    }

    /// What a policy sees, with [`PlaneStack::patch`] as the patch.
    pub fn view(&self, corner: (usize, usize), position: f64) -> View {
        let corner = self.inside(corner);
        View::around(self.patch(corner, position), corner, self.size(), |square| {
            let mut levels = vec![0.0; square.side * square.side];
            self.mix(square, position, &mut levels);
            levels
        })
    }

    fn inside(&self, (x, y): (usize, usize)) -> (usize, usize) {
        (x.min(self.width - PATCH_SIDE), y.min(self.height - PATCH_SIDE))
    }

    /// Fills `out` with what lies within `square`, with the focal plane at `position`.
    fn mix(&self, square: Square, position: f64, out: &mut [f32]) {
        let position = position as f32;
        let last = self.positions.len() - 1;
        let above = self.positions.partition_point(|&at| at <= position).clamp(1, last);
        let low = self.positions[above - 1];
        let high = self.positions[above];
        let share = ((position - low) / (high - low)).clamp(0.0, 1.0);
        mix(&self.planes[above - 1], &self.planes[above], share, self.width, square, out);
    }
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn mix(low: &[u8], high: &[u8], share: f32, width: usize, Square { x, y, side }: Square, out: &mut [f32]) {
    for (row, line) in out.chunks_exact_mut(side).enumerate() {
        let from = (y + row) * width + x;
        let pairs = low[from..from + side].iter().zip(&high[from..from + side]);
        for (value, (&low, &high)) in line.iter_mut().zip(pairs) {
            let low = f32::from(low);
            *value = low + share * (f32::from(high) - low);
        }
    }
}

/// Columns and rows of patches whose corners lie [`STRIDE`] pixels apart.
const fn grid(width: usize, height: usize) -> (usize, usize) {
    ((width - PATCH_SIDE) / STRIDE + 1, (height - PATCH_SIDE) / STRIDE + 1)
}

/// The mean gradient magnitude of each patch of the [`grid`], row after row.
fn sharpness(picture: &GrayImage) -> Vec<f32> {
    let magnitudes = gradient_magnitudes(picture);
    let width = picture.width;
    let height = picture.height;
    let (columns, rows) = grid(width, height);

    // Sums over the columns of each patch first, then over its rows.
    let mut across = vec![0.0f32; columns * height];
    for (line, sums) in magnitudes.chunks_exact(width).zip(across.chunks_exact_mut(columns)) {
        let blocks: Vec<f32> = line.chunks(STRIDE).map(|block| block.iter().sum()).collect();
        for (column, sum) in sums.iter_mut().enumerate() {
            *sum = blocks[column..column + PATCH_SIDE / STRIDE].iter().sum();
        }
    }

    let mut out = vec![0.0f32; columns * rows];
    for (row, sums) in out.chunks_exact_mut(columns).enumerate() {
        for line in across.chunks_exact(columns).skip(row * STRIDE).take(PATCH_SIDE) {
            sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += value);
        }
    }

    out
}

/// The length of the 3x3 Sobel gradient at each pixel; borders replicate.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn gradient_magnitudes(picture: &GrayImage) -> Vec<f32> {
    let width = picture.width;
    let height = picture.height;
    let mut out = vec![0.0f32; width * height];
    let line = |y: usize| &picture.data[y * width..][..width];
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        let above = line(y.saturating_sub(1));
        let here = line(y);
        let below = line((y + 1).min(height - 1));

        for x in 1..width - 1 {
            let left = above[x - 1] + 2.0 * here[x - 1] + below[x - 1];
            let right = above[x + 1] + 2.0 * here[x + 1] + below[x + 1];
            let up = above[x - 1] + 2.0 * above[x] + above[x + 1];
            let down = below[x - 1] + 2.0 * below[x] + below[x + 1];
            out[x] = ((right - left).powi(2) + (down - up).powi(2)).sqrt();
        }

        out[0] = out[1];
        out[width - 1] = out[width - 2];
    }

    out
}

/// The value of `curve` (over `positions`) at `position`, interpolated linearly.
fn mixed_at(positions: &[f32], curve: &[f32], position: f32) -> f32 {
    let above = positions.partition_point(|&at| at <= position).clamp(1, positions.len() - 1);
    let low = positions[above - 1];
    let share = ((position - low) / (positions[above] - low)).clamp(0.0, 1.0);
    curve[above - 1] + share * (curve[above] - curve[above - 1])
}

/// Where `curve` (over `positions`) peaks: at the vertex of the parabola through its greatest value and the two
/// neighbours.
fn peak(positions: &[f32], curve: &[f32]) -> f32 {
    let top = (0..curve.len()).max_by(|&a, &b| curve[a].total_cmp(&curve[b])).unwrap_or(0);
    if top == 0 || top + 1 == curve.len() {
        return positions[top];
    }

    // Newton's divided differences, since positions need not be evenly spread.
    let [x0, x1, x2] = [positions[top - 1], positions[top], positions[top + 1]];
    let [y0, y1, y2] = [curve[top - 1], curve[top], curve[top + 1]];

    let first = (y1 - y0) / (x1 - x0);
    let bend = ((y2 - y1) / (x2 - x1) - first) / (x2 - x0);
    if bend >= 0.0 { x1 } else { (0.5 * (x0 + x1) - first / (2.0 * bend)).clamp(x0, x2) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::{Scale, block_means};

    #[test]
    fn a_parabola_peaks_at_its_vertex() {
        let positions = [0.0, 1.0, 2.5, 4.0, 5.0];
        let curve = positions.map(|x: f32| 7.0 - (x - 2.9).powi(2));
        assert!((peak(&positions, &curve) - 2.9).abs() < 1e-4);
        assert!((peak(&positions, &[5.0, 4.0, 3.0, 2.0, 1.0]) - 0.0).abs() < 1e-6);
    }

    /// Stripes along x, four pixels each, with amplitude `contrast` in the left half and `80 - contrast` in the right
    /// one.
    fn stripes(contrast: f32) -> GrayImage {
        let value = |i: usize| {
            let (x, contrast) = (i % 128, if i % 128 < 64 { contrast } else { 80.0 - contrast });
            128.0 + if x % 8 < 4 { contrast } else { -contrast }
        };
        GrayImage { width: 128, height: 64, data: (0..128 * 64).map(value).collect() }
    }

    #[test]
    fn each_patch_is_sharpest_where_its_gradient_is() {
        let contrasts = [10.0, 40.0, 60.0, 40.0, 10.0, 5.0];
        let pictures: Vec<_> = (0..6).map(|index| (index as f32, stripes(contrasts[index]))).collect();
        let stack = PlaneStack::new(&pictures).unwrap();
        assert!((stack.sharpest((8, 8)) - 2.0).abs() < 1e-3);
        assert!((stack.sharpest((90, 8)) - 5.0).abs() < 1e-3);
        // If the peak is out of reach, the greatest remaining value counts: an end, or another peak.
        assert!((stack.sharpest_within((8, 8), (2.5, 5.0)) - 2.5).abs() < 1e-3);
        assert!((stack.sharpest_within((8, 8), (-3.0, 1.5)) - 1.5).abs() < 1e-3);
        assert!((stack.sharpest_within((90, 8), (0.0, 3.5)) - 0.0).abs() < 1e-3);
        let mixed = stack.patch((0, 0), 0.5).0;
        assert!((mixed[0] - 153.0).abs() < 1e-4 && (mixed[4] - 103.0).abs() < 1e-4);
    }

    #[test]
    fn wider_patches_are_means_of_what_is_mixed() {
        let pictures: Vec<_> = (0..3u8).map(|index| (f32::from(index), texture(u64::from(index), 160))).collect();
        let stack = PlaneStack::new(&pictures).unwrap();
        let seen = stack.view((20, 70), 0.5);
        assert_eq!(seen.patch, stack.patch((20, 70), 0.5));
        let level = |index: usize, i: usize| pictures[index].1.data[i].round();
        let mixed: Vec<f32> = (0..160 * 160).map(|i| 0.5 * (level(0, i) + level(1, i))).collect();
        // The widest patch would begin 28 pixels to the left of the picture.
        for (patch, (scale, left, top)) in seen.wider.into_iter().zip([(Scale::Two, 4, 54), (Scale::Four, 0, 22)]) {
            let expected = block_means(&mixed[top * 160 + left..], 160, scale);
            let pairs = patch.as_ref().unwrap().0.iter().zip(&expected.0);
            assert!(pairs.into_iter().all(|(one, other)| (one - other).abs() < 1e-3), "scale {scale:?}");
        }
    }

    #[test]
    fn pictures_that_are_not_a_stack_are_rejected() {
        let picture = GrayImage { width: 64, height: 64, data: vec![0.0; 64 * 64] };
        let small = GrayImage { width: 64, height: 63, data: vec![0.0; 64 * 63] };
        let at = |position: f32, picture: &GrayImage| (position, picture.clone());
        let refused = |pictures: &[(f32, GrayImage)]| PlaneStack::new(pictures).unwrap_err().to_string();
        assert!(refused(&[at(0.0, &picture), at(1.0, &picture)]).contains("at least 3 pictures"));
        assert!(refused(&[at(0.0, &picture), at(1.0, &picture)]).ends_with("has 2"));
        assert!(refused(&[at(0.0, &picture), at(1.0, &small), at(2.0, &picture)]).contains("picture 2 of"));
        assert!(refused(&[at(0.0, &small), at(1.0, &small), at(2.0, &small)]).ends_with("have 64x63"));
    }
}
