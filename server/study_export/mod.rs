//! The export of a whole study: each session exported and verified, several at a time, then all of them joined to one
//! package. On the command line somebody waits for it; while the server runs it is made in the background.

mod background;
mod error;
mod making;

pub use self::background::{Made, StudyExportState, StudyExports};
pub use self::error::StudyExportError;
pub use self::making::{Progress, check, export_study};
