//! A Likert scale: the answer is a point on a scale on which either the ends or all points are named (Likert 1932,
//! Archives of Psychology 140). Points are numbered from 1.

use super::measure::{Measure, given};

/// The point as a measure.
pub fn measures(point: u8) -> Vec<Measure> {
    vec![Measure::item("point", "Point", given(point))]
}

/// The point, with its label if it has one.
pub fn in_words(labels: &[String], point: u8) -> String {
    match usize::from(point).checked_sub(1).and_then(|place| labels.get(place)) {
        Some(label) => format!("{point} ({label})"),
        None => point.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_labelled_point_says_what_it_means() {
        let labels = ["Never", "Sometimes", "Always"].map(str::to_owned);
        assert_eq!(in_words(&labels, 2), "2 (Sometimes)");
        assert_eq!(in_words(&[], 2), "2");
        assert_eq!(measures(2)[0].value, Some(2.0));
    }
}
