//! The System Usability Scale (Brooke 1996, "SUS: a quick and dirty usability scale", in Usability Evaluation in
//! Industry).

use super::measure::{Measure, given};

/// Number of items.
pub const ITEMS: usize = 10;

/// Whether `items` are points of all items (1 to 5), or of some of them (0 for the others).
#[must_use]
pub fn fits(items: &[u8]) -> bool {
    items.len() == ITEMS && items.iter().all(|item| *item <= 5) && items.iter().any(|item| *item > 0)
}

/// The score, 0..=100 in steps of 2.5, of ten items from 1 (strongly disagree) to 5 (strongly agree): odd items count
/// `item - 1`, even ones `5 - item`, and the sum is multiplied by 2.5 (Brooke 1996). `None` if an item is missing.
/// Brooke asks respondents to mark the middle point instead of omitting an item; we leave that to the surgeon.
#[must_use]
pub fn score(items: &[u8]) -> Option<f64> {
    if items.len() != ITEMS || !items.iter().all(|item| (1..=5).contains(item)) {
        return None;
    }
    let sum: u8 = items.iter().enumerate().map(|(i, item)| if i % 2 == 0 { item - 1 } else { 5 - item }).sum();
    Some(f64::from(sum) * 2.5)
}

/// The ten items and the score.
#[must_use]
pub fn measures(items: &[u8]) -> Vec<Measure> {
    let item = |(number, &point): (usize, &u8)| {
        Measure::item(format!("item-{number}"), format!("Item {number}"), given(point))
    };
    let mut measures: Vec<Measure> = (1..).zip(items).map(item).collect();
    measures.push(Measure::score("sus-score", "SUS score", score(items)));
    measures
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_score_is_that_of_the_papers_example() {
        // The completed form in Brooke 1996: contributions 4+1+1+4+1+2+1+1+4+3 = 22; 22 * 2.5 = 55.
        assert_eq!(score(&[5, 4, 2, 1, 2, 3, 2, 4, 5, 2]), Some(55.0));
    }

    #[test]
    fn the_score_goes_from_0_to_100_and_needs_every_item() {
        assert_eq!(score(&[5, 1, 5, 1, 5, 1, 5, 1, 5, 1]), Some(100.0));
        assert_eq!(score(&[1, 5, 1, 5, 1, 5, 1, 5, 1, 5]), Some(0.0));
        assert_eq!(score(&[3; 10]), Some(50.0));
        // By hand: odd items (4+3+4+2+4) - 5 = 12, even items 25 - (2+1+3+2+2) = 15; 27 * 2.5 = 67.5.
        assert_eq!(score(&[4, 2, 3, 1, 4, 3, 2, 2, 4, 2]), Some(67.5));
        assert_eq!(score(&[3; 9]), None);
        assert_eq!(score(&[0; 10]), None);
    }

    #[test]
    fn a_missing_item_is_missing_and_so_is_the_score() {
        let measures = measures(&[4, 2, 3, 0, 4, 3, 2, 2, 4, 2]);
        assert_eq!((measures[2].value, measures[3].value), (Some(3.0), None));
        let score = measures.last().unwrap();
        assert_eq!((score.name.as_str(), score.value, score.score), ("sus-score", None, true));
    }
}
