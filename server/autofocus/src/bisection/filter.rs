//! The belief of the bisection: how likely each optimum is, together with each velocity of it.
//!
//! It is a histogram over a grid, not a set of random particles, so the same frames always give the same belief.

use crate::networks::BINS;

/// Places of the optimum, evenly spread over 0..=1.
const PLACES: usize = 101;
const PLACE_WIDTH: f64 = 1.0 / (PLACES - 1) as f64;
/// So many places at each end of the range can be reached by turning back there.
const END: usize = 6;
/// Velocities of the optimum, evenly spread around 0.
const SPEEDS: usize = 13;
/// Difference between two velocities: focal power per frame.
const SPEED_WIDTH: f64 = 0.006;

/// Standard deviation of the velocity: focal power per frame. The walk of the optimum in simulated scans has the same,
/// which was chosen so that the hill-climbers have the paper's errors.
const SPEED: f64 = 0.012;
/// Time constant of the velocity, in frames, as in simulated scans.
const MEMORY: f64 = 60.0;
/// Standard deviation of the optimum's own step in a frame, besides its velocity.
const STEP: f64 = 0.006;
/// Probability in a frame that the optimum is somewhere else altogether: an edge of the scene's relief has passed.
const JUMP: f64 = 0.01;

/// Probability that a comparison is wrong, however clear it looks: noise, a wrong registration, changed light.
const WRONG: f32 = 0.08;
/// How fast a comparison convinces as the two distances from the optimum differ, per unit of focal power.
const STEEPNESS: f32 = 20.0;

/// Frames ahead for which the optimum is predicted: one until the lens has moved, and one in which it is seen.
const AHEAD: f64 = 2.0;
/// Weights with which a predicted place counts for the bins around it.
const SMOOTHING: [f32; 7] = [0.05, 0.1, 0.2, 0.3, 0.2, 0.1, 0.05];
/// Added to every bin of the prediction, so that none is ever impossible.
const LEAST: f32 = 1e-5;

/// Where two views of the same piece of scene were taken, and which was sharper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Focal power of the earlier view.
    pub before: f64,
    /// Focal power of this frame's view.
    pub now: f64,
    /// Age of the earlier view, in frames.
    pub lag: usize,
    /// Positive if the piece is sharper now. Its size says how clear the difference is, at most 2.
    pub sharper: f32,
}

/// Probability of each velocity (rows) and place (columns) of the optimum.
#[derive(Debug, Clone)]
pub struct Filter {
    belief: Vec<[f32; PLACES]>,
}

impl Default for Filter {
    /// Every place alike, with velocities as the walk has them.
    fn default() -> Self {
        let row = |share: f32| [share / PLACES as f32; PLACES];
        Self { belief: usual_speeds().map(row).to_vec() }
    }
}

/// Velocity in row `row`.
fn speed(row: usize) -> f64 {
    (row as f64 - (SPEEDS / 2) as f64) * SPEED_WIDTH
}

/// Probability of each velocity when nothing is known of it.
fn usual_speeds() -> [f32; SPEEDS] {
    let density: [f64; SPEEDS] = std::array::from_fn(|row| (-0.5 * (speed(row) / SPEED).powi(2)).exp());
    let sum: f64 = density.iter().sum();
    density.map(|value| (value / sum) as f32)
}

/// Three neighbouring cells: the middle one, and the share of each. Their mean is `at` and their standard deviation
/// `spread`, both in cells. For spreads of about 0.3 to 0.7.
fn three_cells(at: f64, spread: f64) -> (isize, [f32; 3]) {
    let middle = at.round();
    let off = at - middle;
    let square = spread * spread + off * off;
    let shares = [0.5 * (square - off), 1.0 - square, 0.5 * (square + off)];
    (middle as isize, shares.map(|share| share as f32))
}

/// `index`, mirrored at the ends of `0..count`. The second value tells whether it was.
const fn mirrored(index: isize, count: usize) -> (usize, bool) {
    let last = count as isize - 1;
    if index < 0 {
        ((-index) as usize, true)
    } else if index > last {
        ((2 * last - index) as usize, true)
    } else {
        (index as usize, false)
    }
}

