//! What every page says about the program: its name and version, and the time zone of the times that the server writes.

use jiff::Timestamp;
use jiff::tz::TimeZone;

/// Name and version.
pub(super) const PROGRAM: &str = parfocal_base::SOFTWARE;

/// The server's time zone, in which the researcher's pages give all times, such as `Europe/London`.
pub(super) fn zone() -> String {
    let zone = TimeZone::system();
    match zone.iana_name() {
        Some(name) => name.to_owned(),
        None => Timestamp::UNIX_EPOCH.to_zoned(zone).strftime("UTC%:z").to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_has_a_version_and_its_zone_a_name() {
        assert!(PROGRAM.starts_with("parfocal ") && PROGRAM.contains('.'));
        assert!(!zone().is_empty());
    }
}
