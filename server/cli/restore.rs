//! `parfocal restore`: replaces the database by a backup, and keeps the old one.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::output::{Failure, print, print_json, wait_for};
use parfocal_base::clock::SystemClock;
use parfocal_records::store::backup::{self, Relation, Restored};

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
/// If a server runs on the folder, or the backup does not verify; nothing is changed then.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let restored = wait_for(backup::restore(&arguments.data_dir, &arguments.file, Arc::new(SystemClock)))??;
    if arguments.json {
        return print_json(&restored);
    }

    let file = arguments.file.display();
    let kept = restored.kept.as_ref();
    let kept = kept.map_or_else(String::new, |kept| format!("the old database is kept as {}\n", kept.display()));
    let relation = in_words(&restored);
    print(&format!("restored {file}, verified\nchain {}\n{kept}{relation}", restored.backup))
}

fn in_words(restored: &Restored) -> String {
    let replaced = restored.replaced.as_deref().unwrap_or("unknown");
    match restored.relation {
        Relation::Nothing => String::new(),
        Relation::Same => "the backup contains everything that the old database had\n".to_owned(),
        Relation::Later => format!("the backup continues where the old database ended ({replaced})\n"),
        Relation::Earlier { rows } => {
            format!("WARNING: the old database ({replaced}) had {rows} more rows, which the backup does not have\n")
        }
        Relation::Apart { row } => format!(
            "WARNING: the backup and the old database ({replaced}) have different histories from row {row} on\n"
        ),
    }
}
