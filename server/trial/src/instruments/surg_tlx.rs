//! The Surgery Task Load Index (Wilson et al. 2011, World Journal of Surgery 35:1961, doi 10.1007/s00268-011-1141-4).
//! It consists of six ratings. The weighted form also asks, for each of the 15 pairs of dimensions, which of the two
//! contributed more to the workload. Ratings and weights are those of the NASA Task Load Index (Hart & Staveland 1988):
//! a dimension's weight is how often it was chosen, 0..=5, and the weighted index is the sum of weight times rating,
//! divided by 15.

use super::measure::Measure;
use super::workload;
use crate::question::{Pair, QuestionKind, Scale};
use parfocal_language::Language;

/// The question with its six scales. If it is `weighted`, it also has the 15 pairs. `None` where we know no published
/// translation.
pub fn question(weighted: bool, language: Language) -> Option<QuestionKind> {
    if language != Language::English {
        return None;
    }
    let scales = scales();
    let pairs = if weighted { pairs(scales.len()) } else { Vec::new() };
    Some(QuestionKind::SurgTlx { scales, pairs })
}

fn scales() -> Vec<Scale> {
    let scale = |title: &str, text: &str| workload::scale(title, text, "Low", "High");
    vec![
        scale("Mental demands", "How mentally fatiguing was the procedure?"),
        scale("Physical demands", "How physically fatiguing was the procedure?"),
        scale("Temporal demands", "How hurried or rushed was the pace of the procedure?"),
        scale("Task complexity", "How complex was the procedure?"),
        scale("Situational stress", "How anxious did you feel while performing the procedure?"),
        scale("Distractions", "How distracting was the operating environment?"),
    ]
}

/// Lists each pair of `count` scales once.
fn pairs(count: usize) -> Vec<Pair> {
    let places: Vec<u8> = (0..u8::MAX).take(count).collect();
    let later = |first: u8| places.iter().filter(move |second| **second > first);
    places.iter().flat_map(|&first| later(first).map(move |&second| Pair { first, second })).collect()
}

/// How often each of the `scales` scales was chosen. `None` if a pair is unanswered.
fn weights(scales: usize, pairs: &[Pair], choices: &[u8]) -> Option<Vec<f64>> {
    let mut weights = vec![0.0; scales];
    for (pair, choice) in pairs.iter().zip(choices) {
        let chosen = match choice {
            1 => pair.first,
            2 => pair.second,
            _ => return None,
        };
        *weights.get_mut(usize::from(chosen))? += 1.0;
    }
    Some(weights)
}

/// The six ratings and their mean. With pairs, also the six weights and the weighted index. A measure that needs a
/// missing item is missing too.
pub fn measures(scales: &[Scale], pairs: &[Pair], items: &[u8]) -> Vec<Measure> {
    let (gradations, choices) = items.split_at_checked(scales.len()).unwrap_or((items, &[]));
    let mut measures = workload::ratings(scales, gradations);
    let ratings: Vec<Option<f64>> = measures.iter().map(|rating| rating.value).collect();
    measures.push(Measure::score("raw-surg-tlx", "Raw SURG-TLX", workload::mean(&ratings)));
    if pairs.is_empty() {
        return measures;
    }

    let weights = weights(scales.len(), pairs, choices);
    for (place, scale) in scales.iter().enumerate() {
        let weight = weights.as_ref().map(|weights| weights[place]);
        let name = format!("weight-of-{}", scale.name);
        measures.push(Measure { score: true, ..Measure::item(name, format!("Weight of {}", scale.title), weight) });
    }
    let weighted = weights.and_then(|weights| weighted(&weights, &ratings));
    measures.push(Measure::score("weighted-surg-tlx", "Weighted SURG-TLX", weighted));
    measures
}

/// The sum of weight times rating, divided by the sum of the weights, which is 15. `None` if a rating is missing.
fn weighted(weights: &[f64], ratings: &[Option<f64>]) -> Option<f64> {
    let product = |(weight, rating): (&f64, &Option<f64>)| Some(weight * (*rating)?);
    let sum: f64 = weights.iter().zip(ratings).map(product).sum::<Option<f64>>()?;
    Some(sum / weights.iter().sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(items: &[u8], weighted: bool, name: &str) -> Option<f64> {
        let Some(QuestionKind::SurgTlx { scales, pairs }) = question(weighted, Language::English) else {
            panic!("no SURG-TLX")
        };
        let measures = measures(&scales, &pairs, items);
        measures.iter().find(|measure| measure.name == name).unwrap_or_else(|| panic!("{name}")).value
    }

    /// Ratings of 30, 15, 60, 40, 30 and 40. In each pair the earlier dimension is chosen, so that the weights are 5,
    /// 4, 3, 2, 1 and 0.
    const EARLIER: [u8; 21] = [7, 4, 13, 9, 7, 9, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1];

    #[test]
    fn each_pair_of_dimensions_is_compared_once() {
        let pairs = pairs(6);
        assert_eq!(pairs.len(), 15);
        assert_eq!((pairs[0], pairs[14]), (Pair { first: 0, second: 1 }, Pair { first: 4, second: 5 }));
    }

    #[test]
    fn the_weighted_index_is_the_mean_by_weights() {
        // The paper has no worked example. By hand, from its definition: 5*30 + 4*15 + 3*60 + 2*40 + 1*30 + 0*40 = 500;
        // 500 / 15 = 33.33. Without weights 215 / 6 = 35.83.
        let weighted = value(&EARLIER, true, "weighted-surg-tlx").unwrap();
        assert!((weighted - 500.0 / 15.0).abs() < 1e-9, "{weighted}");
        let raw = value(&EARLIER, true, "raw-surg-tlx").unwrap();
        assert!((raw - 215.0 / 6.0).abs() < 1e-9, "{raw}");
        assert_eq!(value(&EARLIER, true, "weight-of-mental-demands"), Some(5.0));
        assert_eq!(value(&EARLIER, true, "weight-of-distractions"), Some(0.0));

        // If the later dimension of each pair is chosen, the weights are 0, 1, 2, 3, 4 and 5.
        let mut later = EARLIER;
        later[6..].fill(2);
        let weighted = value(&later, true, "weighted-surg-tlx").unwrap();
        // 15 + 120 + 120 + 120 + 200 = 575.
        assert!((weighted - 575.0 / 15.0).abs() < 1e-9, "{weighted}");
    }

    #[test]
    fn all_at_one_rating_weigh_to_that_rating() {
        let mut items = EARLIER;
        items[..6].fill(15);
        assert_eq!(value(&items, true, "weighted-surg-tlx"), Some(70.0));
        assert_eq!(value(&items, true, "raw-surg-tlx"), Some(70.0));
    }

    #[test]
    fn what_needs_a_missing_item_is_missing() {
        let mut open_pair = EARLIER;
        open_pair[20] = 0;
        assert_eq!(value(&open_pair, true, "weighted-surg-tlx"), None);
        assert_eq!(value(&open_pair, true, "weight-of-mental-demands"), None);
        assert!(value(&open_pair, true, "raw-surg-tlx").is_some());

        let mut open_rating = EARLIER;
        open_rating[0] = 0;
        assert_eq!(value(&open_rating, true, "weighted-surg-tlx"), None);
        assert_eq!(value(&open_rating, true, "raw-surg-tlx"), None);
        assert_eq!(value(&open_rating, true, "temporal-demands"), Some(60.0));
    }
}
