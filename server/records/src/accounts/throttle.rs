//! Slows down attempts to sign in after failed ones, separately for each account and for each peer.

use std::collections::HashMap;
use std::net::IpAddr;
use std::time::Duration;

use super::AccountError;
use parfocal_base::clock::Moment;
use parfocal_trial::account::wait_after;

/// The address from which an attempt comes.
pub type Peer = IpAddr;

/// Number of a peer's failures that cost no wait, in addition to those that are free for an account: several people may
/// share one address.
const PEERS_ALLOWANCE: u32 = 6;

/// An attempt that would have to wait longer than this is refused, so that simultaneous attempts do not pile up.
const LONGEST_WAIT: Duration = Duration::from_secs(9);

/// Failures are forgotten this long after the latest one.
const FORGOTTEN_AFTER: Duration = Duration::from_mins(15);

/// Number of names and peers that are remembered. Above this, each attempt forgets the oldest one.
const MOST: usize = 4096;

/// The recent failed attempts, by account name and by peer.
#[derive(Default)]
pub(super) struct Throttle {
    subjects: HashMap<Subject, Failures>,
}

/// The account name or the peer that attempts have in common.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Subject {
    /// The given name, whether or not there is such an account.
    Account(String),
    Peer(Peer),
}

#[derive(Debug, Clone, Copy)]
struct Failures {
    count: u32,
    /// Earliest time of the next attempt.
    next: Moment,
    latest: Moment,
}

impl Throttle {
    /// How long an attempt at `now` has to wait. This also reserves its turn, so the next attempt waits longer.
    pub(super) fn reserve(&mut self, name: &str, peer: Peer, now: Moment) -> Result<Duration, AccountError> {
        self.forget(now);
        let both = [Subject::Account(shortened(name)), Subject::Peer(peer)];
        let waits =
            both.iter().filter_map(|subject| self.subjects.get(subject)).map(|failures| failures.next.since(now));
        let wait = waits.max().unwrap_or_default();
        if wait > LONGEST_WAIT {
            return Err(AccountError::TooMany { seconds: wait.as_secs() + 1 });
        }

        for subject in both {
            let allowance = subject.allowance();
            if let Some(failures) = self.subjects.get_mut(&subject) {
                failures.next = now + wait + wait_after(failures.count.saturating_sub(allowance));
            }
        }
        Ok(wait)
    }

    /// Records that an attempt failed at `now`.
    pub(super) fn failed(&mut self, name: &str, peer: Peer, now: Moment) {
        for subject in [Subject::Account(shortened(name)), Subject::Peer(peer)] {
            let allowance = subject.allowance();
            let failures = self.subjects.entry(subject).or_insert(Failures { count: 0, next: now, latest: now });
            failures.count = failures.count.saturating_add(1);
            failures.latest = now;
            let next = now + wait_after(failures.count.saturating_sub(allowance));
            failures.next = failures.next.max(next);
        }
    }

    /// Records that an attempt succeeded: forgets the account's failures, but keeps those of the peer.
    pub(super) fn succeeded(&mut self, name: &str) {
        self.subjects.remove(&Subject::Account(shortened(name)));
    }

    fn forget(&mut self, now: Moment) {
        self.subjects.retain(|_, failures| now.since(failures.latest) < FORGOTTEN_AFTER);
        // A failure may have added two, its account and its peer.
        while self.subjects.len() > MOST {
            let oldest = self.subjects.iter().min_by_key(|(_, failures)| failures.latest);
            let Some(oldest) = oldest.map(|(subject, _)| subject.clone()) else { return };
            self.subjects.remove(&oldest);
        }
    }
}

impl Subject {
    const fn allowance(&self) -> u32 {
        match self {
            Self::Account(_) => 0,
            Self::Peer(_) => PEERS_ALLOWANCE,
        }
    }
}

/// The part of a name that is remembered. It is longer than any account's name, so no two accounts are confused.
fn shortened(name: &str) -> String {
    name.chars().take(64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PEER: Peer = IpAddr::V4(std::net::Ipv4Addr::new(192, 0, 2, 1));
    const OTHER: Peer = IpAddr::V4(std::net::Ipv4Addr::new(192, 0, 2, 2));

    fn at(seconds: u64) -> Moment {
        Moment::from_nanos(seconds * 1_000_000_000)
    }

    fn wait(throttle: &mut Throttle, name: &str, peer: Peer, seconds: u64) -> Result<u64, AccountError> {
        throttle.reserve(name, peer, at(seconds)).map(|wait| wait.as_secs())
    }

    #[test]
    fn failures_on_an_account_slow_down_the_next_attempt_from_anywhere() {
        let mut throttle = Throttle::default();
        let mut waits = Vec::new();
        for failure in 0..7 {
            let now = 100 + failure * 20;
            waits.push(wait(&mut throttle, "lead", PEER, now).unwrap());
            throttle.failed("lead", PEER, at(now));
        }
        assert_eq!(waits, [0; 7], "20 s pass between them");
        assert_eq!(wait(&mut throttle, "lead", OTHER, 220), Ok(8));
        assert_eq!(wait(&mut throttle, "other", OTHER, 220), Ok(0));
        throttle.succeeded("lead");
        assert_eq!(wait(&mut throttle, "lead", OTHER, 220), Ok(0));
    }

    #[test]
    fn attempts_made_at_one_time_take_turns_and_too_many_are_refused() {
        let mut throttle = Throttle::default();
        for _ in 0..4 {
            throttle.failed("lead", PEER, at(10));
        }
        assert_eq!(wait(&mut throttle, "lead", OTHER, 10), Ok(2));
        assert_eq!(wait(&mut throttle, "lead", OTHER, 10), Ok(4));
        assert_eq!(wait(&mut throttle, "lead", OTHER, 10), Ok(6));
        assert_eq!(wait(&mut throttle, "lead", OTHER, 10), Ok(8));
        assert_eq!(wait(&mut throttle, "lead", OTHER, 10), Err(AccountError::TooMany { seconds: 11 }));
    }

    #[test]
    fn a_peer_that_tries_many_names_is_slowed_down_later_and_forgotten_in_time() {
        let mut throttle = Throttle::default();
        for name in 0..10 {
            throttle.failed(&format!("name{name}"), PEER, at(10));
        }
        assert_eq!(wait(&mut throttle, "another", PEER, 10), Ok(2));
        assert_eq!(wait(&mut throttle, "another", PEER, 10 + 15 * 60), Ok(0));
    }
}
