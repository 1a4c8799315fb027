//! A memory of the sharpness seen at each focal power, used as evidence about the optimum.

use crate::networks::BINS;

/// Frames for which an observation counts, at least in part. At the 25 frames per second of scans this is a little more
/// than a second, in which a hand moves the view only by a part of its width.
const SPAN: u32 = 30;
/// Difference of sharpness (of logarithms) that is not evidence: a small movement of the view changes it as much.
const FLOOR: f32 = 0.2;
/// By how much the logarithm of a place's probability falls for each unit by which it was less sharp than another.
const WEIGHT: f32 = 10.0;

/// The sharpness last seen at each of [`BINS`] places of focal power.
///
/// Comparisons reach a few frames back. But of two places both seen within the last second, the sharper one is nearer
/// to the optimum. This memory corrects a belief that ignores it.
#[derive(Debug, Clone)]
pub struct SharpnessMemory {
    /// Frames seen so far.
    frame: u32,
    seen: [Option<Measurement>; BINS],
}

#[derive(Debug, Clone, Copy)]
struct Measurement {
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
    /// Remembers a frame seen at `focal_power` (0..=1). `sharpness` is the logarithm of its mean gradient magnitude.
    pub fn see(&mut self, focal_power: f32, sharpness: f32) {
        self.frame += 1;
        let bin = (focal_power.clamp(0.0, 1.0) * (BINS - 1) as f32).round() as usize;
        self.seen[bin] = Some(Measurement { frame: self.frame, sharpness });
    }

    /// Makes the places that were less sharp than others less likely under `belief`: one value per bin, with sum 1
    /// before and after. Older observations count less.
    pub fn weigh(&self, belief: &mut [f32]) {
        let mut total = 0.0;
        for (share, seen) in belief.iter_mut().zip(&self.seen) {
            if let Some(measurement) = seen {
                *share *= (-WEIGHT * self.evidence_against(*measurement)).exp();
            }
            total += *share;
        }

        for share in belief {
            *share /= total;
        }
    }

    /// By how much another place was sharper than this one, beyond [`FLOOR`], weighted by the freshness of both.
    fn evidence_against(&self, measurement: Measurement) -> f32 {
        let freshness = self.freshness(measurement);
        let against =
            |other: Measurement| freshness * self.freshness(other) * (other.sharpness - measurement.sharpness - FLOOR);
        self.seen.iter().flatten().map(|&other| against(other)).fold(0.0, f32::max)
    }

    /// Weight of a measurement by its age: 1 in its own frame, 0 after more than [`SPAN`] frames.
    fn freshness(&self, measurement: Measurement) -> f32 {
        let age = self.frame - measurement.frame;
        1.0 - age.min(SPAN + 1) as f32 / (SPAN + 1) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVEN: [f32; BINS] = [1.0 / BINS as f32; BINS];

    /// The belief after `sights` (focal power, sharpness), followed by `frames` repetitions of the last one.
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
        // One unit less sharp, one frame ago: the probability falls by the factor exp(-10 (1 - 0.2) 30/31).
        let belief = weighed(&[(0.25, 2.0), (0.75, 3.0)], 0);
        let ratio = belief[10] / belief[30];
        assert!((ratio.ln() - -8.0 * 30.0 / 31.0).abs() < 1e-4, "{ratio}");
        // A place that was not seen is as likely as the sharpest place seen.
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
