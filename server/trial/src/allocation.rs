//! Allocation: which policy runs in which segment. It is drawn from a stored seed by a named algorithm. Every step of
//! the algorithm is fixed here, so that no library update changes the meaning of an old seed.
//!
//! Words come from the `ChaCha20` key stream (RFC 8439; 256-bit key = seed, counter and nonce zero) as little-endian
//! `u32`, one after another. A number below `n` is `word % n`; words of `2^32 - 2^32 % n` and above are skipped. A
//! shuffle walks `i` from the last place down to 1 and swaps places `i` and "number below `i + 1`" (Durstenfeld 1964).

use std::fmt;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha20Rng;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How a protocol orders its segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// A plain shuffle, as in the paper.
    Shuffled,
    /// No policy runs twice in a row. Over a set of sessions, every policy is equally often in every position, and
    /// every ordered pair of policies occurs equally often in succession.
    Balanced,
}

impl Order {
    /// The algorithm that new sessions use.
    pub const fn algorithm(self) -> Algorithm {
        match self {
            Self::Shuffled => Algorithm::Shuffle1,
            Self::Balanced => Algorithm::Balanced1,
        }
    }
}

/// A named, versioned algorithm that draws an order from a seed. The meaning of a name never changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Algorithm {
    /// A shuffle of all segments.
    #[serde(rename = "parfocal-shuffle-1")]
    Shuffle1,
    /// Draws a base order by shuffling until no policy runs twice in a row. Then shuffles all relabellings of the
    /// policies (permutations in lexicographic order). Session `index` of the set takes relabelling `index`.
    #[serde(rename = "parfocal-balanced-1")]
    Balanced1,
}

impl Algorithm {
    /// The kind of order that this algorithm draws.
    pub const fn order(self) -> Order {
        match self {
            Self::Shuffle1 => Order::Shuffled,
            Self::Balanced1 => Order::Balanced,
        }
    }

    /// Number of sessions that share a seed: the size of a balanced set, otherwise 1.
    pub fn set_size(self, policies: usize) -> usize {
        match self {
            Self::Shuffle1 => 1,
            Self::Balanced1 => (1..=policies).product(),
        }
    }

    /// The order of session `index` (from 0) of the set with this seed. For each segment it gives the policy as an
    /// index into the protocol's list (0..`policies`). Each policy occurs `repeats` times.
    pub fn draw(self, seed: Seed, policies: usize, repeats: usize, index: usize) -> Vec<usize> {
        let mut words = Words(ChaCha20Rng::from_seed(seed.0));
        let mut order: Vec<usize> = (0..policies).flat_map(|policy| std::iter::repeat_n(policy, repeats)).collect();
        words.shuffle(&mut order);
        if self == Self::Shuffle1 {
            return order;
        }
        while policies > 1 && order.windows(2).any(|pair| pair[0] == pair[1]) {
            words.shuffle(&mut order);
        }
        let mut relabellings = permutations(policies);
        words.shuffle(&mut relabellings);
        let relabelling = &relabellings[index % relabellings.len()];
        order.into_iter().map(|policy| relabelling[policy]).collect()
    }
}

names!(Algorithm { Shuffle1: "parfocal-shuffle-1", Balanced1: "parfocal-balanced-1" });

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// 256 random bits. They reveal the order, so nobody may see them before unblinding.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Seed(pub [u8; 32]);

impl Seed {
    /// Draws a seed from `random`.
    pub fn random(random: &mut impl Rng) -> Self {
        let mut bytes = [0; 32];
        random.fill_bytes(&mut bytes);
        Self(bytes)
    }

    /// The seed as 64 hexadecimal digits.
    pub fn to_hex(self) -> String {
        hex::encode(self.0)
    }

    /// Reads a seed from 64 hexadecimal digits; none if `text` is anything else.
    pub fn from_hex(text: &str) -> Option<Self> {
        let mut bytes = [0; 32];
        hex::decode_to_slice(text, &mut bytes).ok()?;
        Some(Self(bytes))
    }
}

/// Keeps the seed out of logs.
impl fmt::Debug for Seed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Seed(..)")
    }
}

struct Words(ChaCha20Rng);

impl Words {
    fn below(&mut self, n: u32) -> u32 {
        let passed_over = (u32::MAX % n + 1) % n;
        loop {
            let word = self.0.next_u32();
            if word <= u32::MAX - passed_over {
                return word % n;
            }
        }
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i as u32 + 1) as usize);
        }
    }
}

