//! Figures of an analysis as SVG, for the page and for print: black and gray, distinguished by shape.

use super::comparison::Comparison;
use super::outcomes::{FOCAL_ERROR, Outcome};
use super::statistics::median;
use parfocal_base::plot::{Axis, Plot};

/// Colour for one surgeon.
const SURGEON: &str = "#767676";
/// Colour for all surgeons.
const ALL: &str = "#000000";

/// The surgeons' means by policy, and below them the means by position; `None` if there are no values.
pub fn figure(compared: &Comparison) -> Option<String> {
    let means = || compared.surgeons.iter().flat_map(|line| line.means.iter().flatten().copied());
    let positions = compared.position.means.iter().copied();
    let axis = Scale::of(&compared.outcome, means().chain(positions))?;
    let label = format!("{} ({})", compared.outcome.label, compared.outcome.unit);
    let up = axis.axis(&label);

    let mut plot = Plot::default();
    let policies: Vec<String> = compared.policies.iter().map(|line| line.policy.clone()).collect();
    let mut panel = plot.panel_of("Policy", &policies, up);
    axis.levels().for_each(|level| panel.level(level));
    for line in &compared.surgeons {
        let points: Vec<(f64, f64)> = places(&line.means).collect();
        panel.line("a surgeon's means", SURGEON, points.iter().copied());
        panel.dots("a surgeon's means", SURGEON, points);
    }
    let column = |place: usize| compared.surgeons.iter().filter_map(|line| line.means[place]).collect::<Vec<_>>();
    let medians: Vec<Option<f64>> = (0..policies.len()).map(|place| median(&column(place))).collect();
    panel.bars("median of the surgeons", ALL, 0.16, places(&medians));

    if compared.position.means.len() > 1 {
        let names: Vec<String> = (1..=compared.position.means.len()).map(|place| place.to_string()).collect();
        let mut panel = plot.panel_of("Position in the session", &names, axis.axis("Mean of all complete sessions"));
        axis.levels().for_each(|level| panel.level(level));
        let by_position: Vec<Option<f64>> = compared.position.means.iter().copied().map(Some).collect();
        panel.bars("mean at a position", ALL, 0.3, places(&by_position));
    }
    Some(plot.svg())
}

/// Values as points whose first coordinate counts from 1; missing values are skipped.
fn places(values: &[Option<f64>]) -> impl Iterator<Item = (f64, f64)> + '_ {
    values.iter().zip(1..).filter_map(|(value, place)| Some((f64::from(place), (*value)?)))
}

/// The vertical axis, from one round number to another.
#[derive(Debug, Clone, Copy)]
struct Scale {
    /// Distance between levels: 1, 2 or 5 times a power of ten.
    step: f64,
    /// Lower end, in steps.
    from: i64,
    /// Upper end, in steps.
    to: i64,
    /// The lowest possible value; the scale does not go below it.
    lowest: Option<f64>,
    /// The highest possible value; the scale does not go above it.
    highest: Option<f64>,
}

impl Scale {
    /// The scale of `outcome`, as a whole where it has ends: cut to the data, small differences would look large. A
    /// distance begins at its zero and ends with the data. `None` if there are no values.
    fn of(outcome: &Outcome, values: impl Iterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.collect();
        if values.is_empty() {
            return None;
        }
        let Outcome { lowest, highest, .. } = *outcome;
        let end = highest.filter(|_| outcome.outcome != FOCAL_ERROR);
        let ends = lowest.into_iter().chain(end);
        Some(Self::over(values.into_iter().chain(ends))?.within(lowest, highest))
    }

    fn over(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut ends: Option<(f64, f64)> = None;
        for value in values {
            let (low, high) = ends.unwrap_or((value, value));
            ends = Some((low.min(value), high.max(value)));
        }
        let (low, high) = ends?;

        // If all values are the same, the scale extends around their size.
        let spread = if high > low { high - low } else { high.abs().max(1.0) };
        let rough = spread / 4.0;
        let power = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|times| times * power).into_iter().find(|step| *step >= rough);
        let step = step.unwrap_or(10.0 * power);

