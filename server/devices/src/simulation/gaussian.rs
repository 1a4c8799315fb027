//! The Gaussian at whole pixels: kernels of blurs, and smoothing of series.

/// Samples of a Gaussian of standard deviation `sigma` at 0, 1, ... `reach`; the one at 0 is 1.
fn samples(sigma: f64, reach: usize) -> Vec<f64> {
    (0..=reach).map(|at| (-0.5 * (at as f64 / sigma).powi(2)).exp()).collect()
}

/// A Gaussian of standard deviation `sigma` from its middle to `reach` pixels away. With its mirror
/// image it sums to 1.
pub fn half_kernel(sigma: f64, reach: usize) -> Vec<f64> {
    let samples = samples(sigma, reach);
    let sum = 2.0 * samples.iter().sum::<f64>() - samples[0];
    samples.into_iter().map(|sample| sample / sum).collect()
}

/// A Gaussian of standard deviation `sigma` up to `reach` pixels either way, `2 * reach + 1` values
/// that sum to 1.
pub fn kernel(sigma: f64, reach: usize) -> Vec<f64> {
    let half = samples(sigma, reach);
    let both: Vec<f64> = half.iter().rev().chain(&half[1..]).copied().collect();
    let sum: f64 = both.iter().sum();
    both.into_iter().map(|sample| sample / sum).collect()
}

/// The discrete Gaussian (Lindeberg 1990) of standard deviation `sigma`, up to `reach` pixels either way:
/// `exp(-t) I_n(t)` with t = `sigma` squared. `sigma` must be below 1. In that range samples of a Gaussian, as in
/// [`kernel`], have less than its variance.
pub fn discrete_kernel(sigma: f64, reach: usize) -> Vec<f64> {
    let half = 0.5 * sigma * sigma;

    // The series of the modified Bessel function; its terms shrink by a factor of more than 4.
    let bessel = |order: i32| -> f64 {
        let mut term = (1..=order).fold(1.0, |term, factor| term * half / f64::from(factor));
        let mut sum = term;
        for index in 1..12 {
            term *= half * half / f64::from(index * (index + order));
            sum += term;
        }
        sum
    };

    let reach = reach as i32;
    let weights: Vec<f64> = (-reach..=reach).map(|tap| bessel(tap.abs())).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// `values` smoothed by a Gaussian of `sigma` places, cut at four sigma. Beyond both ends the values are mirrored.
pub fn smoothed(values: &[f64], sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).round() as usize;
    let kernel = kernel(sigma, reach);
    let period = 2 * values.len() as i64;
    let mirrored = |index: i64| {
        let place = index.rem_euclid(period);
        values[place.min(period - 1 - place) as usize]
    };

    let first = -(reach as i64);
    let at = |index: i64| (first + index..).zip(&kernel).map(|(place, weight)| weight * mirrored(place)).sum();
    (0..values.len() as i64).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_sum_to_one_and_fall_as_a_gaussian() {
        let half = half_kernel(4.0, 16);
        let whole = kernel(4.0, 16);
        assert!((2.0 * half.iter().sum::<f64>() - half[0] - 1.0).abs() < 1e-12);
        assert!((whole.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for kernel in [&half[..], &whole[16..]] {
            // One and two standard deviations from the middle: exp(-1/2) and exp(-2).
            assert!((kernel[4] / kernel[0] - 0.606_530_660).abs() < 1e-9);
            assert!((kernel[8] / kernel[0] - 0.135_335_283).abs() < 1e-9);
        }
    }

    #[test]
    fn a_discrete_kernel_has_its_variance() {
        for sigma in [0.05, 0.2, 0.5, 0.8, 0.99] {
            let kernel = discrete_kernel(sigma, 4);
            let variance: f64 =
                kernel.iter().zip(-4..=4).map(|(weight, tap): (_, i32)| weight * f64::from(tap * tap)).sum();
            assert!((variance / (sigma * sigma) - 1.0).abs() < 0.02, "{sigma}: {variance}");
        }
    }

    #[test]
    fn smoothing_keeps_a_constant_and_spreads_a_spike_as_a_gaussian() {
        assert!(smoothed(&[3.0; 40], 5.0).iter().all(|value| (value - 3.0).abs() < 1e-9));
        let mut spike = [0.0; 101];
        spike[50] = 1.0;
        let out = smoothed(&spike, 5.0);
        // The normal density at 0 and at one standard deviation, over 5.
        assert!((out[50] - 0.079_79).abs() < 1e-4 && (out[55] - 0.048_39).abs() < 1e-4);
    }
}
