//! Checks the server's certificate: whether tablets and laptops accept it, and for how long.

use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};

use super::finding::Finding;

const CERTIFICATE: &str = "certificate";

/// The finding warns of a certificate that ends within this time. A local one is renewed earlier, so this happens to it
/// only if renewal has failed.
const SOON: SignedDuration = SignedDuration::from_hours(30 * 24);

/// Checks a certificate that is valid until `until`. `local`: whether the server's own authority signed it.
pub fn certificate(until: Timestamp, local: bool, now: Timestamp) -> Finding {
    let day = until.to_zoned(TimeZone::system()).date();
    let left = until.duration_since(now);
    let renew = if local {
        "The server renews it by itself, and its log says why that failed. Look there, and set this machine's clock."
    } else {
        "Put a new certificate and key in place of both files. The server takes them within a minute."
    };

    if left <= SignedDuration::ZERO {
        let found = format!("The server's certificate ended on {day}, so tablets and laptops refuse the server.");
        return Finding::wrong(CERTIFICATE, found, renew);
    }
    if left < SOON {
        let found = format!("The server's certificate ends on {day}. Tablets and laptops then refuse the server.");
        return Finding::advice(CERTIFICATE, found, renew);
    }
    Finding::well(CERTIFICATE, format!("The server's certificate is valid until {day}."))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn a_certificate_is_reported_a_month_before_its_end_and_wrong_after_it() {
        let until: Timestamp = "2026-07-01T12:00:00Z".parse().unwrap();
        let at = |now: &str| certificate(until, false, now.parse().unwrap());
        assert_eq!(at("2026-06-01T11:00:00Z").verdict, Verdict::Well);
        assert_eq!(at("2026-06-01T13:00:00Z").verdict, Verdict::Advice);
        assert_eq!(at("2026-07-01T11:59:59Z").verdict, Verdict::Advice);

        let ended = at("2026-07-01T12:00:00Z");
        assert_eq!(ended.verdict, Verdict::Wrong);
        assert!(ended.found.contains("ended on 2026-07-01") && ended.advice.unwrap().contains("new certificate"));
    }

    #[test]
    fn nobody_is_sent_for_files_that_the_server_makes_itself() {
        let until: Timestamp = "2026-07-01T12:00:00Z".parse().unwrap();
        let finding = certificate(until, true, "2026-08-01T00:00:00Z".parse().unwrap());
        assert!(finding.advice.unwrap().contains("renews it by itself"));
    }
}
