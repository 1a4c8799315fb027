//! Checks a policy's decision, so that the loop can follow it.

use std::sync::Arc;
use std::time::Duration;

use parfocal_autofocus::{Decision, Fault, PolicyError};
use parfocal_base::FocalPower;

/// Largest number of values of a belief that is shown.
const LONGEST_BELIEF: usize = 4096;

/// A policy's decision after the check: it can be followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// Focal power to go to.
    pub target: FocalPower,
    /// The policy's focus metric, if it has one and it is finite.
    pub metric: Option<f64>,
    /// The policy's belief, if it has one.
    pub belief: Option<Arc<[f32]>>,
    /// Duration of the policy's step.
    pub took: Duration,
}

/// Why a policy gave no advice.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// It panicked with this message. Its thread has ended.
    #[error("it panicked: {0}")]
    Panicked(String),
    /// It could not be built. Its thread has ended.
    #[error(transparent)]
    Unavailable(PolicyError),
    /// It runs in another process, which did not answer, or not as it should.
    #[error(transparent)]
    Outside(Fault),
    /// It asked for this number, which is not a focal power.
    #[error("it asked for {0}, which is not a focal power")]
    InvalidTarget(f64),
}

impl Advice {
    /// Checks `decision`; the policy's step took `took`. Every decision of a policy passes this check before the loop
    /// acts on it.
    ///
    /// # Errors
    /// If its target is not a focal power.
    pub fn new(decision: Decision, took: Duration) -> Result<Self, Failure> {
        let target = FocalPower::new(decision.target).map_err(|_| Failure::InvalidTarget(decision.target))?;

        // Metric and belief are only shown. An invalid one is left out, and the target is still followed.
        let metric = decision.metric.filter(|metric| metric.is_finite());
        let belief = decision.belief.filter(|belief| can_be_shown(belief));

        Ok(Self { target, metric, belief, took })
    }
}

fn can_be_shown(belief: &[f32]) -> bool {
    belief.len() <= LONGEST_BELIEF && belief.iter().all(|probability| probability.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advice(decision: Decision) -> Result<Advice, Failure> {
        Advice::new(decision, Duration::from_millis(1))
    }

    #[test]
    fn a_target_that_is_not_a_focal_power_is_a_failure() {
        for target in [f64::NAN, f64::INFINITY, -0.01, 1.01] {
            let failure = advice(Decision { target, ..Decision::default() }).unwrap_err();
            assert!(matches!(failure, Failure::InvalidTarget(invalid) if invalid.to_bits() == target.to_bits()));
        }
    }

    #[test]
    fn a_metric_or_belief_that_cannot_be_shown_is_left_out() {
        let shown = advice(Decision { target: 0.5, metric: Some(2.0), belief: Some([0.5, 0.5].into()) }).unwrap();
        assert_eq!((shown.metric, shown.belief.map(|belief| belief.len())), (Some(2.0), Some(2)));

        let not_a_number = Decision { target: 0.5, metric: Some(f64::NAN), belief: Some([f32::NAN].into()) };
        let advised = advice(not_a_number).unwrap();
        assert_eq!((advised.target.get(), advised.metric, advised.belief), (0.5, None, None));

        let too_long = vec![0.0; LONGEST_BELIEF + 1];
        let advised = advice(Decision { target: 0.5, metric: None, belief: Some(too_long.into()) }).unwrap();
        assert_eq!(advised.belief, None);
    }
}
