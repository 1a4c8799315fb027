//! The picture's weighted sums and colours in integer arithmetic, four cells at a time, on processors with AVX2.
//!
//! This is one of the package's three modules with unsafe code. Its two uses, and why they are sound:
//! * `Kernel::row` calls a function compiled for AVX2 and FMA; a `Kernel` can only be made where both were detected.
//! * `reinterpreted` turns arrays of numbers into vectors and back: both sides have the same size (checked when
//!   compiled) and every bit pattern is a valid value of either.
//!
//! Weights are scaled to fit 16 bits, and their sums 32.
#![allow(unsafe_code, reason = "see above: the processor's vector instructions, after detection")]

use std::arch::x86_64::{
    __m256, __m256i, _mm_max_ps, _mm_min_ps, _mm_set1_ps, _mm_setzero_ps, _mm256_add_epi32, _mm256_castpd_ps,
    _mm256_castps_pd, _mm256_castps256_ps128, _mm256_cvtepi32_ps, _mm256_cvtps_epi32, _mm256_fmadd_ps,
    _mm256_hadd_epi32, _mm256_madd_epi16, _mm256_packus_epi32, _mm256_permute4x64_pd, _mm256_set1_epi16,
    _mm256_setzero_si256, _mm256_xor_si256,
};

use super::mix::Mix;
use crate::colour::Encoder;
use crate::frame::CELL;

/// Cells worked on at once: a 256-bit register holds 16 samples, a row of each.
pub(super) const CELLS: usize = 4;
const SAMPLES: usize = CELL * CELLS;
/// Indices of four cells' red, green and blue in a vector of all outputs. Each half of the vector holds two cells.
const PIXELS: [usize; 3 * CELLS] = [0, 2, 4, 1, 3, 5, 8, 10, 12, 9, 11, 13];
/// Largest sum of the absolute integer weights of an output: even after rounding, the sum of the
/// largest samples still fits 32 bits.
const WEIGHT_SUM: f32 = 32_750.0;

/// A [`Mix`] of red, green, blue and gray in integers, with the factors and offsets that turn its
/// sums back.
///
/// The multiplication takes signed numbers: 2^15 is subtracted from each sample, and the offsets
/// compensate for that.
#[derive(Debug, Clone)]
pub(super) struct Kernel {
    weights: [[[i16; SAMPLES]; CELL]; 4],
    /// Factors and offsets in the order of the outputs in two vectors. Each half of a vector holds two cells of one
    /// output, then two of the next.
    factors: [[f32; 8]; 2],
    offsets: [[f32; 8]; 2],
}

impl Kernel {
    /// The integer form of `mix`; `None` if the processor lacks AVX2 or FMA.
    pub(super) fn new(mix: &Mix<4>) -> Option<Self> {
        let able = std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma");
        able.then(|| {
            let scales = mix.weights.map(scale);
            let weights: [[i16; CELL * CELL]; 4] =
                std::array::from_fn(|k| mix.weights[k].map(|weight| (weight * scales[k]).round() as i16));

            let pairs = |values: [f32; 4]| {
                [0, 2].map(|first| std::array::from_fn(|lane| values[first + usize::from(lane % 4 > 1)]))
            };

            Self {
                weights: weights.map(|row| std::array::from_fn(|r| std::array::from_fn(|i| row[CELL * r + i % CELL]))),
                factors: pairs(scales.map(f32::recip)),
                offsets: pairs(std::array::from_fn(|k| {
                    let sum: i32 = weights[k].iter().map(|&weight| i32::from(weight)).sum();
                    (f64::from(mix.offsets[k]) + 32_768.0 * f64::from(sum) / f64::from(scales[k])) as f32
                })),
            }
        })
    }

    /// Makes a row of pixels and of gray values from the four rows of samples of its cells.
    pub(super) fn row(
        &self,
        encoder: &Encoder,
        rows: [&[[u16; SAMPLES]]; CELL],
        rgb: &mut [[u8; 3 * CELLS]],
        gray: &mut [[f32; CELLS]],
    ) {
        // SAFETY: a kernel exists only where `new` found AVX2 and FMA.
        unsafe { row(self, encoder, rows, rgb, gray) }
    }
}

/// The factor that turns an output's weights into integers. It makes the largest weight exactly a whole number. If all
/// weights are equal, as gray's often are, all of them are exact.
fn scale(weights: [f32; CELL * CELL]) -> f32 {
    let largest = weights.iter().fold(1e-30f32, |largest, weight| largest.max(weight.abs()));
    let sum = weights.iter().map(|weight| weight.abs()).sum::<f32>().max(1e-30);
    (WEIGHT_SUM / sum * largest).floor() / largest
}

// No closures in here: a closure that is passed on is compiled without these instructions, so it is not inlined.
#[target_feature(enable = "avx2,fma")]
fn row(
    kernel: &Kernel,
    encoder: &Encoder,
    [first, second, third, fourth]: [&[[u16; SAMPLES]]; CELL],
    rgb: &mut [[u8; 3 * CELLS]],
    gray: &mut [[f32; CELLS]],
) {
    let weights: [[__m256i; CELL]; 4] = reinterpreted(kernel.weights);
    let factors: [__m256; 2] = reinterpreted(kernel.factors);
    let offsets: [__m256; 2] = reinterpreted(kernel.offsets);
    let to_signed = _mm256_set1_epi16(i16::MIN);

    let cells = first.iter().zip(second).zip(third).zip(fourth);
    for ((((first, second), third), fourth), (rgb, gray)) in cells.zip(rgb.iter_mut().zip(gray)) {
        let mut sums = [_mm256_setzero_si256(); 4];
        for (r, samples) in [first, second, third, fourth].into_iter().enumerate() {
            let samples = _mm256_xor_si256(reinterpreted(*samples), to_signed);
            for (sum, weights) in sums.iter_mut().zip(&weights) {
                *sum = _mm256_add_epi32(*sum, _mm256_madd_epi16(samples, weights[r]));
            }
        }

        let red_green =
            _mm256_fmadd_ps(_mm256_cvtepi32_ps(_mm256_hadd_epi32(sums[0], sums[1])), factors[0], offsets[0]);
        let blue_gray =
            _mm256_fmadd_ps(_mm256_cvtepi32_ps(_mm256_hadd_epi32(sums[2], sums[3])), factors[1], offsets[1]);

        // Clamps to 0..=65535. Each half then holds two cells' red, green, blue and gray.
        let packed = _mm256_packus_epi32(_mm256_cvtps_epi32(red_green), _mm256_cvtps_epi32(blue_gray));
        let indices: [u16; SAMPLES] = reinterpreted(packed);

        for (value, at) in rgb.iter_mut().zip(PIXELS) {
            *value = encoder.at(indices[at]);
        }

        let grays = _mm256_permute4x64_pd::<0b00_00_11_01>(_mm256_castps_pd(blue_gray));
        let grays = _mm256_castps256_ps128(_mm256_castpd_ps(grays));
        *gray = reinterpreted(_mm_min_ps(_mm_max_ps(grays, _mm_setzero_ps()), _mm_set1_ps(255.0)));
    }
}

/// Reinterprets numbers as vectors, or vectors as numbers.
#[inline(always)]
fn reinterpreted<A: Copy, B>(from: A) -> B {
    const { assert!(size_of::<A>() == size_of::<B>()) }
    // SAFETY: both have the same size, and every bit pattern is a valid number or vector of numbers.
    unsafe { std::mem::transmute_copy(&from) }
}
