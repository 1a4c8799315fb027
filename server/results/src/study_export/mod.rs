//! The export of a whole study: each session is exported and verified, several at a time, and then all are joined into
//! one package. The command waits for the export; a running server makes it in the background.

mod background;
mod error;
mod making;

pub use self::background::{FinishedExport, StudyExportState, StudyExports};
pub use self::error::StudyExportError;
pub use self::making::{ExportProgress, check, export_study};
