//! Whether a page still answers, and how long an answer takes.

use std::time::Duration;

use axum::extract::ws::Message;
use bytes::Bytes;
use tokio::time::{Interval, MissedTickBehavior, interval};

use parfocal_base::clock::Moment;

/// Interval of pings. Browsers answer them by themselves, and the time of the answer is the network's round trip.
const PING: Duration = Duration::from_secs(1);

/// Pings from one heartbeat to the next. Pages do not hear of pings, so they get this message as well.
const PINGS_A_BEAT: u64 = 5;

/// A page that stays silent through this many pings is gone.
const PATIENT_PINGS: u32 = 10;

/// The pings of one page.
pub(super) struct Heartbeat {
    /// When the next ping is due.
    pub(super) due: Interval,
    /// Pings sent so far, and when the last one was.
    pings: u64,
    pinged_at: Moment,
    /// Pings since the page last sent anything.
    silent: u32,
}

impl Heartbeat {
    pub(super) fn new(now: Moment) -> Self {
        let mut due = interval(PING);
        due.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Self { due, pings: 0, pinged_at: now, silent: 0 }
    }

    /// Whether the first ping was sent.
    pub(super) const fn has_begun(&self) -> bool {
        self.pings > 0
    }

    /// The next ping, and whether a beat goes with it; `None` if the page has been silent for too long.
    pub(super) fn ping(&mut self, now: Moment) -> Option<(Message, bool)> {
        self.silent += 1;
        if self.silent > PATIENT_PINGS {
            return None;
        }

        let beats = self.pings.is_multiple_of(PINGS_A_BEAT);
        self.pings += 1;
        self.pinged_at = now;
        Some((Message::Ping(Bytes::copy_from_slice(&self.pings.to_be_bytes())), beats))
    }

    /// Notes that the page sent something.
    pub(super) const fn heard(&mut self) {
        self.silent = 0;
    }

    /// How long the last ping took, if `payload` answers it. The answer to an earlier ping, or to none, says nothing.
    pub(super) fn answered(&self, payload: &[u8], now: Moment) -> Option<Duration> {
        (payload == self.pings.to_be_bytes()).then(|| now.since(self.pinged_at))
    }
}
