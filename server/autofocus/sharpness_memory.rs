//! What a policy remembers of the sharpness that it has seen at each focal power, as evidence about
//! where the optimum is.

use super::networks::BINS;

/// Frames that a sight is remembered for, at least in part: a second and more at the 25 frames a
/// second of scans, in which a hand moves the view by a part of it.
const SPAN: u32 = 30;
/// Differences of sharpness, as differences of logarithms, that are no evidence: a view that moves
/// a little changes as much.
const FLOOR: f32 = 0.2;
/// How many times less likely a place becomes, as a logarithm, for each unit by which it was less
/// sharp than another.
const WEIGHT: f32 = 10.0;

/// The sharpness last seen at each of [`BINS`] places of focal power.
///
/// A network that was trained in simulation is surer of its belief on real glass than it should be.
/// Of two places that were both seen within the last second, the sharper one is nearer to the
/// optimum whatever the optic is: this says so where the belief does not.
#[derive(Debug, Clone)]
pub struct SharpnessMemory {
    /// Frames so far.
    frame: u32,
    seen: [Option<Sight>; BINS],
}

#[derive(Debug, Clone, Copy)]
struct Sight {
    frame: u32,
    /// The logarithm of the mean gradient magnitude.
    sharpness: f32,
}

impl Default for SharpnessMemory {
    fn default() -> Self {
        Self { frame: 0, seen: [None; BINS] }
    }
}

impl SharpnessMemory {
    /// Takes in a frame seen at `focal_power` (0..=1) whose mean gradient magnitude has the
    /// logarithm `sharpness`.
    pub fn see(&mut self, focal_power: f32, sharpness: f32) {
        self.frame += 1;
        let bin = (focal_power.clamp(0.0, 1.0) * (BINS - 1) as f32).round() as usize;
        self.seen[bin] = Some(Sight { frame: self.frame, sharpness });
    }

    /// Makes the places that were seen less sharp than others less likely under `belief` (one value
    /// a bin, with sum 1, as it has afterwards). What is older counts less.
    pub fn weigh(&self, belief: &mut [f32]) {
        let mut total = 0.0;
        for (share, seen) in belief.iter_mut().zip(&self.seen) {
            if let Some(sight) = seen {
                *share *= (-WEIGHT * self.evidence_against(*sight)).exp();
            }
            total += *share;
        }

        for share in belief {
            *share /= total;
        }
    }

    /// By how much another place was sharper than this `sight`, beyond the floor, as far as both are
    /// remembered.
    fn evidence_against(&self, sight: Sight) -> f32 {
        let freshness = self.freshness(sight);
        let against = |other: Sight| freshness * self.freshness(other) * (other.sharpness - sight.sharpness - FLOOR);
        self.seen.iter().flatten().map(|&other| against(other)).fold(0.0, f32::max)
    }

    /// How much of a sight is remembered: 1 in the frame itself, nothing after [`SPAN`] frames.
    fn freshness(&self, sight: Sight) -> f32 {
        let age = self.frame - sight.frame;
        1.0 - age.min(SPAN + 1) as f32 / (SPAN + 1) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVEN: [f32; BINS] = [1.0 / BINS as f32; BINS];

    /// The belief after `sights` (focal power, sharpness) and then `frames` more at the last of them.
    fn weighed(sights: &[(f32, f32)], frames: usize) -> [f32; BINS] {
        let mut memory = SharpnessMemory::default();
        let last = sights.last().copied();
        for (focal_power, sharpness) in sights.iter().copied().chain(last.into_iter().cycle().take(frames)) {
            memory.see(focal_power, sharpness);
        }
        let mut belief = EVEN;
        memory.weigh(&mut belief);
        belief
    }

    #[test]
    fn the_less_sharp_of_two_places_becomes_less_likely() {
        // A unit of sharpness less, one frame ago: exp(-10 (1 - 0.2) 30/31) of what it was.
        let belief = weighed(&[(0.25, 2.0), (0.75, 3.0)], 0);
        let ratio = belief[10] / belief[30];
        assert!((ratio.ln() - -8.0 * 30.0 / 31.0).abs() < 1e-4, "{ratio}");
        // A place that was not seen is as likely as the sharpest that was.
        assert!((belief[20] - belief[30]).abs() < f32::EPSILON);
        assert!((belief.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_small_difference_says_nothing() {
        let belief = weighed(&[(0.25, 2.85), (0.75, 3.0)], 0);
        assert!(belief.iter().zip(EVEN).all(|(share, even)| (share - even).abs() < 1e-7));
    }

    #[test]
    fn what_was_seen_long_ago_is_forgotten() {
        let after = |frames| weighed(&[(0.25, 2.0), (0.75, 3.0)], frames)[10];
        assert!(after(0) < after(15) && after(15) < after(29));
        assert!((after(31) - after(100)).abs() < f32::EPSILON && (after(31) - EVEN[10]).abs() < 1e-7);
    }
}
