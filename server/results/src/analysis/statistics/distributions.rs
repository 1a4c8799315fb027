//! The distributions for p values and intervals: chi-square and F. NaN where the degrees of freedom are none.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// The probability that chi-square with `df` degrees of freedom exceeds `x`.
pub fn chi_square_above(x: f64, df: f64) -> f64 {
    ChiSquared::new(df).map_or(f64::NAN, |distribution| distribution.sf(x))
}

/// The value that F with `above` and `below` degrees of freedom exceeds with probability 1 - `share`.
pub fn f_quantile(share: f64, above: f64, below: f64) -> f64 {
    FisherSnedecor::new(above, below).map_or(f64::NAN, |distribution| distribution.inverse_cdf(share))
}
