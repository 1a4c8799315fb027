//! The hand that holds the camera: it wanders over the brain, comes closer and goes away, tilts, and trembles.

use std::f64::consts::TAU;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::simulation::path::{Habit, Path};

/// Rate of the hand's walks, steps a second.
const RATE: f64 = 100.0;

/// The camera's place and direction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// Place on the surface that the camera points at, in texels from the scene's middle.
    pub place: [f64; 2],
    /// Turn about the viewing direction, radians.
    pub roll: f64,
    /// Lean of the viewing direction against the surface's normal, radians along the picture's x and y.
    pub tilt: [f64; 2],
    /// Focal power that would be sharp at that place if the surface were flat, 0..=1: how far the camera is.
    pub focus: f64,
}

/// Habits of the place (twice), roll, tilt (twice) and focus.
const HABITS: [Habit; 6] = [
    Habit { range: (-215.0, 215.0), speed: 16.0, memory: 1.6 },
    Habit { range: (-215.0, 215.0), speed: 16.0, memory: 1.6 },
    Habit { range: (-0.35, 0.35), speed: 0.05, memory: 1.5 },
    Habit { range: (-0.2, 0.2), speed: 0.05, memory: 1.2 },
    Habit { range: (-0.2, 0.2), speed: 0.05, memory: 1.2 },
    Habit { range: (0.03, 0.97), speed: 0.16, memory: 1.5 },
];

/// Speed of a hand, relative to one that inspects calmly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Haste {
    /// Factor of the speeds along the surface, of turning and of leaning.
    pub sideways: f64,
    /// Factor of the speed towards the surface and away from it.
    pub focus: f64,
}

impl Default for Haste {
    fn default() -> Self {
        Self { sideways: 1.0, focus: 1.0 }
    }
}

/// Physiological tremor: frequency, 1/s, and amplitude, texels. A hand trembles at 8 to 12 Hz.
const TREMORS: [(f64, f64); 3] = [(8.3, 0.35), (9.7, 0.3), (11.6, 0.2)];

/// A hand's path. It depends only on its seed and on time, as long as time does not run backwards.
#[derive(Debug, Clone)]
pub struct Hand {
    path: Path<6>,
    phases: [[f64; 3]; 2],
}

impl Hand {
    /// The hand of a seed, at time zero.
    pub fn new(seed: u64) -> Self {
        Self::moving(seed, Haste::default())
    }

    /// The hand of a seed that moves with `haste`.
    pub fn moving(seed: u64, haste: Haste) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(4);
        let phases = [(); 2].map(|()| [(); 3].map(|()| TAU * rng.random::<f64>()));

        let mut habits = HABITS;
        let factors = [haste.sideways; 5].into_iter().chain([haste.focus]);
        habits.iter_mut().zip(factors).for_each(|(habit, factor)| habit.speed *= factor);

        Self { path: Path::new(seed, RATE, habits), phases }
    }

    /// The camera's pose at `time` after the start; times must be requested in rising order.
    pub fn pose_at(&mut self, time: Duration) -> Pose {
        let [x, y, roll, lean_x, lean_y, focus] = self.path.at(time);
        let [shake_x, shake_y] = self.phases.map(|phases| tremor(phases, time.as_secs_f64()));
        Pose { place: [x + shake_x, y + shake_y], roll, tilt: [lean_x, lean_y], focus }
    }
}

fn tremor(phases: [f64; 3], seconds: f64) -> f64 {
    TREMORS.iter().zip(phases).map(|((rate, size), phase)| size * (TAU * rate * seconds + phase).sin()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_working_distance_covers_the_lens() {
        let mut hand = Hand::new(5);
        let path: Vec<f64> = (0..6000).map(|frame| hand.pose_at(Duration::from_millis(100) * frame).focus).collect();
        let near = path.iter().filter(|focus| **focus < 0.25).count();
        let far = path.iter().filter(|focus| **focus > 0.75).count();
        assert!(path.iter().all(|focus| (0.0..=1.0).contains(focus)));
        // A walk reflected at both ends spends as long in each quarter.
        assert!((900..2100).contains(&near) && (900..2100).contains(&far), "{near} {far}");
    }
}
