//! Statistics of the loop's latency over the last second.

use std::collections::VecDeque;
use std::time::Duration;

use parfocal_base::clock::Moment;

const LENGTH: Duration = Duration::from_secs(1);

/// The loop's steps of the last second.
#[derive(Debug, Default)]
pub struct LatencyWindow {
    /// When each step ended, and its latency in microseconds.
    steps: VecDeque<(Moment, u32)>,
    sorted: Vec<u32>,
}

/// Statistics of the latencies of some steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LatencyFigures {
    /// Number of steps.
    pub steps: usize,
    /// Median latency in microseconds; 0 without steps.
    pub p50: u32,
    /// 99th percentile of the latency in microseconds; 0 without steps.
    pub p99: u32,
}

impl LatencyFigures {
    /// Computes the figures of `latencies` in microseconds, and sorts them. Percentiles are by nearest rank.
    pub fn of(latencies: &mut [u32]) -> Self {
        latencies.sort_unstable();
        let percentile = |percent: usize| {
            let rank = (latencies.len() * percent).div_ceil(100).saturating_sub(1);
            latencies.get(rank).copied().unwrap_or(0)
        };

        Self { steps: latencies.len(), p50: percentile(50), p99: percentile(99) }
    }
}

impl LatencyWindow {
    /// Adds a step that ended at `now`.
    pub fn add(&mut self, now: Moment, latency_micros: u32) {
        self.steps.push_back((now, latency_micros));
        self.forget(now);
    }

    /// The figures of the second before `now`.
    pub fn figures(&mut self, now: Moment) -> LatencyFigures {
        self.forget(now);
        self.sorted.clear();
        self.sorted.extend(self.steps.iter().map(|&(_, latency)| latency));
        LatencyFigures::of(&mut self.sorted)
    }

    fn forget(&mut self, now: Moment) {
        while self.steps.front().is_some_and(|&(at, _)| now.since(at) >= LENGTH) {
            self.steps.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn millis(value: u64) -> Moment {
        Moment::from_nanos(value * 1_000_000)
    }

    #[test]
    fn percentiles_are_by_nearest_rank() {
        let mut window = LatencyWindow::default();
        for latency in (1..=200).rev() {
            window.add(millis(0), latency);
        }
        assert_eq!(window.figures(millis(0)), LatencyFigures { steps: 200, p50: 100, p99: 198 });
    }

    #[test]
    fn what_is_a_second_old_is_forgotten() {
        let mut window = LatencyWindow::default();
        for (at, latency) in [(0, 900), (500, 10), (1400, 20)] {
            window.add(millis(at), latency);
        }
        assert_eq!(window.figures(millis(1400)), LatencyFigures { steps: 2, p50: 10, p99: 20 });
        assert_eq!(window.figures(millis(3000)), LatencyFigures { steps: 0, p50: 0, p99: 0 });
    }
}
