//! The NASA Task Load Index without weights, "raw TLX": the mean of six ratings from 0 to 100 in steps of 5 (Hart &
//! Staveland 1988; without weights: Hart 2006, Proceedings of the Human Factors and Ergonomics Society 50:904). The
//! scales and their wording are those of NASA's form.

use super::measure::Measure;
use super::workload;
use crate::question::{QuestionKind, Scale};

/// The question with its six scales.
#[must_use]
pub fn question() -> QuestionKind {
    QuestionKind::NasaTlx { scales: scales() }
}

fn scales() -> Vec<Scale> {
    let from_low = |title: &str, text: &str| workload::scale(title, text, "Very low", "Very high");
    vec![
        from_low("Mental demand", "How mentally demanding was the task?"),
        from_low("Physical demand", "How physically demanding was the task?"),
        from_low("Temporal demand", "How hurried or rushed was the pace of the task?"),
        workload::scale(
            "Performance",
            "How successful were you in accomplishing what you were asked to do?",
            "Perfect",
            "Failure",
        ),
        from_low("Effort", "How hard did you have to work to accomplish your level of performance?"),
        from_low("Frustration", "How insecure, discouraged, irritated, stressed and annoyed were you?"),
    ]
}

/// The six ratings and their mean. The mean is missing if a rating is.
#[must_use]
pub fn measures(scales: &[Scale], items: &[u8]) -> Vec<Measure> {
    let mut measures = workload::ratings(scales, items);
    let ratings: Vec<Option<f64>> = measures.iter().map(|rating| rating.value).collect();
    measures.push(Measure::score("raw-tlx", "Raw TLX", workload::mean(&ratings)));
    measures
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw_tlx(items: &[u8]) -> Option<f64> {
        measures(&scales(), items).last().unwrap().value
    }

    #[test]
    fn the_score_is_the_mean_of_the_six_ratings() {
        // We found no published worked example of the unweighted index. Computed by hand from its definition:
        // gradations 7, 4, 13, 9, 7 and 9 of 21 are ratings of 30, 15, 60, 40, 30 and 40; 215 / 6 = 35.83.
        let score = raw_tlx(&[7, 4, 13, 9, 7, 9]).unwrap();
        assert!((score - 215.0 / 6.0).abs() < 1e-9, "{score}");
        assert_eq!(raw_tlx(&[1; 6]), Some(0.0));
        assert_eq!(raw_tlx(&[21; 6]), Some(100.0));
    }

    #[test]
    fn a_missing_rating_leaves_the_others_and_no_score() {
        let measures = measures(&scales(), &[7, 0, 13, 9, 7, 9]);
        let values: Vec<Option<f64>> = measures.iter().map(|measure| measure.value).collect();
        assert_eq!(values, [Some(30.0), None, Some(60.0), Some(40.0), Some(30.0), Some(40.0), None]);
        assert_eq!(measures[1].name, "physical-demand");
    }
}
