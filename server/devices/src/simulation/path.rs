//! A path through several coordinates: walks that depend only on time, not on the frame rate.

use std::time::Duration;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::walk::{Motion, Walk};

/// How one coordinate moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Habit {
    /// The coordinate stays within this range.
    pub range: (f64, f64),
    /// Standard deviation of its speed, per second.
    pub speed: f64,
    /// Seconds after which its speed's autocorrelation has fallen to 1/e.
    pub memory: f64,
}

/// `N` walks that advance at a fixed rate; between two steps they move evenly. The same seed and habits give the same
/// path, as long as times are requested in rising order.
#[derive(Debug, Clone)]
pub struct Path<const N: usize> {
    rng: ChaCha8Rng,
    rate: f64,
    walks: [Walk; N],
    before: [f64; N],
    steps: u64,
}

impl<const N: usize> Path<N> {
    /// A path whose walks advance `rate` times a second, at time zero.
    pub fn new(seed: u64, rate: f64, habits: [Habit; N]) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(1);

        let walks = habits.map(|habit| {
            let motion = Motion { speed: habit.speed / rate, memory: habit.memory * rate };
            Walk::new(habit.range, motion, &mut rng)
        });

        Self { before: std::array::from_fn(|i| walks[i].position()), rng, rate, walks, steps: 0 }
    }

    /// The coordinates at `time` after the start.
    pub fn at(&mut self, time: Duration) -> [f64; N] {
        let place = time.as_secs_f64() * self.rate;
        while self.steps as f64 <= place {
            for (walk, before) in self.walks.iter_mut().zip(&mut self.before) {
                *before = walk.position();
                walk.advance(&mut self.rng);
            }
            self.steps += 1;
        }

        let part = (place - (self.steps - 1) as f64).clamp(0.0, 1.0);
        std::array::from_fn(|i| self.before[i] + part * (self.walks[i].position() - self.before[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HABIT: Habit = Habit { range: (0.0, 1.0), speed: 0.3, memory: 1.0 };

    fn path(seed: u64, rate: u32, seconds: u32) -> Vec<[f64; 2]> {
        let mut path = Path::new(seed, 100.0, [HABIT; 2]);
        (0..rate * seconds).map(|frame| path.at(Duration::from_secs(1) * frame / rate)).collect()
    }

    #[test]
    fn it_does_not_depend_on_the_frame_rate() {
        let slow = path(3, 10, 20);
        let fast = path(3, 50, 20);
        for (index, place) in slow.iter().enumerate() {
            assert_eq!(place.map(f64::to_bits), fast[5 * index].map(f64::to_bits));
        }
    }

    #[test]
    fn another_seed_goes_elsewhere() {
        assert_ne!(path(3, 10, 1), path(4, 10, 1));
    }

    #[test]
    fn it_does_not_jump() {
        let steps = path(5, 1000, 10);
        let widest = steps.windows(2).map(|pair| (pair[1][0] - pair[0][0]).abs()).fold(0.0, f64::max);
        // Five standard deviations of speed over a thousandth of a second.
        assert!(widest < 5.0 * 0.3 / 1000.0, "{widest}");
    }
}
