//! A batch of windows of consecutive frames, and the targets to which the values of its states are fitted.

use tch::{Device, Tensor};

use super::replay::{Frames, Transition};
use crate::training::recipe::dqn::{Bellman, Lookahead};
use parfocal_autofocus::STEP;
use parfocal_autofocus::learned::{action_step, scaled_focal_power};
use parfocal_autofocus::networks::{ACTIONS, HISTORY};
use parfocal_base::FocalPower;
use parfocal_base::IN_FOCUS;

/// Windows of frames as tensors, and the S states in them.
pub(super) struct Batch {
    /// All windows' frames.
    pub frames: Frames,
    /// `[8 S]`: indices of each state's latest eight frames, oldest first. Before the scan has eight, its first frame
    /// fills the places of those missing.
    pub history: Tensor,
    /// `[S, 8]`: the scaled focal powers at these frames.
    pub focal_powers: Tensor,
    /// One for each frame.
    pub transitions: Vec<Transition>,
    /// Indices of the frames that are states: those whose whole history lies in their window.
    pub states: Vec<usize>,
}

impl Batch {
    /// A batch of `frames` in windows of `window` frames each, for a network on `device`.
    pub fn new(frames: Frames, transitions: Vec<Transition>, window: usize, device: Device) -> Self {
        let states: Vec<usize> = (0..transitions.len()).filter(|&at| at % window >= reach(&transitions[at])).collect();

        let latest = |&at: &usize| {
            let reach = reach(&transitions[at]);
            (0..HISTORY).rev().map(move |back| at - back.min(reach))
        };

        let history: Vec<usize> = states.iter().flat_map(latest).collect();
        let focal_powers: Vec<f32> =
            history.iter().map(|&at| scaled_focal_power(f64::from(transitions[at].focal_power))).collect();

        let history: Vec<i64> = history.into_iter().map(|at| at as i64).collect();
        let history = Tensor::from_slice(&history).to_device(device);
        let focal_powers = Tensor::from_slice(&focal_powers).view([-1, HISTORY as i64]).to_device(device);

        Self { frames, history, focal_powers, transitions, states }
    }
}

/// How many frames back the history of a transition's state reaches: at most 7, and not beyond its scan's start.
fn reach(transition: &Transition) -> usize {
    usize::from(transition.age).min(HISTORY - 1)
}

/// What each action would gain over standing still at the frame after the last of `transitions`, in steps. Well out of
/// focus, moving earns `bonus` besides: only a policy that moves finds out where to go.
pub(super) fn gains(transitions: &[Transition], bonus: Lookahead) -> [f32; ACTIONS] {
    let Some(transition) = transitions.last() else { return [0.0; ACTIONS] };
    let stands = FocalPower::nearest(f64::from(transition.focal_power));
    let best = f64::from(transition.next_optimum);

    let error = (stands.get() - best).abs();
    let lost = (error / IN_FOCUS - 0.5).clamp(0.0, 1.0);
    let heading = heading(transitions);

    std::array::from_fn(|action| {
        let goes = stands.moved(action_step(action)).get();
        let moved = goes - stands.get();

        let earns = if moved == 0.0 {
            0.0
        } else if moved * heading < 0.0 {
            bonus.restless * bonus.turning
        } else {
            bonus.restless
        };

        ((error - (goes - best).abs()) / STEP + earns * lost) as f32
    })
}

/// The latest change of focal power within the history of the last of `transitions`; 0 if there was none.
fn heading(transitions: &[Transition]) -> f64 {
    let changes = transitions.windows(2).rev().take(HISTORY - 1).take_while(|pair| pair[1].age > pair[0].age);
    let mut changes = changes.map(|pair| f64::from(pair[1].focal_power - pair[0].focal_power));
    changes.find(|change| change.abs() > 1e-6).unwrap_or(0.0)
}

