//! Whether the policy believes that the patch is held in focus.

use std::time::Duration;

use serde::Serialize;

use parfocal_autofocus::belief::{SURE, Sides};
use parfocal_base::clock::Moment;
use parfocal_base::{FocalPower, IN_FOCUS};

/// A patch that is held counts as held until its probability of being in focus is less than this.
const LET_GO: f64 = 0.6;
/// A belief that gives no range of twice [`IN_FOCUS`] at least this probability knows nothing. One that is equally
/// likely everywhere gives each about 0.2.
const KNOWS: f64 = 0.35;
/// A new state is told once it has lasted this long, so that the sign neither flickers nor chatters.
const SETTLED: Duration = Duration::from_millis(800);

/// What the policy's belief says of the focus.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FocusLock {
    /// The patch is held in focus.
    Held,
    /// The policy searches for the focus.
    Searching,
    /// There is nothing to tell: the policy has no belief, or its belief knows nothing, as where the patch shows no
    /// detail, or nothing drives the lens.
    #[default]
    Nothing,
}

/// Follows the belief from frame to frame.
///
/// The rule: the patch is held in focus from where the belief is [`SURE`] that the optimum is within [`IN_FOCUS`] of the
/// lens's focal power, until that is less likely than [`LET_GO`]. Otherwise the policy searches, or knows nothing. What
/// is found counts after it has lasted for [`SETTLED`].
#[derive(Debug, Default)]
pub struct LockWatch {
    told: FocusLock,
    /// What was found instead, and since when.
    other: Option<(FocusLock, Moment)>,
}

impl LockWatch {
    /// Takes in the `belief` after a frame, with the lens at `focal_power`. Returns what to tell.
    pub fn see(&mut self, belief: Option<&[f32]>, focal_power: FocalPower, now: Moment) -> FocusLock {
        let found = self.judge(belief, focal_power.get());
        if found == self.told {
            self.other = None;
            return self.told;
        }

        let since = self.other.filter(|(other, _)| *other == found).map_or(now, |(_, since)| since);
        self.other = Some((found, since));
        if now.since(since) >= SETTLED {
            self.told = found;
            self.other = None;
        }
        self.told
    }

    /// What was told last.
    pub const fn told(&self) -> FocusLock {
        self.told
    }

    fn judge(&self, belief: Option<&[f32]>, focal_power: f64) -> FocusLock {
        let Some(belief) = belief.filter(|belief| belief.len() > 1) else { return FocusLock::Nothing };
        let needed = if self.told == FocusLock::Held { LET_GO } else { SURE };

        if Sides::of(belief, focal_power).here >= needed {
            FocusLock::Held
        } else if likeliest_range(belief) >= KNOWS {
            FocusLock::Searching
        } else {
            FocusLock::Nothing
        }
    }
}

/// The greatest probability of a range of twice [`IN_FOCUS`].
fn likeliest_range(belief: &[f32]) -> f64 {
    let reach = ((IN_FOCUS * (belief.len() - 1) as f64).ceil() as usize).saturating_sub(1);
    let width = (2 * reach + 1).min(belief.len());

    let mut range: f64 = belief[..width].iter().copied().map(f64::from).sum();
    let mut greatest = range;
    for (leaving, entering) in belief.iter().zip(&belief[width..]) {
        range += f64::from(*entering) - f64::from(*leaving);
        greatest = greatest.max(range);
    }
    greatest
}

#[cfg(test)]
mod tests {
    use super::*;

    const BINS: usize = 41;

    /// A belief that gives `share` to the focal power 0.5 and the rest equally to all.
    fn peaked(share: f32) -> [f32; BINS] {
        let mut belief = [(1.0 - share) / BINS as f32; BINS];
        belief[20] += share;
        belief
    }

    /// What is told after each of `seconds` of `belief`, 25 frames a second, from the frame `first` on.
    fn told(watch: &mut LockWatch, belief: Option<&[f32]>, at: f64, frames: std::ops::Range<u64>) -> Vec<FocusLock> {
        let power = FocalPower::nearest(at);
        frames.map(|frame| watch.see(belief, power, Moment::from_nanos(frame * 40_000_000))).collect()
    }

    #[test]
    fn a_sure_belief_at_the_lens_is_a_lock_and_elsewhere_a_search() {
        let sure = peaked(0.9);
        for (at, expected) in [
            (0.5, FocusLock::Held),
            (0.59, FocusLock::Held),
            (0.41, FocusLock::Held),
            (0.61, FocusLock::Searching),
            (0.0, FocusLock::Searching),
        ] {
            let found = told(&mut LockWatch::default(), Some(&sure), at, 0..30);
            assert_eq!(found.last(), Some(&expected), "at {at}");
        }
    }

    #[test]
    fn without_a_belief_or_with_one_that_knows_nothing_there_is_nothing_to_tell() {
        let flat = [1.0 / BINS as f32; BINS];
        for belief in [None, Some(&flat[..]), Some(&[1.0][..]), Some(&[][..])] {
            let mut watch = LockWatch::default();
            told(&mut watch, Some(&peaked(0.9)), 0.5, 0..30);
            assert_eq!(told(&mut watch, belief, 0.5, 30..60).last(), Some(&FocusLock::Nothing), "{belief:?}");
        }
    }

    #[test]
    fn a_state_is_told_once_it_has_lasted() {
        let mut watch = LockWatch::default();
        let found = told(&mut watch, Some(&peaked(0.9)), 0.5, 0..30);
        // 20 frames of 40 ms are 800 ms.
        assert_eq!(found.iter().filter(|lock| **lock == FocusLock::Nothing).count(), 20);

        // A few frames without a belief, and a glance aside, are not told.
        assert!(told(&mut watch, None, 0.5, 30..45).iter().all(|lock| *lock == FocusLock::Held));
        assert!(told(&mut watch, Some(&peaked(0.9)), 0.9, 45..60).iter().all(|lock| *lock == FocusLock::Held));
    }

    #[test]
    fn a_lock_is_kept_with_less_than_it_takes_to_get_it() {
        // 0.6 + 0.4 * 7 / 41, seven values being within the range, is 0.67: enough to stay, not enough to begin.
        let doubtful = peaked(0.6);
        let mut watch = LockWatch::default();
        assert_eq!(told(&mut watch, Some(&doubtful), 0.5, 0..30).last(), Some(&FocusLock::Searching));
        told(&mut watch, Some(&peaked(0.9)), 0.5, 30..60);
        assert_eq!(told(&mut watch, Some(&doubtful), 0.5, 60..90).last(), Some(&FocusLock::Held));
        assert_eq!(told(&mut watch, Some(&peaked(0.45)), 0.5, 90..120).last(), Some(&FocusLock::Searching));
    }

    #[test]
    fn a_belief_of_any_length_is_judged() {
        // Of three values each stands alone, of 4096 some 800 make a range.
        assert!((likeliest_range(&[0.2, 0.5, 0.3]) - 0.5).abs() < 1e-6);
        assert!((likeliest_range(&[1.0 / 4096.0; 4096]) - 0.2).abs() < 0.001);
    }
}
