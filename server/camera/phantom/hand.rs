//! The hand that holds the camera: it wanders over the brain, comes closer and goes away, tilts, and trembles.

use std::f64::consts::TAU;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::camera::walk::{Motion, Walk};

/// Steps a second at which the hand's walks advance; between two, it moves evenly.
const RATE: f64 = 100.0;

/// Where the camera is.
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

/// How a hand moves along one coordinate.
#[derive(Debug, Clone, Copy)]
struct Habit {
    /// The coordinate stays within this range.
    range: (f64, f64),
    /// Standard deviation of its speed, per second.
    speed: f64,
    /// Seconds over which it forgets its speed.
    memory: f64,
}

/// Place (twice), roll, tilt (twice), focus.
const HABITS: [Habit; 6] = [
    Habit { range: (-150.0, 150.0), speed: 16.0, memory: 1.6 },
    Habit { range: (-150.0, 150.0), speed: 16.0, memory: 1.6 },
    Habit { range: (-0.35, 0.35), speed: 0.05, memory: 1.5 },
    Habit { range: (-0.2, 0.2), speed: 0.05, memory: 1.2 },
    Habit { range: (-0.2, 0.2), speed: 0.05, memory: 1.2 },
    Habit { range: (0.03, 0.97), speed: 0.16, memory: 1.5 },
];

/// Physiological tremor: frequency, 1/s, and amplitude, texels. A hand trembles at 8 to 12 Hz.
const TREMORS: [(f64, f64); 3] = [(8.3, 0.35), (9.7, 0.3), (11.6, 0.2)];

/// A hand's path: a function of its seed and of time alone, as long as time does not run backwards.
#[derive(Debug, Clone)]
pub struct Hand {
    rng: ChaCha8Rng,
    walks: [Walk; 6],
    before: [f64; 6],
    steps: u64,
    phases: [[f64; 3]; 2],
}

impl Hand {
    /// The hand of a seed, at time zero.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(1);
        let walks = HABITS.map(|habit| {
            let motion = Motion { speed: habit.speed / RATE, memory: habit.memory * RATE };
            Walk::new(habit.range, motion, &mut rng)
        });
        let phases = [(); 2].map(|()| [(); 3].map(|()| TAU * rng.random::<f64>()));
        Self { before: std::array::from_fn(|i| walks[i].position()), walks, rng, steps: 0, phases }
    }

    /// Where the camera is at `time` after the start; asked for in rising order.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "steps of a hundredth of a second since the start"
    )]
    pub fn pose_at(&mut self, time: Duration) -> Pose {
        let place = time.as_secs_f64() * RATE;
        while self.steps as f64 <= place {
            for (walk, before) in self.walks.iter_mut().zip(&mut self.before) {
                *before = walk.position();
                walk.advance(&mut self.rng);
            }
            self.steps += 1;
        }
        let part = (place - (self.steps - 1) as f64).clamp(0.0, 1.0);
        let [x, y, roll, lean_x, lean_y, focus]: [f64; 6] =
            std::array::from_fn(|i| self.before[i] + part * (self.walks[i].position() - self.before[i]));
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

    fn path(seed: u64, rate: u32, seconds: u32) -> Vec<Pose> {
        let mut hand = Hand::new(seed);
        (0..rate * seconds).map(|frame| hand.pose_at(Duration::from_secs(1) * frame / rate)).collect()
    }

    #[test]
    fn the_path_does_not_depend_on_the_frame_rate() {
        let (slow, fast) = (path(3, 10, 20), path(3, 50, 20));
        for (index, pose) in slow.iter().enumerate() {
            assert_eq!(*pose, fast[5 * index]);
        }
        assert_ne!(path(3, 10, 1), path(4, 10, 1));
    }

    #[test]
    fn the_working_distance_covers_the_lens() {
        let path = path(5, 10, 600);
        let near = path.iter().filter(|pose| pose.focus < 0.25).count();
        let far = path.iter().filter(|pose| pose.focus > 0.75).count();
        assert!(path.iter().all(|pose| (0.0..=1.0).contains(&pose.focus)));
        // A walk reflected at both ends spends as long in each quarter.
        assert!((900..2100).contains(&near) && (900..2100).contains(&far), "{near} {far}");
    }
}
