//! `parfocal backup`: a verified copy of the database, while the server runs or not.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::output::{Failure, print};
use super::wait::wait_for;
use parfocal_base::clock::SystemClock;
use parfocal_records::store::backup;

/// Arguments of `parfocal backup`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// File to write; it must not exist yet.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Folder of the server's database.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
    /// Print a summary as JSON.
    #[arg(long)]
    json: bool,
}

/// Writes the backup.
///
/// # Errors
/// If the file exists or cannot be written, there is no database, or the copy does not verify.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let made = wait_for(backup::backup(&arguments.data_dir, &arguments.out, Arc::new(SystemClock)))??;
    if arguments.json {
        return print(&(serde_json::to_string(&made)? + "\n"));
    }
    print(&format!("{}: {} bytes, verified\nchain {}\n", made.file.display(), made.bytes, made.head))
}
