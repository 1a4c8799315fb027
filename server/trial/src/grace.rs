//! The grace period after a session's end: comments and answers that a surgeon's device still holds count if they
//! arrive in it. After it, nothing changes any more.

use std::fmt;
use std::time::Duration;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::event::EventKind;

/// Length of the grace period if the protocol gives none.
pub const DEFAULT_GRACE: Duration = Duration::from_mins(30);

/// Decides whether comments and answers that arrive for a session still count. Times are by the server's clocks, and
/// continue over its restarts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grace {
    length: Duration,
    ended: Option<Timestamp>,
    unblinded: Option<Timestamp>,
    locked: Option<Timestamp>,
}

impl Grace {
    /// The grace of a new session whose protocol gives `length`.
    pub const fn new(length: Duration) -> Self {
        Self { length, ended: None, unblinded: None, locked: None }
    }

    /// Applies an event that happened at `at`.
    pub fn apply(&mut self, kind: &EventKind, at: Timestamp) {
        match kind {
            EventKind::Completed | EventKind::Aborted { .. } => self.ended = Some(at),
            EventKind::Unblinded { .. } => self.unblinded = Some(at),
            _ => {}
        }
    }

    /// The same grace, with the time at which the session's study was locked; none if it was not.
    #[must_use]
    pub const fn locked(self, at: Option<Timestamp>) -> Self {
        Self { locked: at, ..self }
    }

    /// The end of the grace period; none while the session is under way. Unblinding the session or locking its study
    /// ends the period at once. If the session was unblinded while under way, the period ends with the session.
    pub fn until(&self) -> Option<Timestamp> {
        let ended = self.ended?;
        let over = ended.saturating_add(self.length).unwrap_or(Timestamp::MAX);
        let ends = [self.unblinded, self.locked];
        Some(ends.into_iter().flatten().fold(over, |over, end| over.min(end.max(ended))))
    }

    /// Whether a comment or answer that arrives at `at` is too late to count.
    pub fn is_late(&self, at: Timestamp) -> bool {
        let closed = self.unblinded.is_some() || self.locked.is_some();
        self.until().is_some_and(|until| closed || at > until)
    }

    /// What unblinding at `now` could prevent from counting. `None` if there is nothing, and also while the session is
    /// under way, because unblinding then ends no grace period. `devices` are the surgeons' devices: how many comments
    /// and answers each held when it last reported, and when that was.
    pub fn outstanding(
        &self,
        now: Timestamp,
        devices: impl IntoIterator<Item = Option<(u32, Timestamp)>>,
    ) -> Option<Outstanding> {
        let ended = self.ended?;
        if self.unblinded.is_some() || self.locked.is_some() {
            return None;
        }
        let empty_since_the_end = |(holding, told): (u32, Timestamp)| holding == 0 && told >= ended;
        let devices = devices.into_iter().filter(|told| !told.is_some_and(empty_since_the_end)).count();
        let counts_until = self.until().filter(|until| now <= *until);
        (counts_until.is_some() || devices > 0).then_some(Outstanding { counts_until, devices })
    }
}

/// What may still arrive for a session that has ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Outstanding {
    /// Until when, by the server's clock, arrivals count; none once that time is over.
    #[schema(value_type = Option<String>)]
    pub counts_until: Option<Timestamp>,
    /// Number of surgeons' devices that have not reported since the end that they hold nothing more.
    pub devices: usize,
}

impl fmt::Display for Outstanding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(until) = self.counts_until {
            write!(f, "what a surgeon's device still holds counts until {until:.0}")?;
        }
        if self.devices > 0 {
            let and = if self.counts_until.is_some() { ", and " } else { "" };
            let devices = if self.devices == 1 { "device has" } else { "devices have" };
            let count = self.devices;
            write!(f, "{and}{count} surgeon's {devices} not reported since the end that nothing is left on it")?;
        }

        f.write_str("; what arrives after unblinding is kept, but marked late, and never counts")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(minutes: u64) -> Timestamp {
        Timestamp::UNIX_EPOCH + Duration::from_mins(minutes)
    }

    fn unblinded(emergency: bool) -> EventKind {
        EventKind::Unblinded { reason: String::new(), emergency }
    }

    #[test]
    fn what_arrives_within_the_grace_counts_and_nothing_after_it() {
        let mut grace = Grace::new(DEFAULT_GRACE);
        assert!(!grace.is_late(at(1_000_000)), "nothing is late while the session is under way");
        grace.apply(&EventKind::Completed, at(100));
        assert_eq!(grace.until(), Some(at(130)));
        assert!(!grace.is_late(at(130)) && grace.is_late(at(131)));
    }

    #[test]
    fn unblinding_ends_the_grace_at_once_and_an_emergency_ends_it_with_the_session() {
        let mut grace = Grace::new(DEFAULT_GRACE);
        grace.apply(&EventKind::Completed, at(100));
        grace.apply(&unblinded(false), at(110));
        assert!(grace.is_late(at(110)));
        assert_eq!(grace.until(), Some(at(110)));

        let mut emergency = Grace::new(DEFAULT_GRACE);
        emergency.apply(&unblinded(true), at(90));
        assert!(!emergency.is_late(at(95)), "the session goes on, and so do its answers");
        emergency.apply(&EventKind::Completed, at(100));
        assert!(emergency.is_late(at(100)));
        assert_eq!(emergency.until(), Some(at(100)));
    }

    #[test]
    fn something_is_outstanding_while_it_would_count_or_a_device_has_not_said_that_it_is_empty() {
        let mut grace = Grace::new(DEFAULT_GRACE);
        assert_eq!(grace.outstanding(at(0), [None]), None, "an emergency does not wait for answers");
        grace.apply(&EventKind::Completed, at(100));
        let outstanding = |now, devices: &[Option<(u32, Timestamp)>]| grace.outstanding(now, devices.iter().copied());
        let within = Some(Outstanding { counts_until: Some(at(130)), devices: 0 });
        assert_eq!(outstanding(at(101), &[Some((0, at(100)))]), within);
        assert_eq!(outstanding(at(131), &[Some((0, at(100)))]), None);
        for silent in [None, Some((1, at(105))), Some((0, at(99)))] {
            let after = Some(Outstanding { counts_until: None, devices: 1 });
            assert_eq!(outstanding(at(131), &[silent, Some((0, at(101)))]), after);
        }
    }
}
