//! The common parts of the task load indices: scales of twenty intervals. A surgeon marks one of the 21 gradations,
//! which count from 0 to 100 in steps of 5 (Hart & Staveland 1988, in Human Mental Workload, pages 139-183).

use super::measure::{MISSING, Measure, given};
use crate::question::Scale;

/// Number of gradations of a scale, ends included.
pub const GRADATIONS: u8 = 21;

/// Difference between the ratings of two neighbouring gradations.
const STEP: f64 = 5.0;

/// Whether `items` are the gradations of `scales` scales (1 to 21) and then the choices of `pairs` pairs (1 or 2).
/// Some, but not all, may be 0, which means not given.
pub fn fits(items: &[u8], scales: usize, pairs: usize) -> bool {
    let highest = std::iter::repeat_n(GRADATIONS, scales).chain(std::iter::repeat_n(2, pairs));
    items.len() == scales + pairs
        && items.iter().zip(highest).all(|(item, highest)| *item <= highest)
        && items.iter().any(|item| *item > 0)
}

/// The rating at a gradation, 0..=100; none if no gradation was marked.
pub fn rating(gradation: u8) -> Option<f64> {
    given(gradation).map(|gradation| (gradation - 1.0) * STEP)
}

/// The rating of each scale, as measures.
pub fn ratings(scales: &[Scale], items: &[u8]) -> Vec<Measure> {
    let measure = |(scale, &item): (&Scale, &u8)| Measure::item(&scale.name, &scale.title, rating(item));
    scales.iter().zip(items).map(measure).collect()
}

/// The mean of all ratings: the index without weights. `None` if a rating is missing.
pub fn mean(ratings: &[Option<f64>]) -> Option<f64> {
    let ratings: Vec<f64> = ratings.iter().copied().collect::<Option<_>>()?;
    (!ratings.is_empty()).then(|| ratings.iter().sum::<f64>() / ratings.len() as f64)
}

/// Each scale with its rating, in words.
pub fn in_words(scales: &[Scale], items: &[u8]) -> String {
    let part = |(scale, &item): (&Scale, &u8)| {
        let rating = rating(item).map_or_else(|| MISSING.to_owned(), |rating| rating.to_string());
        format!("{} {rating}", scale.title)
    };
    scales.iter().zip(items).map(part).collect::<Vec<_>>().join(", ")
}

/// Makes a scale. Its name in exports is its title in lower case, with dashes for spaces.
pub fn scale(title: &str, text: &str, low: &str, high: &str) -> Scale {
    Scale {
        name: title.to_lowercase().replace(' ', "-"),
        title: title.to_owned(),
        text: text.to_owned(),
        low: low.to_owned(),
        high: high.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradations_count_from_0_to_100_in_steps_of_5() {
        assert_eq!([1, 2, 11, 21].map(rating), [Some(0.0), Some(5.0), Some(50.0), Some(100.0)]);
        assert_eq!(rating(0), None);
    }

    #[test]
    fn a_part_fits_but_nothing_and_what_is_beyond_the_scale_does_not() {
        assert!(fits(&[0, 21], 2, 0) && fits(&[0, 21, 2], 2, 1) && fits(&[0, 0, 1], 2, 1));
        assert!(!fits(&[0, 22], 2, 0) && !fits(&[0, 0], 2, 0) && !fits(&[1], 2, 0) && !fits(&[1, 1, 3], 2, 1));
    }

    #[test]
    fn a_missing_rating_leaves_no_mean() {
        assert_eq!(mean(&[Some(10.0), Some(20.0)]), Some(15.0));
        assert_eq!(mean(&[Some(10.0), None]), None);
        assert_eq!(mean(&[]), None);
    }
}
