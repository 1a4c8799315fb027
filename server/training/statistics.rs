//! Statistics of evaluations: bootstrap confidence intervals and the paired Wilcoxon signed-rank test.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "counts of scans are small"
)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mean; 0 of nothing.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Standard deviation over the values at hand (divided by their number).
#[must_use]
pub fn deviation(values: &[f64]) -> f64 {
    let centre = mean(values);
    (values.iter().map(|value| (value - centre).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// The 95 % percentile-bootstrap interval of the mean (Efron 1979) from 2000 resamples drawn from `seed`.
#[must_use]
pub fn bootstrap_interval(values: &[f64], seed: u64) -> (f64, f64) {
    const RESAMPLES: usize = 2000;
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut means: Vec<f64> = (0..RESAMPLES)
        .map(|_| (0..values.len()).map(|_| values[rng.random_range(0..values.len())]).sum::<f64>())
        .map(|sum| sum / values.len() as f64)
        .collect();
    means.sort_by(f64::total_cmp);
    (means[RESAMPLES / 40], means[RESAMPLES - 1 - RESAMPLES / 40])
}

/// Two-sided p of the paired Wilcoxon signed-rank test (Wilcoxon 1945) by its normal approximation, corrected for ties,
/// pairs without a difference left out; 1 where no pair differs.
#[must_use]
pub fn wilcoxon(a: &[f64], b: &[f64]) -> f64 {
    let mut differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).filter(|d| *d != 0.0).collect();
    differences.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let n = differences.len() as f64;
    let (mut positive, mut ties) = (0.0, 0.0);
    let mut start = 0;
    while start < differences.len() {
        let size = differences[start].abs();
        let group = differences[start..].iter().take_while(|d| d.abs() - size <= 1e-12 * size).count();
        let rank = start as f64 + 0.5 * (group as f64 + 1.0);
        positive += rank * differences[start..start + group].iter().filter(|d| **d > 0.0).count() as f64;
        ties += (group as f64).powi(3) - group as f64;
        start += group;
    }
    let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ties / 48.0;
    if variance <= 0.0 {
        return 1.0;
    }
    let z = (positive - n * (n + 1.0) / 4.0) / variance.sqrt();
    complementary_error(z.abs() / std::f64::consts::SQRT_2)
}

/// erfc(x) for x >= 0: Taylor series below 2, continued fraction above (Abramowitz and Stegun 7.1.6 and 7.1.14).
fn complementary_error(x: f64) -> f64 {
    let scale = (-x * x).exp();
    if x < 2.0 {
        let (mut term, mut sum) = (x, x);
        for k in 1..80 {
            term *= 2.0 * x * x / f64::from(2 * k + 1);
            sum += term;
        }
        return 1.0 - 2.0 / std::f64::consts::PI.sqrt() * scale * sum;
    }
    let tail = (1..80).rev().fold(x, |tail, k| x + 0.5 * f64::from(k) / tail);
    scale / (tail * std::f64::consts::PI.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values: `scipy.stats.wilcoxon(a, b, method="approx", correction=False)` of `SciPy` 1.17.1.
    #[test]
    #[allow(clippy::approx_constant, reason = "a measurement that happens to be 3.14")]
    fn wilcoxon_agrees_with_scipy() {
        let before = [1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30];
        let after = [0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29];
        assert!((wilcoxon(&before, &after) - 0.038_151_710_173_415_135).abs() < 1e-12);
        let tied = [1.0, 1.0, 2.0, 2.0, 2.0, -1.0, 3.0, 0.0, 0.0, 4.0, -3.0, 5.0, 2.0, 1.0];
        assert!((wilcoxon(&tied, &[0.0; 14]) - 0.032_730_659_352_683_91).abs() < 1e-12);
        assert!((wilcoxon(&tied, &tied) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_error_function_agrees_with_tables() {
        for (x, expected) in [(0.0, 1.0), (0.5, 0.479_500_122_186_953_5), (2.5, 4.069_520_174_449_59e-4)] {
            assert!((complementary_error(x) / expected - 1.0f64).abs() < 1e-10, "{x}");
        }
    }

    #[test]
    fn the_interval_holds_the_mean_and_narrows_with_the_square_root() {
        let values: Vec<f64> = (0..400).map(|i| f64::from(i % 20)).collect();
        let (low, high) = bootstrap_interval(&values, 1);
        assert!(low < 9.5 && 9.5 < high);
        // 1.96 * 2 * 5.766 / sqrt(400)
        assert!((high - low - 1.13).abs() < 0.1, "{}", high - low);
    }
}
