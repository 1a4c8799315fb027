//! Smooth random walks: how a hand moves the picture and the focus.

use rand::{Rng, RngExt};

use super::normal::standard_normal;

/// A position whose velocity is an Ornstein-Uhlenbeck process, reflected at both ends of its range.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    position: f64,
    velocity: f64,
    range: (f64, f64),
    motion: Motion,
}

/// How a [`Walk`] moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Standard deviation of the velocity, in units of the range a frame.
    pub speed: f64,
    /// Frames after which the velocity's autocorrelation has fallen to 1/e.
    pub memory: f64,
}

impl Walk {
    /// A walk within `range` from a uniformly drawn place, at a velocity from the stationary distribution.
    pub fn new(range: (f64, f64), motion: Motion, rng: &mut impl Rng) -> Self {
        let position = range.0 + (range.1 - range.0) * rng.random::<f64>();
        Self::starting(position, range, motion, rng)
    }

    /// A walk within `range` from `position`, at a velocity from the stationary distribution.
    pub fn starting(position: f64, range: (f64, f64), motion: Motion, rng: &mut impl Rng) -> Self {
        Self { position, velocity: motion.speed * standard_normal(rng), range, motion }
    }

    /// The current position.
    pub const fn position(&self) -> f64 {
        self.position
    }

    /// Moves on by one frame.
    pub fn advance(&mut self, rng: &mut impl Rng) {
        let kept = (-1.0 / self.motion.memory).exp();
        let fresh = self.motion.speed * (1.0 - kept * kept).sqrt();
        self.velocity = kept * self.velocity + fresh * standard_normal(rng);
        self.position += self.velocity;

        let (low, high) = self.range;

        if self.position < low {
            self.position = (2.0 * low - self.position).min(high);
            self.velocity = -self.velocity;
        } else if self.position > high {
            self.position = (2.0 * high - self.position).max(low);
            self.velocity = -self.velocity;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn velocity_has_the_asked_spread_and_memory() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let motion = Motion { speed: 0.5, memory: 20.0 };
        let mut walk = Walk::new((-1e9, 1e9), motion, &mut rng);
        let mut velocities = Vec::new();
        for _ in 0..200_000 {
            let before = walk.position();
            walk.advance(&mut rng);
            velocities.push(walk.position() - before);
        }

        let correlation = |lag: usize| {
            let pairs = velocities.iter().zip(&velocities[lag..]);
            pairs.map(|(a, b)| a * b).sum::<f64>() / 200_000.0
        };

        assert!((correlation(0).sqrt() - 0.5).abs() < 0.02);
        assert!((correlation(20) / correlation(0) - (-1.0f64).exp()).abs() < 0.04);
    }

    #[test]
    fn it_stays_within_its_range() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut walk = Walk::new((0.0, 1.0), Motion { speed: 0.3, memory: 5.0 }, &mut rng);
        for _ in 0..10_000 {
            walk.advance(&mut rng);
            assert!((0.0..=1.0).contains(&walk.position()));
        }
    }
}
