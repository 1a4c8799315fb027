//! Covers the view from time to time in training, as a glove, an instrument or glare does. Meanwhile there is nothing
//! to focus on.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Something that covers the view from time to time.
#[derive(Debug, Clone)]
pub struct Cover {
    course: ChaCha8Rng,
    /// The share of the picture's contrast that is left while the view is covered.
    detail: Option<f64>,
    frames_left: i32,
}

impl Cover {
    /// A cover that comes and goes as drawn from `seed`; at first nothing is covered.
    pub fn new(seed: u64) -> Self {
        let mut course = ChaCha8Rng::seed_from_u64(seed);
        let frames_left = course.random_range(0..150);
        Self { course, detail: None, frames_left }
    }

    /// The share of the picture's contrast that is left at this frame.
    pub fn detail(&self) -> f64 {
        self.detail.unwrap_or(1.0)
    }

    /// Moves on to the next frame.
    pub fn advance(&mut self) {
        if self.frames_left > 0 {
            self.frames_left -= 1;
            return;
        }

        let covers = self.detail.is_none();
        self.detail = covers.then(|| self.course.random_range(0.0..0.04));

        // Log-uniform: short covers are as frequent as long ones.
        let frames =
            if covers { self.course.random_range(1.0f64..5.0).exp() } else { self.course.random_range(20.0..150.0) };
        self.frames_left = frames as i32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_view_is_covered_now_and_then_and_free_at_first_and_mostly() {
        let mut covered = 0u32;
        for seed in 0..100 {
            let mut cover = Cover::new(seed);
            assert!((cover.detail() - 1.0).abs() < f64::EPSILON);
            let details = (0..1000).map(|_| {
                cover.advance();
                cover.detail()
            });

            let details: Vec<f64> = details.collect();
            assert!(details.iter().all(|detail| !(0.04..1.0).contains(detail)));
            covered += details.iter().map(|&detail| u32::from(detail < 1.0)).sum::<u32>();
        }

        // Covered for (e^5 - e) / 4 = 36 frames at a time on average, free for 85.
        let share = f64::from(covered) / 100_000.0;
        assert!((0.25..0.35).contains(&share), "{share}");
    }
}