impl Bellman {
    /// The discounted return of the frames from `at` to the state `steps` later, whose value is `next_value`.
    fn of(&self, transitions: &[Transition], at: usize, next_value: f64) -> f64 {
        let end = at + self.steps;

        let mut sum = 0.0;
        for (ahead, pair) in transitions[at..=end].windows(2).enumerate() {
            let error = f64::from((pair[0].next_optimum - pair[1].focal_power).abs());
            sum -= self.discount.powi(ahead as i32) * error;
        }

        let later = self.discount.powi(self.steps as i32);
        if !self.regret {
            return later.mul_add(next_value, sum);
        }

        let shaped = sum + later * self.oracle(&transitions[end]) - self.oracle(&transitions[at]);
        // Roughly the mean regret per frame, independent of the horizon.
        later.mul_add(next_value, shaped * (1.0 - self.discount) / STEP)
    }

    /// The discounted reward of an oracle that steps from the focal power of `transition` straight to the optimum, if
    /// the optimum stayed where it is.
    fn oracle(&self, transition: &Transition) -> f64 {
        let mut error = f64::from((transition.next_optimum - transition.focal_power).abs());
        let mut sum = 0.0;
        let mut weight = 1.0;

        while error > STEP {
            error -= STEP;
            sum -= weight * error;
            weight *= self.discount;
        }

        sum
    }
}

/// The values to fit, by state and action; `None` for an action whose value is unknown.
pub(super) type Targets = Vec<[Option<f32>; ACTIONS]>;

/// The lookahead's targets: for each state the [`gains`] of all actions.
pub(super) fn lookahead(batch: &Batch, bonus: Lookahead) -> Targets {
    batch.states.iter().map(|&at| gains(&batch.transitions[..=at], bonus).map(Some)).collect()
}

/// Bellman's targets: the value of the action taken, for each state whose successor `returns.steps` later is in the
/// same scan and window. `next_values` holds the value of each state, by row.
pub(super) fn bellman(batch: &Batch, next_values: &[f32], returns: Bellman, window: usize) -> Targets {
    let mut row_of = vec![None; batch.transitions.len()];
    for (row, &at) in batch.states.iter().enumerate() {
        row_of[at] = Some(row);
    }

    let targets = |&at: &usize| {
        let mut targets = [None; ACTIONS];
        let end = at + returns.steps;
        let same_scan = end / window == at / window
            && usize::from(batch.transitions[end].age) == usize::from(batch.transitions[at].age) + returns.steps;

        if let Some(last) = same_scan.then(|| row_of[end]).flatten() {
            let value = returns.of(&batch.transitions, at, f64::from(next_values[last]));
            targets[usize::from(batch.transitions[at].action)] = Some(value as f32);
        }

        targets
    };

    batch.states.iter().map(targets).collect()
}

