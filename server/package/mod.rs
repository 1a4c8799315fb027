//! A study's package: the exports of its sessions, whole and verified, and beside them their tables joined, as CSV and
//! Parquet, with what R, SPSS and REDCap need to read them.
//!
//! The joined tables say nothing that the exports do not say. So whoever distrusts them verifies the exports and joins
//! them again, which `check` does.

mod check;
mod description;
mod error;
mod join;
mod labels;
mod parquet;
mod r;
mod redcap;
mod source;
mod spss;
mod table;
mod writing;

pub use self::check::{check, is_package};
pub use self::error::PackageError;
pub use self::source::{LeftOut, Source, exports_of, left_out};
pub use self::writing::{Sessions, Summary, write};
