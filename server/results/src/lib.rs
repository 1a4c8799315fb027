//! What becomes of a study: its package, its analysis, and the export that makes both.
//!
//! [`study_export`] exports every session of a study, several at a time. [`package`] joins and verifies the exports and
//! writes them for R, SPSS, REDCap and Parquet. [`analysis`] compares an unblinded study's outcomes by policy.

pub mod analysis;
pub mod package;
pub mod study_export;
