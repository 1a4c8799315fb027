//! Page's test for a trend (1963, Journal of the American Statistical Association 58:216): whether values rise or fall
//! from one treatment to the next. The values are ranked within each block.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use parfocal_base::statistics::{Method, doubled_ranks, normal_two_sided};

/// Most treatments for which p is exact.
const MOST_TREATMENTS: usize = 8;
/// Most blocks for which p is exact.
const MOST_BLOCKS: usize = 100;

/// Result of Page's test.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Trend {
    /// Page's L: the sum over treatments of place times rank sum.
    pub l: f64,
    /// Mean of L if there is no trend.
    pub expected: f64,
    /// Two-sided p.
    pub p: f64,
    /// How `p` was computed.
    pub method: Method,
}

/// Tests `blocks` for a trend in either direction over their three or more treatments, which are in order. `None` for
/// fewer than two blocks or three treatments, and if no block has a difference.
pub fn trend(blocks: &[Vec<f64>]) -> Option<Trend> {
    let treatments = blocks.first()?.len();
    if blocks.len() < 2 || treatments < 3 {
        return None;
    }

    let mean = treatments as i64 + 1;
    let ranks: Vec<Vec<i64>> = blocks.iter().map(|block| doubled_ranks(block)).collect();
    if ranks.iter().flatten().all(|rank| *rank == mean) {
        return None;
    }

    let l: i64 = ranks.iter().map(|block| weighted(block)).sum();
    let expected = blocks.len() as i64 * mean * mean * treatments as i64 / 2;
    let (p, method) = if treatments <= MOST_TREATMENTS && blocks.len() <= MOST_BLOCKS {
        (exact_p(&ranks, (l - expected).abs(), expected), Method::Exact)
    } else {
        (approximate_p(&ranks, l - expected), Method::NormalApproximation)
    };
    Some(Trend { l: 0.5 * l as f64, expected: 0.5 * expected as f64, p, method })
}

fn weighted(ranks: &[i64]) -> i64 {
    ranks.iter().zip(1..).map(|(rank, place)| rank * place).sum()
}

/// The probability that L is at least `distance` away from `expected`, over all permutations of each block's ranks.
fn exact_p(ranks: &[Vec<i64>], distance: i64, expected: i64) -> f64 {
    let mut known: BTreeMap<Vec<i64>, BTreeMap<i64, f64>> = BTreeMap::new();
    let mut all = BTreeMap::from([(0, 1.0)]);

    for block in ranks {
        let mut sorted = block.clone();
        sorted.sort_unstable();
        let of_block = known.entry(sorted).or_insert_with_key(|sorted| distribution(sorted));

        let mut next = BTreeMap::new();
        for (sum, probability) in &all {
            for (more, share) in &*of_block {
                *next.entry(sum + more).or_insert(0.0) += probability * share;
            }
        }
        all = next;
    }

    let as_far = all.iter().filter(|(l, _)| (*l - expected).abs() >= distance);
    as_far.map(|(_, probability)| probability).sum::<f64>().min(1.0)
}

/// The probability of each weighted sum of a block, over all orders of its ranks.
fn distribution(ranks: &[i64]) -> BTreeMap<i64, f64> {
    // For each set of ranks used so far, as bits: the sums that they can have in the first places.
    let mut by_set: BTreeMap<usize, BTreeMap<i64, f64>> = BTreeMap::from([(0, BTreeMap::from([(0, 1.0)]))]);
    for place in 1..=ranks.len() {
        let share = 1.0 / (ranks.len() + 1 - place) as f64;
        let mut next: BTreeMap<usize, BTreeMap<i64, f64>> = BTreeMap::new();
        for (set, sums) in &by_set {
            for (index, rank) in ranks.iter().enumerate().filter(|(index, _)| set & (1 << index) == 0) {
                let longer = next.entry(set | (1 << index)).or_default();
                for (sum, probability) in sums {
                    *longer.entry(sum + rank * place as i64).or_insert(0.0) += probability * share;
                }
            }
        }
        by_set = next;
    }
    by_set.into_values().next().unwrap_or_default()
}

/// Two-sided p from the normal distribution, with the variance of L over permutations, including ties.
fn approximate_p(ranks: &[Vec<i64>], deviation: i64) -> f64 {
    let treatments = ranks.first().map_or(0, Vec::len) as f64;
    let places = treatments * (treatments * treatments - 1.0) / 12.0;
    let spread_of = |block: &Vec<i64>| block.iter().map(|rank| (*rank as f64 - treatments - 1.0).powi(2)).sum::<f64>();
    let variance: f64 = ranks.iter().map(|block| spread_of(block) * places / (treatments - 1.0)).sum();
    normal_two_sided(deviation as f64 / variance.sqrt())
}
