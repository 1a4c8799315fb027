//! `parfocal restore`: puts a backup in the place of the database, and keeps what was there.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::output::{Failure, print};
use super::wait::wait_for;
use crate::clock::SystemClock;
use crate::store::backup::{self, Relation, Restored};

/// Arguments of `parfocal restore`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// File that `parfocal backup` wrote.
    file: PathBuf,
    /// Folder of the server's database. No server may run on it.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
    /// Print a summary as JSON.
    #[arg(long)]
    json: bool,
}

/// Restores the backup.
///
/// # Errors
/// When a server runs on the folder, or the backup does not verify; then nothing was changed.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let restored = wait_for(backup::restore(&arguments.data_dir, &arguments.file, Arc::new(SystemClock)))??;
    if arguments.json {
        return print(&(serde_json::to_string(&restored)? + "\n"));
    }

    let file = arguments.file.display();
    let kept = restored.kept.as_ref();
    let kept = kept.map_or_else(String::new, |kept| format!("what was there is kept as {}\n", kept.display()));
    let relation = in_words(&restored);
    print(&format!("restored {file}, verified\nchain {}\n{kept}{relation}", restored.backup))
}

fn in_words(restored: &Restored) -> String {
    let replaced = restored.replaced.as_deref().unwrap_or("unknown");
    match restored.relation {
        Relation::Nothing => String::new(),
        Relation::Same => "the backup has all that was there\n".to_owned(),
        Relation::Later => format!("the backup goes on where what was there ended ({replaced})\n"),
        Relation::Earlier { rows } => {
            format!("WARNING: what was there ({replaced}) went on for {rows} rows that the backup does not have\n")
        }
        Relation::Apart { row } => format!(
            "WARNING: the backup is not of the same history as what was there ({replaced}): they part at row {row}\n"
        ),
    }
}