/// All permutations of `0..n` in lexicographic order.
fn permutations(n: usize) -> Vec<Vec<usize>> {
    if n == 0 {
        return vec![Vec::new()];
    }
    let shorter = permutations(n - 1);
    (0..n)
        .flat_map(|first| {
            shorter.iter().map(move |rest| {
                let rest = rest.iter().map(|&item| if item < first { item } else { item + 1 });
                std::iter::once(first).chain(rest).collect()
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    fn seed(number: u64) -> Seed {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&number.to_le_bytes());
        Seed(bytes)
    }

    #[test]
    fn the_words_are_those_of_rfc_8439() {
        // RFC 8439, appendix A.1, test vector 1: key, nonce and counter zero.
        let mut words = Words(ChaCha20Rng::from_seed([0; 32]));
        let first: Vec<u32> = (0..4).map(|_| words.0.next_u32()).collect();
        assert_eq!(first, [0xade0_b876, 0x903d_f1a0, 0xe56a_5d40, 0x28bd_8653]);
    }

    /// Computed from the module's description, with `openssl enc -chacha20` for the key stream and Python for the rest.
    /// These values must never change: they are the meaning of recorded seeds.
    #[test]
    fn old_seeds_keep_their_meaning() {
        let counting = Seed(std::array::from_fn(|i| u8::try_from(i).unwrap()));
        assert_eq!(Algorithm::Shuffle1.draw(counting, 3, 2, 0), [1, 2, 1, 2, 0, 0]);
        assert_eq!(Algorithm::Shuffle1.draw(Seed([0xff; 32]), 4, 3, 0), [3, 0, 3, 2, 1, 1, 1, 3, 0, 2, 2, 0]);
        let set: Vec<Vec<usize>> = (0..6).map(|index| Algorithm::Balanced1.draw(counting, 3, 2, index)).collect();
        assert_eq!(set[0], [2, 0, 2, 1, 0, 1]);
        assert_eq!(set[3], [0, 1, 0, 2, 1, 2]);
        assert_eq!(set[5], [0, 2, 0, 1, 2, 1]);
    }

    #[test]
    fn a_shuffle_is_uniform_over_the_90_orders() {
        let mut counts: BTreeMap<Vec<usize>, f64> = BTreeMap::new();
        let draws = 18_000_u32;
        for number in 0..draws {
            *counts.entry(Algorithm::Shuffle1.draw(seed(number.into()), 3, 2, 0)).or_default() += 1.0;
        }
        assert_eq!(counts.len(), 90, "6!/(2!2!2!) orders");
        let expected = f64::from(draws) / 90.0;
        let chi_square: f64 = counts.values().map(|count| (count - expected).powi(2) / expected).sum();
        assert!(
            chi_square < 135.98,
            "{chi_square} is beyond the 99.9 % point of chi-square with 89 degrees of freedom"
        );
    }

    #[test]
    fn balanced_base_orders_are_uniform_over_the_30_without_a_policy_next_to_itself() {
        let mut counts: BTreeMap<Vec<usize>, f64> = BTreeMap::new();
        let draws = 6_000_u32;
        for number in 0..draws {
            *counts.entry(Algorithm::Balanced1.draw(seed(number.into()), 3, 2, 0)).or_default() += 1.0;
        }
        assert_eq!(counts.len(), 30);
        assert!(counts.keys().all(|order| order.windows(2).all(|pair| pair[0] != pair[1])));
        let expected = f64::from(draws) / 30.0;
        let chi_square: f64 = counts.values().map(|count| (count - expected).powi(2) / expected).sum();
        assert!(chi_square < 58.30, "{chi_square} is beyond the 99.9 % point of chi-square with 29 degrees of freedom");
    }

    #[test]
    fn a_balanced_set_is_balanced() {
        for number in 0..50 {
            let set: Vec<Vec<usize>> =
                (0..6).map(|index| Algorithm::Balanced1.draw(seed(number), 3, 2, index)).collect();
            assert_eq!(set.iter().collect::<BTreeSet<_>>().len(), 6, "six different orders");
            for position in 0..6 {
                for policy in 0..3 {
                    assert_eq!(set.iter().filter(|order| order[position] == policy).count(), 2);
                }
            }

            let mut follows: BTreeMap<(usize, usize), usize> = BTreeMap::new();
            for pair in set.iter().flat_map(|order| order.windows(2)) {
                *follows.entry((pair[0], pair[1])).or_default() += 1;
            }
            assert_eq!(follows.len(), 6);
            assert!(follows.values().all(|&count| count == 5), "{follows:?}");
        }
    }

    #[test]
    fn relabellings_are_all_permutations_in_order() {
        let three = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        assert_eq!(permutations(3), three);
        assert_eq!(permutations(4).into_iter().collect::<BTreeSet<_>>().len(), 24);
    }

    #[test]
    fn one_policy_alone_needs_no_rejection() {
        assert_eq!(Algorithm::Balanced1.draw(seed(1), 1, 3, 0), [0, 0, 0]);
    }

    #[test]
    fn names_lead_back_to_algorithms() {
        for algorithm in [Algorithm::Shuffle1, Algorithm::Balanced1] {
            assert_eq!(Algorithm::named(algorithm.name()), Some(algorithm));
            assert_eq!(serde_json::to_value(algorithm).unwrap(), algorithm.name());
        }
        assert_eq!(Algorithm::named("parfocal-shuffle-2"), None);
    }
}
