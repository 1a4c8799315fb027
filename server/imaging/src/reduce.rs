//! Makes gray pictures smaller: each new pixel is the mean of the area that it covers.

use std::ops::Range;

use super::frame::GrayImage;

/// `picture` reduced to `width` x `height` pixels, each the mean of the area that it covers. Sides are clamped to
/// between 1 and the picture's own. If they divide the picture's sides, each pixel is the mean of a whole block.
///
/// The `image` crate cannot do this for gray levels: it clamps floating-point samples to 0..=1.
pub fn reduced(picture: &GrayImage, width: usize, height: usize) -> GrayImage {
    means(picture, &covered(picture.width, width), &covered(picture.height, height))
}

/// `picture` with the mean of each whole block of `scale` x `scale` pixels as one pixel. Pixels left over at the right
/// and below are cut off. A picture smaller than a block stays as it is.
pub fn in_blocks(picture: &GrayImage, scale: usize) -> GrayImage {
    let scale = scale.max(1);
    let width = picture.width / scale;
    let height = picture.height / scale;
    if scale == 1 || width == 0 || height == 0 {
        return picture.clone();
    }

    means(picture, &covered(width * scale, width), &covered(height * scale, height))
}

/// Fills `out` (`columns` values per row) with the means of blocks of `SCALE` x `SCALE` pixels of `levels` (`width`
/// pixels per row, beginning with the first block).
///
/// Like [`in_blocks`], but for part of a picture, and into memory of the caller. The two are separate because this one
/// makes each frame's view, and because its sums round in another order.
pub fn fill_block_means<const SCALE: usize>(levels: &[f32], width: usize, columns: usize, out: &mut [f32]) {
    const { assert!(SCALE > 0, "a block has pixels") };
    let mut sums = vec![0.0f32; columns * SCALE];
    let share = 1.0 / (SCALE * SCALE) as f32;

    for (row, out) in out.chunks_exact_mut(columns).enumerate() {
        sums.fill(0.0);
        for line in levels.chunks(width).skip(row * SCALE).take(SCALE) {
            sums.iter_mut().zip(line).for_each(|(sum, level)| *sum += level);
        }

        for (value, block) in out.iter_mut().zip(sums.as_chunks::<SCALE>().0) {
            *value = share * block.iter().sum::<f32>();
        }
    }
}

/// The picture whose pixels are the means of the parts of `picture` that `columns` and `lines` cover.
fn means(picture: &GrayImage, columns: &[Cover], lines: &[Cover]) -> GrayImage {
    let mut data = Vec::with_capacity(columns.len() * lines.len());
    let mut sum = vec![0.0; picture.width];

    for line in lines {
        sum.fill(0.0);
        for (y, weight) in line.pixels() {
            let row = &picture.data[y * picture.width..(y + 1) * picture.width];
            sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * value);
        }
        data.extend(columns.iter().map(|column| column.pixels().map(|(x, weight)| weight * sum[x]).sum::<f32>()));
    }

    GrayImage { width: columns.len(), height: lines.len(), data }
}

/// The part of a line of pixels that one pixel of the result covers.
struct Cover {
    pixels: Range<usize>,
    /// The part's beginning and end, in pixels.
    from: f64,
    to: f64,
}

impl Cover {
    /// Each covered pixel with its share in the mean.
    fn pixels(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        let length = self.to - self.from;
        self.pixels.clone().map(move |pixel| {
            let inside = (pixel as f64 + 1.0).min(self.to) - (pixel as f64).max(self.from);
            (pixel, (inside / length) as f32)
        })
    }
}

/// The parts of `length` pixels that each of `into` pixels covers.
fn covered(length: usize, into: usize) -> Vec<Cover> {
    let into = into.clamp(1, length.max(1));
    let edge = |index: usize| (index * length) as f64 / into as f64;
    (0..into)
        .map(|index| {
            let from = edge(index);
            let to = edge(index + 1);
            Cover { pixels: from.floor() as usize..(to.ceil() as usize).min(length), from, to }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gray(width: usize, height: usize, data: &[f32]) -> GrayImage {
        GrayImage::new(width, height, data.to_vec()).unwrap()
    }

    #[test]
    fn where_sides_divide_pixels_are_means_of_blocks() {
        let picture = gray(4, 2, &[10.0, 20.0, 200.0, 240.0, 30.0, 40.0, 250.0, 250.0]);
        assert_eq!(reduced(&picture, 2, 1), gray(2, 1, &[25.0, 235.0]));
        assert_eq!(reduced(&picture, 4, 2), picture);
        // A picture is never enlarged.
        assert_eq!(reduced(&picture, 9, 9), picture);
    }

    #[test]
    fn whole_blocks_become_their_means_and_the_rest_is_cut_off() {
        let picture = gray(5, 4, &std::array::from_fn::<f32, 20, _>(|v| v as f32));
        assert_eq!(in_blocks(&picture, 2), gray(2, 2, &[3.0, 5.0, 13.0, 15.0]));
        assert_eq!(in_blocks(&picture, 1), picture);
        assert_eq!(in_blocks(&picture, 6), picture);

        let mut fast = [0.0; 4];
        fill_block_means::<2>(&picture.data, 5, 2, &mut fast);
        assert_eq!(gray(2, 2, &fast), in_blocks(&picture, 2));
    }

    #[test]
    fn where_they_do_not_each_pixel_counts_by_its_share() {
        let across = reduced(&gray(3, 1, &[30.0, 60.0, 240.0]), 2, 1).data;
        let down = reduced(&gray(1, 3, &[30.0, 60.0, 240.0]), 1, 2).data;
        // (30 + 60 / 2) / 1.5 and (60 / 2 + 240) / 1.5.
        for (found, expected) in [across, down].concat().iter().zip([40.0, 180.0, 40.0, 180.0]) {
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
    }
}
