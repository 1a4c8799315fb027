//! The dead time and settling time that explain the steps seen.

use std::time::Duration;

use parfocal_devices::lens::LensDynamics;

/// One frame after a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Seconds from the command to the middle of the exposure.
    pub at: f64,
    /// Share of the step that the lens had made.
    pub share: f64,
}

/// Cells along each axis of each round's grid.
const GRID: u32 = 40;
/// Number of rounds. Each searches four cells on either side of the best point of the previous one.
const ROUNDS: u32 = 4;

/// The step response that explains samples best: 0 for `delay`, then `1 - exp(-t / tau)` with `tau = settling / ln 20`,
/// as in [`parfocal_devices::lens::Response`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Seconds from the command to the first movement.
    pub delay: f64,
    /// Seconds from the first movement to within 5 % of the step.
    pub settling: f64,
    /// Root mean square of the residuals, as a share of the step.
    pub rms: f64,
}

impl Fit {
    /// The best fit within `longest` seconds, by least squares.
    pub fn of(samples: &[Sample], longest: f64) -> Self {
        let mut delays = (0.0, longest);
        let mut settlings = (0.0, longest);
        let mut best = Self { delay: 0.0, settling: 0.0, rms: f64::INFINITY };

        for _ in 0..ROUNDS {
            for (delay, settling) in grid(delays).flat_map(|delay| grid(settlings).map(move |of| (delay, of))) {
                let candidate = Self { delay, settling, rms: 0.0 };
                let rms = candidate.scatter(samples);
                if rms < best.rms {
                    best = Self { rms, ..candidate };
                }
            }

            delays = around(delays, best.delay);
            settlings = around(settlings, best.settling);
        }

        best
    }

    /// Share of the step done `at` seconds after the command.
    pub fn share(&self, at: f64) -> f64 {
        let since = at - self.delay;
        if since < 0.0 {
            return 0.0;
        }

        if self.settling > 0.0 { 1.0 - 20_f64.powf(-since / self.settling) } else { 1.0 }
    }

    /// The fit in the control loop's form.
    pub fn dynamics(&self) -> LensDynamics {
        let seconds = |value: f64| Duration::from_secs_f64(value.max(0.0));
        LensDynamics { delay: seconds(self.delay), settling: seconds(self.settling) }
    }

    fn scatter(&self, samples: &[Sample]) -> f64 {
        let squares = samples.iter().map(|sample| (sample.share - self.share(sample.at)).powi(2));
        (squares.sum::<f64>() / samples.len().max(1) as f64).sqrt()
    }
}

fn grid((from, to): (f64, f64)) -> impl Iterator<Item = f64> {
    (0..=GRID).map(move |step| from + (to - from) * f64::from(step) / f64::from(GRID))
}

fn around((from, to): (f64, f64), best: f64) -> (f64, f64) {
    let reach = 4.0 * (to - from) / f64::from(GRID);
    ((best - reach).max(0.0), best + reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_response_is_found_again() {
        // 1 - 20^(-(t - 7 ms) / 25 ms), seen every 3 ms, alternately 2 % too high and too low.
        let seen = |step: u32| {
            let at = 0.003 * f64::from(step);
            let share = if at < 0.007 { 0.0 } else { 1.0 - 20_f64.powf(-(at - 0.007) / 0.025) };
            Sample { at, share: share + if step.is_multiple_of(2) { 0.02 } else { -0.02 } }
        };

        let fit = Fit::of(&(0..100).map(seen).collect::<Vec<_>>(), 0.3);
        assert!((fit.delay - 0.007).abs() < 0.001 && (fit.settling - 0.025).abs() < 0.002, "{fit:?}");
        assert!((fit.rms - 0.02).abs() < 0.005, "{fit:?}");
    }
}
