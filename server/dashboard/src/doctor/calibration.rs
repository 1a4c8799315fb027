//! Checks the sensor's calibration: whether it is this camera's own, whether it fits, and how old it is.

use jiff::civil::Date;

use super::finding::Finding;
use parfocal_devices::camera::calibration::{CalibrationFault, check_camera};
use parfocal_imaging::Calibration;

const CALIBRATION: &str = "calibration";

/// Age in days above which references should be taken again: light sources and filters age.
const OLD: i32 = 180;

/// Checks the calibration in use on the day `today`. `size` is the width and height of the camera's mosaics in samples;
/// `None` means a camera that delivers colour pictures. A `simulated` camera senses like the typical sensor.
pub fn calibration(calibration: &Calibration, size: Option<(usize, usize)>, simulated: bool, today: Date) -> Finding {
    if size.is_none() {
        return Finding::well(CALIBRATION, "The camera delivers colour pictures, which need no calibration.");
    }

    let title = calibration.title();
    if let Err(fault) = check_camera(calibration, size) {
        return Finding::wrong(CALIBRATION, format!("It does not fit: {fault}."), "Follow docs/bench.md, section 3.");
    }
    if *calibration == Calibration::default() {
        let found = format!("In use: that of a typical sensor ({title}).");
        if simulated {
            return Finding::well(CALIBRATION, format!("{found} The simulated camera senses like it."));
        }
        let advice = "Take this camera's dark and white references; docs/bench.md, section 3, says how.";
        return Finding::advice(CALIBRATION, found, advice);
    }

    aged(&title, calibration.date.as_deref(), today)
}

/// The finding about a calibration that cannot be used.
pub fn unreadable_calibration(fault: &CalibrationFault) -> Finding {
    Finding::wrong(CALIBRATION, format!("It cannot be used: {fault}."), "Follow docs/bench.md, section 3.")
}

fn aged(title: &str, date: Option<&str>, today: Date) -> Finding {
    let found = format!("In use: {title}.");
    let again = "Take new references; docs/bench.md, section 3, says how.";
    let Some(taken) = date.and_then(|date| date.parse::<Date>().ok()) else {
        let found = format!("{found} It has no date.");
        return Finding::advice(CALIBRATION, found, again);
    };

    let days = (today - taken).get_days();
    match days {
        ..0 => {
            let found = format!("{found} Its date is in the future.");
            Finding::advice(CALIBRATION, found, "Compare this machine's clock with one that is right.")
        }
        0 => Finding::well(CALIBRATION, format!("{found} It is of today.")),
        1 => Finding::well(CALIBRATION, format!("{found} It is 1 day old.")),
        2..=OLD => Finding::well(CALIBRATION, format!("{found} It is {days} days old.")),
        _ => Finding::advice(CALIBRATION, format!("{found} It is {days} days old."), again),
    }
}

#[cfg(test)]
mod tests {
    use jiff::civil::date;

    use super::*;
    use crate::doctor::Verdict;

    const SENSOR: Option<(usize, usize)> = Some((2048, 1088));

    fn verdict(date: Option<&str>) -> (Verdict, String) {
        let own = Calibration { version: "3".into(), date: date.map(str::to_owned), ..Calibration::default() };
        let finding = calibration(&own, SENSOR, false, date_of_today());
        (finding.verdict, finding.found)
    }

    fn date_of_today() -> Date {
        date(2026, 3, 11)
    }

    #[test]
    fn the_age_is_reported() {
        assert!(verdict(Some("2026-03-01")).1.ends_with("It is 10 days old."));
        assert_eq!(verdict(Some("2026-03-01")).0, Verdict::Well);
        assert_eq!(verdict(Some("2026-03-11")).0, Verdict::Well);
        assert_eq!(verdict(Some("2025-03-01")).0, Verdict::Advice);
        assert_eq!(verdict(Some("2026-03-12")).0, Verdict::Advice);
        assert_eq!(verdict(Some("last week")).0, Verdict::Advice);
        assert_eq!(verdict(None).0, Verdict::Advice);
    }

    #[test]
    fn a_typical_units_is_fine_for_a_simulation_and_no_mosaic_needs_one() {
        let typical = Calibration::default();
        let of = |size, simulated| calibration(&typical, size, simulated, date_of_today()).verdict;
        assert_eq!(of(SENSOR, false), Verdict::Advice);
        assert_eq!(of(SENSOR, true), Verdict::Well);
        assert_eq!(of(None, false), Verdict::Well);

        let other = Calibration { bit_depth: 12, ..Calibration::default() };
        assert_eq!(calibration(&other, SENSOR, false, date_of_today()).verdict, Verdict::Wrong);
    }
}
