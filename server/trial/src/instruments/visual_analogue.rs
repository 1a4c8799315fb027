//! A visual analogue scale: a line with named ends and no marks between them (Hayes & Patterson 1921, Psychological
//! Bulletin 18:98). The answer is the distance from the lower end in hundredths of the line, that is, in millimetres of
//! the usual line of 100 mm. A line that was not touched has no answer.

use super::measure::Measure;

/// The highest answer: the upper end of the line.
pub const LONGEST: u8 = 100;

/// Whether `place` is on the line.
pub const fn fits(place: u8) -> bool {
    place <= LONGEST
}

/// The place on the line, 0..=100. 0 is the lower end, not a missing answer.
pub fn measures(place: u8) -> Vec<Measure> {
    vec![Measure::item("position", "Position, 0 to 100", Some(f64::from(place)))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lower_end_is_an_answer_and_beyond_the_upper_end_is_none() {
        assert_eq!(measures(0)[0].value, Some(0.0));
        assert!(fits(0) && fits(100) && !fits(101));
    }
}
