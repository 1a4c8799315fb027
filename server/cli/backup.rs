//! `parfocal backup`: a verified copy of the database, while the server runs or not.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::output::{Failure, print, wait_for};
use parfocal_base::clock::SystemClock;
use parfocal_base::notices;
use parfocal_records::store::backup::{self, Backup};

/// Arguments of `parfocal backup`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// File to write; it must not exist yet. `-` writes to standard output, and the summary to standard error.
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
    let sent = arguments.out.as_os_str() == "-";
    let made = if sent {
        send(arguments)?
    } else {
        wait_for(backup::backup(&arguments.data_dir, &arguments.out, Arc::new(SystemClock)))??
    };

    let summary = if arguments.json {
        serde_json::to_string(&made)?
    } else {
        format!("{}: {} bytes, verified\nchain {}", made.file.display(), made.bytes, made.head)
    };
    if sent {
        notices::tell(format_args!("{summary}"));
        return Ok(());
    }
    print(&(summary + "\n"))
}

/// Writes the backup to standard output.
fn send(arguments: &Arguments) -> Result<Backup, Failure> {
    let mut output = std::io::stdout();
    if output.is_terminal() {
        bail!("a backup is no text: send it into a file, such as `parfocal backup --out - > backup.db`");
    }
    Ok(wait_for(backup::backup_to(&arguments.data_dir, &mut output, Arc::new(SystemClock)))??)
}