        let from = (low / step).floor() as i64;
        let to = ((high / step).ceil() as i64).max(from + 1);
        Some(Self { step, from, to, lowest: None, highest: None })
    }

    /// The same scale, limited to values that are possible.
    const fn within(self, lowest: Option<f64>, highest: Option<f64>) -> Self {
        Self { lowest, highest, ..self }
    }

    fn from(&self) -> f64 {
        let from = self.at(self.from);
        self.lowest.map_or(from, |lowest| from.max(lowest))
    }

    fn to(&self) -> f64 {
        let to = self.at(self.to);
        self.highest.map_or(to, |highest| to.min(highest))
    }

    fn axis<'a>(&self, label: &'a str) -> Axis<'a> {
        Axis { label, from: self.from(), to: self.to() }
    }

    /// The levels strictly between the ends.
    fn levels(self) -> impl Iterator<Item = f64> {
        let levels = (self.from + 1..self.to).map(move |level| self.at(level));
        levels.filter(move |level| (self.from()..self.to()).contains(level) && *level > self.from())
    }

    /// The value of a level, rounded to six decimals to remove binary rounding errors.
    fn at(&self, level: i64) -> f64 {
        let value = level as f64 * self.step;
        format!("{value:.6}").parse().unwrap_or(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(scale: Scale) -> (f64, f64, Vec<f64>) {
        let axis = scale.axis("");
        (axis.from, axis.to, scale.levels().collect())
    }

    fn ends(values: &[f64]) -> (f64, f64, Vec<f64>) {
        told(Scale::over(values.iter().copied()).unwrap())
    }

    #[test]
    fn a_scale_goes_from_a_round_number_to_a_round_number() {
        assert_eq!(ends(&[2.5, 6.0]), (2.0, 6.0, vec![3.0, 4.0, 5.0]));
        assert_eq!(ends(&[0.11, 0.29]), (0.1, 0.3, vec![0.15, 0.2, 0.25]));
        assert_eq!(ends(&[4.0, 4.0]), (4.0, 5.0, vec![]));
        assert_eq!(ends(&[0.0]), (0.0, 0.5, vec![]));
        assert!(Scale::over(std::iter::empty()).is_none());
    }

    #[test]
    fn a_rated_outcome_is_drawn_on_its_whole_scale_and_a_distance_from_zero() {
        let outcome = |name: &str, lowest, highest| Outcome {
            outcome: name.to_owned(),
            label: String::new(),
            unit: String::new(),
            better: None,
            lowest,
            highest,
        };
        let ends = |outcome: &Outcome, values: &[f64]| {
            let (from, to, _) = told(Scale::of(outcome, values.iter().copied()).unwrap());
            (from, to)
        };
        assert_eq!(ends(&outcome("sharpness", Some(1.0), Some(7.0)), &[5.5, 6.0]), (1.0, 7.0));
        assert_eq!(ends(&outcome("workload", Some(0.0), Some(100.0)), &[41.0, 44.0]), (0.0, 100.0));
        assert_eq!(ends(&outcome(FOCAL_ERROR, Some(0.0), Some(1.0)), &[0.04, 0.09]), (0.0, 0.1));
        assert_eq!(ends(&outcome("turns", None, None), &[2.5, 6.0]), (2.0, 6.0));
        assert!(Scale::of(&outcome("sharpness", Some(1.0), Some(7.0)), std::iter::empty()).is_none());
    }

    #[test]
    fn a_scale_shows_nothing_that_no_value_can_be() {
        let rated = Scale::over([1.5, 7.0].into_iter()).unwrap();
        assert_eq!(told(rated), (0.0, 8.0, vec![2.0, 4.0, 6.0]));
        assert_eq!(told(rated.within(Some(1.0), Some(7.0))), (1.0, 7.0, vec![2.0, 4.0, 6.0]));
        assert_eq!(told(rated.within(Some(0.0), None)), (0.0, 8.0, vec![2.0, 4.0, 6.0]));
    }
}