impl Filter {
    /// The belief a frame later, before that frame is seen.
    pub fn predict(&mut self) {
        self.change_speeds();
        self.move_places();

        // A new optimum has a velocity as the walk has them.
        let usual = usual_speeds();
        for (row, usual) in self.belief.iter_mut().zip(usual) {
            let anew = JUMP as f32 * usual / PLACES as f32;
            for share in row.iter_mut() {
                *share = (1.0 - JUMP as f32) * *share + anew;
            }
        }
    }

    /// Each velocity falls towards 0 by its memory, and is pushed at random so that its standard deviation stays.
    fn change_speeds(&mut self) {
        let keeps = (-1.0 / MEMORY).exp();
        let spread = (1.0 - keeps * keeps).sqrt() * SPEED / SPEED_WIDTH;

        let mut changed = vec![[0.0f32; PLACES]; SPEEDS];
        for (row, shares) in self.belief.iter().enumerate() {
            let at = keeps * speed(row) / SPEED_WIDTH + (SPEEDS / 2) as f64;
            let (middle, parts) = three_cells(at, spread);
            for (offset, part) in (-1..=1).zip(parts) {
                let to = (middle + offset).clamp(0, SPEEDS as isize - 1) as usize;
                changed[to].iter_mut().zip(shares).for_each(|(out, share)| *out += part * share);
            }
        }
        self.belief = changed;
    }

    /// Each optimum moves by its velocity. One that would leave the range turns back.
    fn move_places(&mut self) {
        let mut moved = vec![[0.0f32; PLACES]; SPEEDS];
        for (row, shares) in self.belief.iter().enumerate() {
            let (shift, parts) = three_cells(speed(row) / PLACE_WIDTH, STEP / PLACE_WIDTH);

            // Far from the ends nothing turns back, so whole rows move at once.
            let from = |offset: isize| &shares[(END as isize - shift - offset) as usize..][..PLACES - 2 * END];
            let cells = moved[row][END..PLACES - END].iter_mut();
            for (((out, one), two), three) in cells.zip(from(1)).zip(from(0)).zip(from(-1)) {
                *out = parts[2] * one + parts[1] * two + parts[0] * three;
            }

            let near_an_end = (0..2 * END).chain(PLACES - 2 * END..PLACES);
            for place in near_an_end {
                for (offset, part) in (-1..=1).zip(parts) {
                    let (to, turned) = mirrored(place as isize + shift + offset, PLACES);
                    if (END..PLACES - END).contains(&to) {
                        continue;
                    }
                    let row = if turned { SPEEDS - 1 - row } else { row };
                    moved[row][to] += part * shares[place];
                }
            }
        }
        self.belief = moved;
    }

    /// Takes in comparisons of this frame with earlier ones.
    ///
    /// If the piece is sharper now, this frame was probably nearer to the optimum. The probability is
    /// `WRONG + (1 - 2 WRONG) S(STEEPNESS sharper (|before - then| - |now - optimum|))`, where S is the logistic
    /// function and `then` the optimum at the time of the earlier view. An older comparison counts less: its logarithm
    /// is divided by the square root of its age, since the comparisons of a frame share what is wrong with them.
    pub fn see(&mut self, comparisons: &[Comparison]) {
        for comparison in comparisons {
            match comparison.lag {
                1 => self.weigh(comparison, |likelihood| likelihood),
                4 => self.weigh(comparison, f32::sqrt),
                lag => {
                    let weight = 1.0 / (lag as f32).sqrt();
                    self.weigh(comparison, |likelihood| likelihood.powf(weight));
                }
            }
        }

        let sum: f32 = self.belief.iter().flatten().sum();
        if sum > 0.0 {
            self.belief.iter_mut().flatten().for_each(|share| *share /= sum);
        } else {
            *self = Self::default();
        }
    }

    /// Multiplies each cell by its [`likelihood`], of which `aged` makes what counts at the comparison's age.
    fn weigh(&mut self, comparison: &Comparison, aged: impl Fn(f32) -> f32) {
        for (row, shares) in self.belief.iter_mut().enumerate() {
            let moved = comparison.lag as f64 * speed(row);
            for (place, share) in shares.iter_mut().enumerate() {
                let optimum = place as f64 * PLACE_WIDTH;
                *share *= aged(likelihood(comparison, optimum - moved, optimum));
            }
        }
    }

