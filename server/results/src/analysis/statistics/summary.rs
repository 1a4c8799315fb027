//! Mean, median and standard deviation of a sample.

use serde::Serialize;
use utoipa::ToSchema;

/// Summary of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Summary {
    /// Number of values.
    pub n: usize,
    /// Mean; none without values.
    pub mean: Option<f64>,
    /// Median; none without values.
    pub median: Option<f64>,
    /// Standard deviation of the sample (divided by n - 1); none for fewer than two values.
    pub sd: Option<f64>,
}

/// A 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The summary of `values`.
pub fn summary(values: &[f64]) -> Summary {
    let n = values.len();
    let mean = (n > 0).then(|| values.iter().sum::<f64>() / n as f64);
    let squares = mean.map(|mean| values.iter().map(|value| (value - mean).powi(2)).sum::<f64>());
    let sd = squares.filter(|_| n > 1).map(|squares| (squares / (n as f64 - 1.0)).sqrt());
    Summary { n, mean, median: median(values), sd }
}

/// The median; for an even number of values, the mean of the two in the middle. `None` without values.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let above = *sorted.get(sorted.len() / 2)?;
    let below = sorted[(sorted.len() - 1) / 2];
    Some(f64::midpoint(below, above))
}
