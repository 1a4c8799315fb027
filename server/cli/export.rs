//! `parfocal export`: a session's data as a folder, while the server runs or not.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::output::{Failure, print};
use crate::clock::SystemClock;
use crate::ids::SessionId;
use crate::store::Recorder;
use crate::store::export::export;

/// Arguments of `parfocal export`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Id of the session, as on the researcher's page.
    session: SessionId,
    /// Folder to write: new or empty.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Include which policy ran in which setting; possible only after unblinding.
    #[arg(long)]
    unblinded: bool,
    /// Folder of the server's database.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
    /// Print a summary as JSON.
    #[arg(long)]
    json: bool,
}

/// Writes the export.
///
/// # Errors
/// When there is no such session, it has not been unblinded though the policies are asked for, or the
/// folder cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(write(arguments))
}

async fn write(arguments: &Arguments) -> Result<(), Failure> {
    let recorder = Recorder::open(&arguments.data_dir, Arc::new(SystemClock)).await?;
    let summary = export(&recorder, arguments.session, &arguments.out, arguments.unblinded).await?;
    recorder.close().await;
    if arguments.json {
        return print(&(serde_json::to_string(&summary)? + "\n"));
    }
    let kind = if summary.unblinded { "unblinded" } else { "blinded" };
    let practice = if summary.practice { ", practice" } else { "" };
    let folder = summary.folder.display();
    print(&format!("{} files ({kind}{practice}) in {folder}\nchain {}\n", summary.files.len(), summary.head))
}
