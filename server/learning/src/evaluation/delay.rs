//! How late a policy is: how many frames late somebody would be who knows every optimum exactly and has the same error.
//!
//! Errors depend on how fast the optimum moves. A delay tells more: no observer of the past can be earlier than one
//! frame, since the optimum of the next frame is not known yet.

use parfocal_base::FocalPower;

/// Largest delay that is looked for, in frames: two seconds.
pub const MOST_DELAY: usize = 50;
/// The observer's largest change of focal power per frame.
const MAX_MOVE: f64 = 0.1;

/// Mean absolute error, over the frames of one scan, of an observer who knows its `optimum` `late` frames late. It
/// starts in the middle, as policies do, and moves by at most [`MAX_MOVE`] a frame. With `late` 0 it knows the optimum
/// of the frame to come.
pub fn late_error(optimum: &[f64], late: usize) -> f64 {
    let mut focal_power = FocalPower::MIDDLE.get();
    let mut sum = 0.0;
    for (frame, best) in optimum.iter().enumerate() {
        sum += (focal_power - best).abs();
        let known = optimum[(frame + 1).saturating_sub(late).min(optimum.len() - 1)];
        focal_power = known.clamp(focal_power - MAX_MOVE, focal_power + MAX_MOVE);
    }
    sum / optimum.len().max(1) as f64
}

/// The delay at which the error is `wanted`, interpolated between whole frames. `error_at` tells the error of an
/// observer so many frames late. `None` if even [`MOST_DELAY`] frames give less.
pub fn delay_of(wanted: f64, error_at: impl Fn(usize) -> f64) -> Option<f64> {
    let mut before = error_at(0);
    if wanted <= before {
        return Some(0.0);
    }

    for late in 1..=MOST_DELAY {
        let error = error_at(late);
        if error >= wanted {
            return Some((late - 1) as f64 + (wanted - before) / (error - before));
        }
        before = error;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_late_observer_on_a_hand_worked_course() {
        // The optimum walks up by 0.02 a frame from the middle. A policy that is n frames late is 0.02 n behind once the
        // optimum has walked so long; before, the policy stands at the first optimum.
        let optimum: Vec<f64> = (0..20).map(|frame| 0.5 + 0.02 * f64::from(frame)).collect();
        for (late, behind) in [(0, 0.0), (1, 0.02 * 19.0 / 20.0), (2, (0.02 + 0.04 * 18.0) / 20.0)] {
            assert!((late_error(&optimum, late) - behind).abs() < 1e-12, "{late}");
        }
    }

    #[test]
    fn even_the_perfect_observer_moves_by_a_tenth_at_most() {
        // From 0.5 to 0.8 and back: at 0.5 for the first frame, then 0.6, 0.7, 0.8, 0.8.
        assert!((late_error(&[0.5, 0.8, 0.8, 0.8, 0.8], 0) - (0.2 + 0.1) / 5.0).abs() < 1e-12);
    }

    #[test]
    fn a_delay_lies_between_those_of_less_and_greater_error() {
        let error_at = |late: usize| [0.01, 0.02, 0.06, 0.06, 0.07][late.min(4)];
        let delay = |wanted| delay_of(wanted, error_at);
        assert_eq!((delay(0.005), delay(0.01), delay(0.2)), (Some(0.0), Some(0.0), None));
        assert!((delay(0.03).unwrap() - 1.25).abs() < 1e-12 && (delay(0.065).unwrap() - 3.5).abs() < 1e-12);
    }
}
