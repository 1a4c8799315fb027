//! Analysis of a study after it was unblinded: outcomes by policy, tests, agreement, words side by side, figures and
//! tables.

mod comparison;
mod database;
mod error;
mod exports;
mod figures;
mod gathering;
mod outcomes;
mod records;
mod report;
pub mod statistics;
mod study;
mod tables;
mod words;
mod writing;

#[cfg(test)]
mod tests;

pub use comparison::{Comparison, Difference, LEVEL, Pair, PolicySummary, Position, Repeats, SurgeonMeans, compare};
pub use database::check;
pub use error::AnalysisError;
pub use figures::figure;
pub use outcomes::{Outcome, Value};
pub use report::{
    AnalysedSession, Analysis, ProtocolAnalysis, SettingWords, SiteAnalysis, SurgeonWords, WholeSessions, Words,
};
pub use study::{analyse, analyse_package};
pub use tables::TABLES;
pub use words::{counted, decimals, p_words};