    /// How likely the optimum is in each bin when the lens will have moved.
    pub fn outlook(&self) -> [f32; BINS] {
        let mut bins = [0.0; BINS];
        for (row, shares) in self.belief.iter().enumerate() {
            let ahead = AHEAD * speed(row);
            for (place, share) in shares.iter().enumerate() {
                let at = (place as f64 * PLACE_WIDTH + ahead).clamp(0.0, 1.0) * (BINS - 1) as f64;
                let lower = (at as usize).min(BINS - 2);
                let upper_share = (at - lower as f64) as f32;
                bins[lower] += share * (1.0 - upper_share);
                bins[lower + 1] += share * upper_share;
            }
        }
        smoothed(&bins)
    }
}

/// Probability of what `comparison` found if the optimum was `then` and is `optimum`.
fn likelihood(comparison: &Comparison, then: f64, optimum: f64) -> f32 {
    let then = if then < 0.0 {
        -then
    } else if then > 1.0 {
        2.0 - then
    } else {
        then
    };
    let nearer = ((comparison.before - then).abs() - (comparison.now - optimum).abs()) as f32;
    let agrees = 1.0 / (1.0 + (-STEEPNESS * comparison.sharper * nearer).exp());
    WRONG + (1.0 - 2.0 * WRONG) * agrees
}

