//! The encoder's arithmetic, forward and backward, one patch at a time. The values of its eight filters fill one
//! 256-bit register, and all data of a patch fit the first-level cache. libtorch, made for wide layers, cannot use
//! that.
#![allow(clippy::needless_range_loop, reason = "plain index loops of fixed length are what compiles to vector code")]

use multiversion::multiversion;

use parfocal_imaging::PATCH_SIDE;

/// Filters of each layer. Their values are neighbours in memory.
pub const FILTERS: usize = 8;
/// Weights of a filter for one input channel: 3x3, row by row.
pub const TAPS: usize = 9;
/// Pixels of a patch.
pub const PIXELS: usize = PATCH_SIDE * PATCH_SIDE;
/// One value for each filter.
pub type Lanes = [f32; FILTERS];
/// Weights of a layer after the first, indexed by tap, input channel, filter.
pub type Taps = [[Lanes; FILTERS]; TAPS];

/// A layer's output, indexed by row, column, filter.
type Plane<const SIDE: usize> = [[Lanes; SIDE]; SIDE];
type Gray = [[f32; PATCH_SIDE]; PATCH_SIDE];

/// The weights of all four layers, or the gradients with respect to them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weights {
    /// The first layer's weights, by tap.
    pub first: [Lanes; TAPS],
    /// The other layers' weights.
    pub later: [Taps; 3],
    /// All layers' biases.
    pub biases: [Lanes; 4],
}

/// The standardised patch and the rectified output of each layer but the last.
#[derive(Default)]
struct Layers {
    gray: Gray,
    first: Plane<15>,
    second: Plane<7>,
    third: Plane<3>,
}

/// Encodes each of `patches` into the same place of `encodings`.
#[multiversion(targets("x86_64+avx2+fma"))]
pub fn encode(weights: &Weights, patches: &[[u8; PIXELS]], encodings: &mut [Lanes]) {
    let mut layers = Layers::default();
    for (patch, encoding) in patches.iter().zip(encodings) {
        *encoding = forward(weights, patch, &mut layers);
    }
}

/// Adds to `gradients` a loss's gradients with respect to the weights. `grad_output` holds its gradients with respect
/// to the encodings of `patches`. Encodes each patch again, which costs less than keeping 13 kB of each.
#[multiversion(targets("x86_64+avx2+fma"))]
pub fn add_gradients(weights: &Weights, patches: &[[u8; PIXELS]], grad_output: &[Lanes], gradients: &mut Weights) {
    let turned = weights.later.map(|taps| taps.map(transposed));
    let mut layers = Layers::default();
    let mut third = Plane::<3>::default();
    let mut second = Plane::<7>::default();
    let mut first = Plane::<15>::default();

    for (patch, slope) in patches.iter().zip(grad_output) {
        forward(weights, patch, &mut layers);
        let [later_0, later_1, later_2] = &mut gradients.later;
        let [bias_0, bias_1, bias_2, bias_3] = &mut gradients.biases;

        backward(&layers.third, &turned[2], &[[*slope]], later_2, bias_3, &mut third);
        backward(&layers.second, &turned[1], &third, later_1, bias_2, &mut second);
        backward(&layers.first, &turned[0], &second, later_0, bias_1, &mut first);
        backward_first(&layers.gray, &first, &mut gradients.first, bias_0);
    }
}

#[inline(always)]
fn forward(weights: &Weights, patch: &[u8; PIXELS], layers: &mut Layers) -> Lanes {
    standardise(patch, &mut layers.gray);

    for (y, row) in layers.first.iter_mut().enumerate() {
        // In two parts: 15 sums at once would not fit the registers.
        convolve_gray::<0, 8>(&layers.gray, y, &weights.first, &weights.biases[0], row);
        convolve_gray::<8, 7>(&layers.gray, y, &weights.first, &weights.biases[0], row);
    }

    convolve(&layers.first, &weights.later[0], &weights.biases[1], &mut layers.second);
    layers.second.as_flattened_mut().iter_mut().for_each(rectify);
    convolve(&layers.second, &weights.later[1], &weights.biases[2], &mut layers.third);
    layers.third.as_flattened_mut().iter_mut().for_each(rectify);

    let mut encoding = [[[0.0; FILTERS]]];
    convolve(&layers.third, &weights.later[2], &weights.biases[3], &mut encoding);
    encoding[0][0]
}

/// `sum += factor * lanes`, rounded once. Slow without the FMA instruction, which processors have had since 2013.
#[inline(always)]
fn add_product(sum: &mut Lanes, factor: f32, lanes: &Lanes) {
    for lane in 0..FILTERS {
        sum[lane] = factor.mul_add(lanes[lane], sum[lane]);
    }
}

#[inline(always)]
fn add(sum: &mut Lanes, lanes: &Lanes) {
    for lane in 0..FILTERS {
        sum[lane] += lanes[lane];
    }
}

#[inline(always)]
fn rectify(lanes: &mut Lanes) {
    for lane in 0..FILTERS {
        lanes[lane] = lanes[lane].max(0.0);
    }
}

