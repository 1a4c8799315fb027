//! Friedman's test (1937, Journal of the American Statistical Association 32:675): whether treatments differ. The
//! values are ranked within each block.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use utoipa::ToSchema;

use parfocal_base::statistics::doubled_ranks;

/// Limit on the steps of the exact distribution; beyond it, permutations are drawn.
const MOST_STEPS: usize = 4_000_000;
/// Most treatments for which all permutations are enumerated.
const MOST_TREATMENTS: usize = 6;
/// Number of permutations that are drawn.
const DRAWS: usize = 9_999;

/// Result of Friedman's test.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Friedman {
    /// The statistic, corrected for ties.
    pub chi_square: f64,
    /// Degrees of freedom: treatments minus one.
    pub df: usize,
    /// p from the chi-square distribution, a rough approximation for few blocks.
    pub p_chi_square: f64,
    /// p over the permutations of each block's ranks.
    pub p_permutation: f64,
    /// How `p_permutation` was computed.
    pub permutation: PermutationMethod,
    /// Kendall's W, 0..=1: how far the blocks agree on an order.
    pub kendalls_w: f64,
    /// The mean rank of each treatment; rank 1 is the lowest value.
    pub mean_ranks: Vec<f64>,
}

/// How a p over permutations was computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PermutationMethod {
    /// Over all permutations.
    Exact,
    /// Over 9999 randomly drawn permutations.
    MonteCarlo,
}

/// Tests `blocks` of three or more treatments each. If there are too many permutations to take all, some are drawn from
/// `seed`. `None` for fewer than two blocks or three treatments, and if no block has a difference.
pub fn friedman(blocks: &[Vec<f64>], seed: u64) -> Option<Friedman> {
    let treatments = blocks.first()?.len();
    if blocks.len() < 2 || treatments < 3 {
        return None;
    }

    let ranks: Vec<Vec<i64>> = blocks.iter().map(|block| doubled_ranks(block)).collect();
    let w = concordance_of(&ranks)?;
    let df = treatments - 1;
    let chi_square = w * blocks.len() as f64 * df as f64;
    let (p_permutation, permutation) = permutation_p(&ranks, seed);

    let mean_ranks = sums(&ranks).into_iter().map(|sum| 0.5 * sum as f64 / blocks.len() as f64).collect();
    Some(Friedman {
        chi_square,
        df,
        p_chi_square: chi_square_above(chi_square, df as f64),
        p_permutation,
        permutation,
        kendalls_w: w,
        mean_ranks,
    })
}

/// The probability that chi-square with `df` degrees of freedom exceeds `x`; NaN where the degrees of freedom are none.
fn chi_square_above(x: f64, df: f64) -> f64 {
    ChiSquared::new(df).map_or(f64::NAN, |distribution| distribution.sf(x))
}

/// Kendall's W of `blocks`, corrected for ties (Kendall & Babington Smith 1939, Annals of Mathematical Statistics
/// 10:275); `None` if no block has a difference.
pub fn concordance<'a>(blocks: impl IntoIterator<Item = &'a Vec<f64>>) -> Option<f64> {
    concordance_of(&blocks.into_iter().map(|block| doubled_ranks(block)).collect::<Vec<_>>())
}

/// The spread of the rank sums, divided by the greatest spread that these ranks allow, when all blocks agree.
fn concordance_of(ranks: &[Vec<i64>]) -> Option<f64> {
    let treatments = ranks.first()?.len() as i64;
    let blocks = ranks.len() as i64;
    let mean = treatments + 1;

    let within: i64 = ranks.iter().flatten().map(|rank| (rank - mean).pow(2)).sum();
    let greatest = blocks * within;
    (greatest > 0).then(|| spread(&sums(ranks), blocks * mean) as f64 / greatest as f64)
}

/// The sum of the doubled ranks of each treatment.
fn sums(ranks: &[Vec<i64>]) -> Vec<i64> {
    let treatments = ranks.first().map_or(0, Vec::len);
    (0..treatments).map(|treatment| ranks.iter().map(|block| block[treatment]).sum()).collect()
}

fn spread(sums: &[i64], mean: i64) -> i64 {
    sums.iter().map(|sum| (sum - mean).pow(2)).sum()
}

/// The share of permutations of each block's ranks whose rank sums spread at least as much as these.
fn permutation_p(ranks: &[Vec<i64>], seed: u64) -> (f64, PermutationMethod) {
    match exact_p(ranks) {
        Some(p) => (p, PermutationMethod::Exact),
        None => (drawn_p(ranks, seed), PermutationMethod::MonteCarlo),
    }
}

fn exact_p(ranks: &[Vec<i64>]) -> Option<f64> {
    let treatments = ranks.first()?.len();
    if treatments > MOST_TREATMENTS {
        return None;
    }
    let mean = (treatments as i64 + 1) * ranks.len() as i64;
    let observed = spread(&sums(ranks), mean);

    // The probability of each set of rank sums, in rising order. All treatments are alike here, so the order of the
    // sums does not affect what comes next.
    let mut states = BTreeMap::from([(vec![0; treatments], 1.0)]);
    let mut steps = 0;
    for block in ranks {
        let orders = orders_of(block);
        steps += orders.len() * states.len();
        if steps > MOST_STEPS {
            return None;
        }

        let mut next = BTreeMap::new();
        for (state, probability) in &states {
            for (order, share) in &orders {
                let mut sums: Vec<i64> = state.iter().zip(order).map(|(sum, rank)| sum + rank).collect();
                sums.sort_unstable();
                *next.entry(sums).or_insert(0.0) += probability * share;
            }
        }
        states = next;
    }

    let as_far = states.iter().filter(|(sums, _)| spread(sums, mean) >= observed);
    Some(as_far.map(|(_, probability)| probability).sum::<f64>().min(1.0))
}

/// Each distinct order of `ranks`, with its probability.
fn orders_of(ranks: &[i64]) -> BTreeMap<Vec<i64>, f64> {
    let mut orders = BTreeMap::from([(Vec::new(), (ranks.to_vec(), 1.0))]);
    for _ in 0..ranks.len() {
        let mut next: BTreeMap<Vec<i64>, (Vec<i64>, f64)> = BTreeMap::new();
        for (order, (left, probability)) in orders {
            for place in 0..left.len() {
                let mut longer = order.clone();
                longer.push(left[place]);
                let mut rest = left.clone();
                rest.remove(place);
                next.entry(longer).or_insert((rest, 0.0)).1 += probability / left.len() as f64;
            }
        }
        orders = next;
    }
    orders.into_iter().map(|(order, (_, probability))| (order, probability)).collect()
}

pub(super) fn drawn_p(ranks: &[Vec<i64>], seed: u64) -> f64 {
    let treatments = ranks.first().map_or(0, Vec::len);
    let mean = (treatments as i64 + 1) * ranks.len() as i64;
    let observed = spread(&sums(ranks), mean);

    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut drawn = ranks.to_vec();
    let mut as_far = 0;
    for _ in 0..DRAWS {
        for block in &mut drawn {
            block.shuffle(&mut random);
        }
        as_far += usize::from(spread(&sums(&drawn), mean) >= observed);
    }
    // The observed order is one of the permutations (Phipson & Smyth 2010).
    (as_far + 1) as f64 / (DRAWS + 1) as f64
}