/// `bins` under [`SMOOTHING`], mirrored at both ends, with [`LEAST`] added; their sum is 1.
fn smoothed(bins: &[f32; BINS]) -> [f32; BINS] {
    let reach = (SMOOTHING.len() / 2) as isize;
    let value = |bin: usize| {
        let around = (-reach..=reach).zip(SMOOTHING);
        around.map(|(offset, weight)| weight * bins[mirrored(bin as isize + offset, BINS).0]).sum::<f32>() + LEAST
    };
    let out: [f32; BINS] = std::array::from_fn(value);
    let sum: f32 = out.iter().sum();
    out.map(|share| share / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Probability, mean and standard deviation of the place, and mean of the velocity.
    fn moments(filter: &Filter) -> [f64; 4] {
        let cells = || {
            filter.belief.iter().enumerate().flat_map(|(row, shares)| {
                let cell =
                    move |(place, share): (usize, &f32)| (f64::from(*share), place as f64 * PLACE_WIDTH, speed(row));
                shares.iter().enumerate().map(cell)
            })
        };
        let all: f64 = cells().map(|(share, ..)| share).sum();
        let place = cells().map(|(share, place, _)| share * place).sum::<f64>() / all;
        let square = cells().map(|(share, at, _)| share * (at - place).powi(2)).sum::<f64>() / all;
        let velocity = cells().map(|(share, _, speed)| share * speed).sum::<f64>() / all;
        [all, place, square.sqrt(), velocity]
    }

    /// A belief that is sure of place and velocity.
    fn certain(place: usize, row: usize) -> Filter {
        let mut belief = vec![[0.0; PLACES]; SPEEDS];
        belief[row][place] = 1.0;
        Filter { belief }
    }

    #[test]
    fn a_prediction_moves_and_widens_as_the_walk_does() {
        // Velocity 2 * 0.006 a frame: first it falls to exp(-1/60) of that, then the place moves by it. It never
        // leaves the range, so the only other change is the jump, which has the mean 0.5 and the variance 1/12.
        let mut filter = certain(40, SPEEDS / 2 + 2);
        filter.move_places();
        let [all, place, spread, velocity] = moments(&filter);
        assert!((all - 1.0).abs() < 1e-6 && (place - 0.412).abs() < 1e-6 && (spread - 0.006).abs() < 1e-6);
        assert!((velocity - 0.012).abs() < 1e-8);

        filter.change_speeds();
        let [.., velocity] = moments(&filter);
        assert!((velocity - 0.012 * (-1.0f64 / 60.0).exp()).abs() < 1e-7, "{velocity}");

        let mut filter = certain(40, SPEEDS / 2);
        filter.predict();
        let [all, place, spread, velocity] = moments(&filter);
        let expected = 0.99f64 * 0.4 + 0.01 * 0.5;
        assert!((all - 1.0).abs() < 1e-5 && (place - expected).abs() < 1e-5 && velocity.abs() < 1e-7, "{place}");
        // Variance: the own step and the velocity's push; the jump's; the distance between both means.
        let push = 0.012f64.powi(2) * (1.0 - (-2.0f64 / 60.0).exp());
        // Places drawn alike from 101 have the variance (101^2 - 1) / 12 in cells.
        let square = 0.99 * (0.006f64.powi(2) + push) + 0.01 * (10200.0 / 12.0 * 1e-4) + 0.99 * 0.01 * 0.01;
        assert!((spread - square.sqrt()).abs() < 1e-4, "{spread} {}", square.sqrt());
    }

    #[test]
    fn the_velocity_keeps_the_walks_deviation() {
        let mut filter = Filter::default();
        let deviation = |filter: &Filter| {
            let rows = filter.belief.iter().enumerate();
            rows.map(|(row, shares)| shares.iter().sum::<f32>() * speed(row).powi(2) as f32).sum::<f32>().sqrt()
        };
        (0..300).for_each(|_| filter.predict());
        assert!((deviation(&filter) / 0.012 - 1.0).abs() < 0.02, "{}", deviation(&filter));
    }

    #[test]
    fn an_optimum_at_the_end_of_the_range_turns_back() {
        let mut filter = certain(0, 0);
        filter.move_places();
        let [all, place, _, velocity] = moments(&filter);
        // Velocity -0.036, to -0.036, which is mirrored.
        assert!((all - 1.0).abs() < 1e-6 && (place - 0.036).abs() < 1e-6 && (velocity - 0.036).abs() < 1e-7);
    }

    #[test]
    fn a_comparison_weighs_the_two_sides_as_the_formula_says() {
        // Seen at 0.4, then at 0.6, and clearly sharper. With the optimum at rest at 0.7, the distances are 0.3 and
        // 0.1: S(20 * 2 * 0.2) = 0.999665. At 0.3 they are 0.1 and 0.3: S(-8) = 0.000335.
        let sharper = Comparison { before: 0.4, now: 0.6, lag: 1, sharper: 2.0 };
        let at = |optimum: f64| f64::from(likelihood(&sharper, optimum, optimum));
        assert!((at(0.7) - (0.08 + 0.84 * 0.999_664_65)).abs() < 1e-6 && (at(0.3) - 0.080_281_7).abs() < 1e-6);
        assert!((at(0.5) - 0.5).abs() < 1e-6);

        let mut filter = Filter::default();
        let row = SPEEDS / 2;
        filter.see(&[sharper]);
        let ratio = |filter: &Filter| f64::from(filter.belief[row][70] / filter.belief[row][30]);
        assert!((ratio(&filter) / (at(0.7) / at(0.3)) - 1.0).abs() < 1e-4);

        // Four frames old, it counts as its square root.
        let mut filter = Filter::default();
        filter.see(&[Comparison { lag: 4, ..sharper }]);
        assert!((ratio(&filter) / (at(0.7) / at(0.3)).sqrt() - 1.0).abs() < 1e-4);
        // With the velocity -0.006 a frame the optimum, now at 0.5, was at 0.524 then: 0.124 and 0.1 away.
        let share = f64::from(filter.belief[row - 1][50] / filter.belief[row - 1][70]);
        let of = |nearer: f64| (0.08 + 0.84 / (1.0 + (-40.0 * nearer).exp())).sqrt();
        assert!((share / (of(0.024) / of(0.324 - 0.1)) - 1.0).abs() < 1e-4, "{share}");
    }

    #[test]
    fn the_outlook_is_two_frames_ahead() {
        let outlook = certain(50, SPEEDS - 1).outlook();
        let mean: f32 = outlook.iter().enumerate().map(|(bin, share)| share * bin as f32 / 40.0).sum();
        // 0.5 + 2 * 0.036.
        assert!((mean - 0.572).abs() < 1e-3 && (outlook.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{mean}");
    }
}