#[inline(always)]
fn transposed(square: [Lanes; FILTERS]) -> [Lanes; FILTERS] {
    std::array::from_fn(|row| std::array::from_fn(|column| square[column][row]))
}

/// Standardises a patch to mean 0 and about unit deviation, as `networks::Encoder::forward` does.
#[inline(always)]
fn standardise(patch: &[u8; PIXELS], gray: &mut Gray) {
    let mean = patch.iter().map(|&level| u32::from(level)).sum::<u32>() as f32 / PIXELS as f32;

    let mut squares = [0.0f32; 2 * FILTERS];
    for levels in patch.as_chunks::<{ 2 * FILTERS }>().0 {
        for lane in 0..2 * FILTERS {
            let centred = f32::from(levels[lane]) - mean;
            squares[lane] += centred * centred;
        }
    }

    let scale = 1.0 / ((squares.iter().sum::<f32>() / PIXELS as f32).sqrt() + 2.0);

    for (row, levels) in gray.iter_mut().zip(patch.as_chunks::<PATCH_SIDE>().0) {
        for x in 0..PATCH_SIDE {
            row[x] = (f32::from(levels[x]) - mean) * scale;
        }
    }
}

/// Computes `COUNT` columns, from `FROM` on, of row `y` of the first layer's output, rectified.
#[inline(always)]
fn convolve_gray<const FROM: usize, const COUNT: usize>(
    gray: &Gray,
    y: usize,
    taps: &[Lanes; TAPS],
    bias: &Lanes,
    row: &mut [Lanes; 15],
) {
    let mut sums = [*bias; COUNT];
    for dy in 0..3 {
        let line = &gray[2 * y + dy];
        for dx in 0..3 {
            for x in 0..COUNT {
                add_product(&mut sums[x], line[2 * (FROM + x) + dx], &taps[3 * dy + dx]);
            }
        }
    }

    for x in 0..COUNT {
        rectify(&mut sums[x]);
        row[FROM + x] = sums[x];
    }
}

/// Computes the output of a layer after the first, not rectified. The sums of a whole row stay in registers.
#[inline(always)]
fn convolve<const IN: usize, const OUT: usize>(input: &Plane<IN>, taps: &Taps, bias: &Lanes, output: &mut Plane<OUT>) {
    for y in 0..OUT {
        let mut sums = [*bias; OUT];
        for dy in 0..3 {
            let line = &input[2 * y + dy];
            for dx in 0..3 {
                for channel in 0..FILTERS {
                    for x in 0..OUT {
                        add_product(&mut sums[x], line[2 * x + dx][channel], &taps[3 * dy + dx][channel]);
                    }
                }
            }
        }
        output[y] = sums;
    }
}

/// Propagates gradients back through a layer after the first.
///
/// `grad_output` holds the gradients with respect to its output, `input` its (rectified) input, and `turned` its
/// weights, indexed by tap, filter, input channel. Adds the gradients with respect to its weights to `taps`, and those
/// with respect to its biases to `bias`. Writes to `below` those with respect to its input before rectification.
#[inline(always)]
fn backward<const IN: usize, const OUT: usize>(
    input: &Plane<IN>,
    turned: &Taps,
    grad_output: &Plane<OUT>,
    taps: &mut Taps,
    bias: &mut Lanes,
    below: &mut Plane<IN>,
) {
    *below = [[[0.0; FILTERS]; IN]; IN];
    for dy in 0..3 {
        for dx in 0..3 {
            let mut sums = taps[3 * dy + dx];
            let turned = turned[3 * dy + dx];

            for y in 0..OUT {
                for x in 0..OUT {
                    let slope = grad_output[y][x];
                    let seen = input[2 * y + dy][2 * x + dx];
                    let mut under = below[2 * y + dy][2 * x + dx];
                    for channel in 0..FILTERS {
                        add_product(&mut sums[channel], seen[channel], &slope);
                        add_product(&mut under, slope[channel], &turned[channel]);
                    }
                    below[2 * y + dy][2 * x + dx] = under;
                }
            }
            taps[3 * dy + dx] = sums;
        }
    }

    grad_output.as_flattened().iter().for_each(|slope| add(bias, slope));

    for (under, seen) in below.as_flattened_mut().iter_mut().zip(input.as_flattened()) {
        for lane in 0..FILTERS {
            // A mask, because a branch would be mispredicted half the time.
            let mask = 0u32.wrapping_sub(u32::from(seen[lane] > 0.0));
            under[lane] = f32::from_bits(under[lane].to_bits() & mask);
        }
    }
}

/// The same for the first layer, whose input needs no gradient.
#[inline(always)]
fn backward_first(gray: &Gray, grad_output: &Plane<15>, taps: &mut [Lanes; TAPS], bias: &mut Lanes) {
    let mut sums = *taps;
    for y in 0..15 {
        for x in 0..15 {
            for dy in 0..3 {
                for dx in 0..3 {
                    add_product(&mut sums[3 * dy + dx], gray[2 * y + dy][2 * x + dx], &grad_output[y][x]);
                }
            }
        }
    }

    *taps = sums;
    grad_output.as_flattened().iter().for_each(|slope| add(bias, slope));
}
