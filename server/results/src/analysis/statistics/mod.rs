//! The statistics of an analysis, in addition to those of evaluations: summaries, tests over more than two policies,
//! trends and agreement. Values are numbers of any unit; a block holds a surgeon's or session's values, one for each
//! treatment.

mod agreement;
mod friedman;
mod summary;
mod trend;

#[cfg(test)]
mod tests;

pub use agreement::{Agreement, agreement};
pub use friedman::{Friedman, PermutationMethod, concordance, friedman};
pub use summary::{Interval, Summary, median, summary};
pub use trend::{Trend, trend};
