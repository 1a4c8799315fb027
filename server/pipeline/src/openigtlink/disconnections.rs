//! What the log says of clients that were disconnected. A program that connects again and again must not fill it, so it
//! has each reason once a minute, with how often it came meanwhile. Addresses are for the debug log alone.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use parfocal_base::clock::Moment;

/// Least time between two lines with the same reason.
const EVERY: Duration = Duration::from_mins(1);

/// The disconnections so far, by reason.
#[derive(Default)]
pub struct Disconnections(Mutex<BTreeMap<&'static str, Reported>>);

/// How often a reason was reported.
struct Reported {
    /// When the log last had it.
    at: Moment,
    /// How often it has come since.
    since: u64,
}

impl Disconnections {
    /// Logs at `now` that the client at `peer` was disconnected because of `why`, unless the log had that just before.
    pub fn log(&self, now: Moment, peer: SocketAddr, why: &'static str) {
        tracing::debug!(%peer, why, "an OpenIGTLink client was disconnected");
        match self.due(now, why) {
            None => {}
            Some(0) => tracing::warn!("OpenIGTLink: a client was disconnected: {why}"),
            Some(more) => {
                tracing::warn!(
                    "OpenIGTLink: a client was disconnected: {why}; so were {more} since this was last logged"
                );
            }
        }
    }

    /// If a line about `why` is due: how many disconnections had none since the last one.
    fn due(&self, now: Moment, why: &'static str) -> Option<u64> {
        let mut reported = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match reported.get_mut(why) {
            Some(last) if now.since(last.at) < EVERY => {
                last.since += 1;
                None
            }
            last => {
                let unsaid = last.map_or(0, |last| last.since);
                reported.insert(why, Reported { at: now, since: 0 });
                Some(unsaid)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_is_logged_once_a_minute_with_how_often_it_came_since() {
        let disconnections = Disconnections::default();
        let due = |seconds: u64, why| disconnections.due(Moment::from_nanos(seconds * 1_000_000_000), why);
        assert_eq!(due(0, "stuck"), Some(0));
        assert_eq!(due(1, "stuck"), None);
        assert_eq!(due(2, "too many"), Some(0));
        assert_eq!(due(59, "stuck"), None);
        assert_eq!(due(60, "stuck"), Some(2));
        assert_eq!(due(119, "stuck"), None);
        assert_eq!(due(300, "too many"), Some(0));
    }
}
