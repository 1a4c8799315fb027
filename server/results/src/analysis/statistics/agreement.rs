//! Agreement between repeats: the intraclass correlation ICC(A,1) of McGraw & Wong (1996, Psychological Methods 1:30),
//! which is ICC(2,1) of Shrout & Fleiss (1979, Psychological Bulletin 86:420): two-way, absolute agreement, of a single
//! rating. On ordinal ratings it equals weighted kappa with quadratic weights, except for terms that vanish with the
//! number of subjects (Fleiss & Cohen 1973, Educational and Psychological Measurement 33:613).

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use utoipa::ToSchema;

/// Agreement of repeats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Agreement {
    /// ICC(A,1), at most 1; negative if repeats differ more than subjects.
    pub icc: f64,
    /// Lower end of its 95 % interval; none if it cannot be computed.
    pub low: Option<f64>,
    /// Upper end of its 95 % interval; none if it cannot be computed.
    pub high: Option<f64>,
}

/// The agreement within `subjects`, each with the same two or more repeats. `None` for fewer than two subjects or
/// repeats, if all values are equal, and if all subjects and all repeats have the same mean.
pub fn agreement(subjects: &[Vec<f64>]) -> Option<Agreement> {
    let repeats = subjects.first()?.len();
    if subjects.len() < 2 || repeats < 2 {
        return None;
    }
    let n = subjects.len() as f64;
    let k = repeats as f64;
    let grand = subjects.iter().flatten().sum::<f64>() / (n * k);

    // Mean squares of a two-way analysis of variance without replication.
    let subject_means: Vec<f64> = subjects.iter().map(|row| row.iter().sum::<f64>() / k).collect();
    let repeat_mean = |repeat: usize| subjects.iter().map(|row| row[repeat]).sum::<f64>() / n;
    let repeat_means: Vec<f64> = (0..repeats).map(repeat_mean).collect();

    let all: f64 = subjects.iter().flatten().map(|value| (value - grand).powi(2)).sum();
    let between_subjects: f64 = k * subject_means.iter().map(|mean| (mean - grand).powi(2)).sum::<f64>();
    let between_repeats: f64 = n * repeat_means.iter().map(|mean| (mean - grand).powi(2)).sum::<f64>();
    // Values that differ only by rounding are equal.
    let scale = subjects.iter().flatten().map(|value| value * value).sum::<f64>();
    if all <= scale * 1e-24 {
        return None;
    }

    let subjects_square = between_subjects / (n - 1.0);
    let repeats_square = between_repeats / (k - 1.0);
    let rest = (all - between_subjects - between_repeats).max(0.0);
    let error_square = if rest <= all * 1e-14 { 0.0 } else { rest / ((n - 1.0) * (k - 1.0)) };

    let divisor = subjects_square + (k - 1.0) * error_square + k * (repeats_square - error_square) / n;
    // Two subjects of two repeats that differ the other way round, such as 3, 4 and 4, 3.
    if divisor <= error_square * 1e-12 {
        return None;
    }
    let icc = (subjects_square - error_square) / divisor;
    if icc >= 1.0 - 1e-12 {
        return Some(Agreement { icc: 1.0, low: None, high: None });
    }

    let squares = MeanSquares { subjects: subjects_square, repeats: repeats_square, error: error_square };
    let (low, high) = squares.interval(icc, n, k).unzip();
    Some(Agreement { icc, low, high })
}

/// Mean squares of a two-way analysis of variance.
struct MeanSquares {
    subjects: f64,
    repeats: f64,
    error: f64,
}

impl MeanSquares {
    /// The 95 % interval of `icc`, of `n` subjects with `k` repeats each: McGraw & Wong 1996, table 7, case 2A, with
    /// degrees of freedom by Satterthwaite. `None` if these come to nothing: below 0 their parts can cancel out.
    fn interval(&self, icc: f64, n: f64, k: f64) -> Option<(f64, f64)> {
        let repeats = k * icc / (n * (1.0 - icc)) * self.repeats;
        let error = (1.0 + k * icc * (n - 1.0) / (n * (1.0 - icc))) * self.error;
        let spread = repeats.powi(2) / (k - 1.0) + error.powi(2) / ((n - 1.0) * (k - 1.0));
        let df = (repeats + error).powi(2) / spread;
        let f_low = f_quantile(0.975, n - 1.0, df);
        let f_high = f_quantile(0.975, df, n - 1.0);

        let rest = k * self.repeats + (k * n - k - n) * self.error;
        let low = n * (self.subjects - f_low * self.error) / (f_low * rest + n * self.subjects);
        let high = n * (f_high * self.subjects - self.error) / (rest + n * f_high * self.subjects);
        (low.is_finite() && high.is_finite()).then_some((low, high))
    }
}

/// The value that F with `above` and `below` degrees of freedom exceeds with probability 1 - `share`; NaN where the
/// degrees of freedom are none.
fn f_quantile(share: f64, above: f64, below: f64) -> f64 {
    FisherSnedecor::new(above, below).map_or(f64::NAN, |distribution| distribution.inverse_cdf(share))
}
