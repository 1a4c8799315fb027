//! A study's package: the exports of its sessions, complete and verified, and their joined tables, as CSV and Parquet,
//! with what R, SPSS and REDCap need to read them.
//!
//! The joined tables contain nothing that the exports do not contain. So anyone who distrusts them can verify the
//! exports and join them again, as `check` does.

mod check;
mod description;
mod error;
mod join;
mod parquet;
pub mod playable;
mod r;
mod redcap;
mod source;
mod spss;
mod table;
mod writing;

pub use self::check::{check, is_package};
pub use self::error::PackageError;
pub use self::source::{LeftOut, PackageSource, check_outside, exports_of, left_out, may_read};
pub use self::writing::{Sessions, Summary, write};
