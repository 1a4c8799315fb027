//! Ranks within a block, doubled so that they are whole numbers even if equal values share their mean rank.

/// Relative difference up to which two values count as equal: means of the same ratings, summed in another order,
/// differ by rounding.
const ROUNDING: f64 = 1e-12;

/// Twice the rank of each of `values`: 2 for the lowest if no other equals it. The doubled ranks of a block of k values
/// sum to k (k + 1).
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
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}
