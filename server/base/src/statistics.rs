//! Statistics of evaluations: bootstrap confidence intervals and the paired Wilcoxon signed-rank test.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use utoipa::ToSchema;

/// Mean; 0 if there are no values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Standard deviation of the values themselves (divided by their number, not by one less).
pub fn deviation(values: &[f64]) -> f64 {
    let centre = mean(values);
    (values.iter().map(|value| (value - centre).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Number of resamples in a bootstrap.
pub const RESAMPLES: usize = 2000;

/// The 95 % percentile-bootstrap interval of the mean (Efron 1979) from [`RESAMPLES`] resamples drawn from `seed`;
/// zeros if there are no values.
pub fn bootstrap_interval(values: &[f64], seed: u64) -> (f64, f64) {
    let mean_of = |drawn: &[usize]| Some(drawn.iter().map(|&place| values[place]).sum::<f64>() / values.len() as f64);
    bootstrap_statistic(values.len(), seed, mean_of).unwrap_or((0.0, 0.0))
}

/// The 95 % percentile-bootstrap interval of any statistic of `count` units: `statistic` computes it from the places of
/// the units that were drawn. Resamples for which it returns `None` are left out. The result is `None` if no resample
/// is left.
pub fn bootstrap_statistic(count: usize, seed: u64, statistic: impl Fn(&[usize]) -> Option<f64>) -> Option<(f64, f64)> {
    if count == 0 {
        return None;
    }

    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut drawn = vec![0; count];
    let mut found = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        drawn.fill_with(|| rng.random_range(0..count));
        found.extend(statistic(&drawn));
    }

    found.sort_by(f64::total_cmp);
    let low = found.get(found.len() / 40)?;
    let high = found.get(found.len() - 1 - found.len() / 40)?;
    Some((*low, *high))
}

/// Most differing pairs for which [`wilcoxon`]'s p is exact; `SciPy` and R have the same bound.
const MOST_EXACT: usize = 50;
/// Relative difference up to which two values count as equal: means of the same ratings, summed in another order,
/// differ by rounding.
const ROUNDING: f64 = 1e-12;

/// How a [`SignedRank`]'s p was computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// From the distribution of the rank sum over all patterns of signs.
    Exact,
    /// From the normal distribution of the same mean and variance, corrected for ties.
    NormalApproximation,
}

/// Result of the paired Wilcoxon signed-rank test (Wilcoxon 1945).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedRank {
    /// Two-sided p; 1 if no pair differs.
    pub p: f64,
    /// How it was computed.
    pub method: Method,
    /// Pairs that differ.
    pub differing: usize,
    /// Sum of the ranks of the differences above zero.
    pub positive: f64,
    /// Sum of the ranks of the differences below zero.
    pub negative: f64,
}

/// Tests whether paired values differ. Pairs without a difference are left out; equal differences share their mean
/// rank. p is exact for at most 50 pairs that differ, with or without ties.
pub fn wilcoxon(a: &[f64], b: &[f64]) -> SignedRank {
    let (ranks, positive) = signed_ranks(a.iter().zip(b).map(|(a, b)| a - b));

    let (p, method) = if ranks.len() <= MOST_EXACT {
        (exact(&ranks, positive), Method::Exact)
    } else {
        (approximate(&ranks, positive), Method::NormalApproximation)
    };

    let all: usize = ranks.iter().sum();
    SignedRank {
        p,
        method,
        differing: ranks.len(),
        positive: 0.5 * positive as f64,
        negative: 0.5 * (all - positive) as f64,
    }
}

/// The matched-pairs rank-biserial correlation, -1..=1: the share of the rank sum above zero minus that below zero
/// (Kerby 2014, Comprehensive Psychology 3:1). `None` if no difference is other than 0.
pub fn rank_biserial(differences: &[f64]) -> Option<f64> {
    let (ranks, positive) = signed_ranks(differences.iter().copied());
    let all: usize = ranks.iter().sum();
    (all > 0).then(|| (2.0 * positive as f64 - all as f64) / all as f64)
}

/// Twice the ranks of the differences that are not 0, by their size, and the sum of those of differences above 0.
fn signed_ranks(differences: impl Iterator<Item = f64>) -> (Vec<usize>, usize) {
    let differing: Vec<f64> = differences.filter(|d| *d != 0.0).collect();
    let sizes: Vec<f64> = differing.iter().map(|d| d.abs()).collect();
    let ranks: Vec<usize> = doubled_ranks(&sizes).into_iter().map(|rank| rank as usize).collect();
    let positive = ranks.iter().zip(&differing).filter(|(_, d)| **d > 0.0).map(|(rank, _)| rank).sum();
    (ranks, positive)
}