/// The mean smooth L1 loss (Huber 1964, quadratic within 1) of those `values` (`[S, 3]`, row by row) that have targets,
/// and its gradient with respect to `values`.
pub(super) fn smooth_l1(values: &[f32], targets: &Targets) -> (f64, Vec<f32>) {
    let targets = targets.as_flattened();
    let count = targets.iter().flatten().count().max(1) as f64;
    let mut loss = 0.0;

    let slope = |(value, targets): (&f32, &Option<f32>)| {
        let difference = targets.map_or(0.0, |targets| f64::from(value - targets));
        let size = difference.abs();
        loss += if size < 1.0 { 0.5 * size * size } else { size - 0.5 };
        (difference.clamp(-1.0, 1.0) / count) as f32
    };

    let grad_output = values.iter().zip(targets).map(slope).collect();
    (loss / count, grad_output)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transitions(focal_powers: &[f32], next_optimum: f32) -> Vec<Transition> {
        let transition =
            |(age, &focal_power): (usize, &f32)| Transition { focal_power, next_optimum, action: 1, age: age as u16 };
        focal_powers.iter().enumerate().map(transition).collect()
    }

    /// [`gains`] in thousandths of a step.
    fn gained(focal_powers: &[f32], next_optimum: f32, restless: f64, turning: f64) -> [i32; ACTIONS] {
        gains(&transitions(focal_powers, next_optimum), Lookahead { restless, turning })
            .map(|gain| (1000.0 * gain).round() as i32)
    }

    #[test]
    fn gains_are_in_steps_nearer_to_the_next_optimum() {
        assert_eq!(gained(&[0.5], 0.75, 0.0, 1.0), [-1000, 0, 1000]);
        assert_eq!(gained(&[0.5], 0.48, 0.0, 1.0), [-200, 0, -1000], "past the optimum: from 0.02 to 0.03");
        assert_eq!(gained(&[0.5], 0.48, 3.0, 1.0), [-200, 0, -1000], "in focus, moving earns nothing by itself");
    }

    #[test]
    fn moving_earns_where_the_picture_is_out_of_focus_and_less_for_turning() {
        let far = |focal_powers: &[f32]| gained(focal_powers, 0.9, 3.0, 0.5);
        assert_eq!(far(&[0.5]), [2000, 0, 4000], "no move before: either way alike, but for where it leads");
        assert_eq!(far(&[0.6, 0.55, 0.55, 0.5]), [2000, 0, 2500]);
        assert_eq!(
            far(&[0.45, 0.5, 0.5, 0.5]),
            [500, 0, 4000],
            "the latest change counts, however long the lens has stood"
        );
        assert_eq!(far(&[0.0])[0], 0, "the lens cannot go there");
    }

    /// `value` in ten thousandths.
    fn rounded(value: f64) -> i32 {
        (1e4 * value).round() as i32
    }

    #[test]
    fn returns_by_hand() {
        let mut transitions = transitions(&[0.5, 0.55, 0.6], 0.6);
        transitions[0].next_optimum = 0.62;
        transitions[1].next_optimum = 0.5;
        let plain = Bellman { discount: 0.5, steps: 2, double: false, regret: false };
        // -(0.62 - 0.55) - 0.5 * (0.6 - 0.5), plus a quarter of the last state's value.
        assert_eq!(rounded(plain.of(&transitions, 0, 4.0)), 8800);

        // An oracle that begins at 0.5 is 0.07, then 0.02 away from 0.62, and at the end 0. The result is in steps,
        // over the horizon of two frames.
        let regret = Bellman { regret: true, ..plain };
        assert_eq!(rounded(regret.of(&transitions, 0, 4.0)), 6000);
    }

    #[test]
    fn returns_stay_within_a_window_and_a_scan() {
        // Two windows of four frames; a scan ends in the middle of the first.
        let ages = [0, 1, 0, 1, 0, 1, 2, 3];
        let transition = |(at, age): (usize, u16)| Transition {
            focal_power: 0.5,
            next_optimum: 0.5 + at as f32 / 10.0,
            action: 1 + (at % 2) as u8,
            age,
        };
        let transitions: Vec<Transition> = ages.into_iter().enumerate().map(transition).collect();
        let batch = Batch::new(Frames::default(), transitions, 4, Device::Cpu);
        assert_eq!(batch.states, [0, 1, 2, 3, 4, 5, 6, 7]);

        let values = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0];
        let returns = Bellman { discount: 0.5, steps: 1, double: false, regret: false };
        let targets = bellman(&batch, &values, returns, 4);
        let told: Vec<_> = targets
            .iter()
            .map(|row| row.iter().enumerate().find_map(|(action, value)| value.map(|v| (action, rounded(v.into())))))
            .collect();

        let by_hand = [
            Some((1, 100_000)), // 0 + 20 / 2
            None,               // the scan ends
            Some((1, 198_000)), // -0.2 + 40 / 2
            None,               // the window ends
            Some((1, 296_000)), // -0.4 + 60 / 2
            Some((2, 345_000)), // -0.5 + 70 / 2
            Some((1, 394_000)), // -0.6 + 80 / 2
            None,
        ];

        assert_eq!(told, by_hand);
        assert!(targets.iter().all(|row| row.iter().flatten().count() <= 1), "of the action taken alone");
    }

    #[test]
    fn smooth_l1_by_hand() {
        let (loss, grad_output) = smooth_l1(&[0.5, 9.0, -2.0], &vec![[Some(0.1), None, Some(1.0)]]);
        assert!((loss - 1.29).abs() < 1e-6);
        assert_eq!(grad_output.iter().map(|slope| (1000.0 * slope).round() as i32).collect::<Vec<_>>(), [200, 0, -500]);
    }
}