/// Twice the rank of each of `values`: 2 for the lowest if no other equals it. Equal values share their mean rank, so
/// twice a rank is a whole number. The doubled ranks of k values sum to k (k + 1).
pub fn doubled_ranks(values: &[f64]) -> Vec<i64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));

    let mut ranks = vec![0; values.len()];
    let mut start = 0;
    while let Some(&first) = order.get(start) {
        let others = &order[start + 1..];
        let equal = 1 + others.iter().take_while(|&&place| are_equal(values[first], values[place])).count();
        for &place in &order[start..start + equal] {
            ranks[place] = (2 * start + equal + 1) as i64;
        }
        start += equal;
    }
    ranks
}

fn are_equal(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * a.abs().min(b.abs())
}

/// Two-sided p of the sum `positive`, if each of `ranks` is added with probability 1/2.
fn exact(ranks: &[usize], positive: usize) -> f64 {
    // Number of patterns of signs for each sum: below 2^50, exact as floating point.
    let mut patterns = vec![0.0; ranks.iter().sum::<usize>() + 1];
    patterns[0] = 1.0;

    for &rank in ranks {
        for sum in (rank..patterns.len()).rev() {
            patterns[sum] += patterns[sum - rank];
        }
    }

    let all: f64 = patterns.iter().sum();
    let below: f64 = patterns[..=positive].iter().sum();
    let above: f64 = patterns[positive..].iter().sum();
    (2.0 * below.min(above) / all).min(1.0)
}

fn approximate(ranks: &[usize], positive: usize) -> f64 {
    // Each rank counts with probability 1/2: the variance is a quarter of the sum of squares, ties included.
    let ranks: Vec<f64> = ranks.iter().map(|&rank| 0.5 * rank as f64).collect();
    let expected = 0.5 * ranks.iter().sum::<f64>();
    let variance = 0.25 * ranks.iter().map(|rank| rank * rank).sum::<f64>();

    let z = (0.5 * positive as f64 - expected) / variance.sqrt();
    normal_two_sided(z)
}

/// Two-sided p of the standard normal deviate `z`.
pub fn normal_two_sided(z: f64) -> f64 {
    complementary_error(z.abs() / std::f64::consts::SQRT_2)
}

/// Each p corrected by Holm's method (1979) for the number of comparisons. If every corrected p below 0.05 counts as a
/// finding, the chance of any false finding among all of them is below 0.05.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));

    let mut corrected = vec![0.0; p.len()];
    let mut least: f64 = 0.0;

    for (rank, index) in order.into_iter().enumerate() {
        least = least.max((p.len() - rank) as f64 * p[index]).min(1.0);
        corrected[index] = least;
    }

    corrected
}

/// erfc(x) for x >= 0: Taylor series below 2, continued fraction above (Abramowitz and Stegun 7.1.6 and 7.1.14).
fn complementary_error(x: f64) -> f64 {
    let scale = (-x * x).exp();

    if x < 2.0 {
        let mut term = x;
        let mut sum = x;
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
    use serde::Deserialize;

    use super::*;

    #[derive(Deserialize)]
    struct Case {
        name: String,
        differences: Vec<f64>,
        method: String,
        p: f64,
    }

    #[derive(Deserialize)]
    struct Corrected {
        p: Vec<f64>,
        p_holm: Vec<f64>,
    }

    /// The output of `tests/vectors/wilcoxon.py`.
    #[derive(Deserialize)]
    struct Vectors {
        cases: Vec<Case>,
        holm: Vec<Corrected>,
    }

    fn vectors() -> Vectors {
        serde_json::from_str(include_str!("../../../tests/vectors/wilcoxon.json")).unwrap()
    }

    #[test]
    fn differences_without_end_are_ranked_too() {
        assert_eq!(rank_biserial(&[f64::INFINITY, -1.0, f64::INFINITY]), Some(2.0 / 3.0));
        assert_eq!(wilcoxon(&[f64::NAN, 2.0], &[0.0, 1.0]).differing, 2);
    }

    #[test]
    fn the_signed_rank_test_agrees_with_scipy() {
        for Case { name, differences, method, p } in vectors().cases {
            let zeros = vec![0.0; differences.len()];
            let found = wilcoxon(&differences, &zeros);
            assert!((found.p / p - 1.0).abs() < 1e-10, "{name}: {} instead of {p}", found.p);
            assert_eq!(serde_json::to_value(found.method).unwrap(), method, "{name}");
            assert!((wilcoxon(&zeros, &differences).p - found.p).abs() < 1e-12, "{name} the other way round");
            assert!((wilcoxon(&differences, &differences).p - 1.0).abs() < 1e-12, "{name}: no difference");
        }
    }

    #[test]
    fn holms_correction_agrees_with_statsmodels() {
        for Corrected { p, p_holm } in vectors().holm {
            for (found, expected) in holm(&p).iter().zip(&p_holm) {
                assert!((found / expected - 1.0).abs() < 1e-12, "{p:?}: {found} instead of {expected}");
            }
        }
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
