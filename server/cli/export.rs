//! `parfocal export`: a session's data, or a whole study's, as a folder, while the server runs or not.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::output::{Failure, Steps, print, print_json, wait_for};
use parfocal_base::clock::SystemClock;
use parfocal_base::ids::SessionId;
use parfocal_records::store::AccessLog;
use parfocal_records::store::export::export;
use parfocal_results::package::{self, LeftOut, PackageSource, Sessions, Summary};
use parfocal_results::study_export::{ExportProgress, export_study};

/// Arguments of `parfocal export`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Id of the session, as on the researcher's page.
    #[arg(required_unless_present = "study", conflicts_with = "study", value_parser = session)]
    session: Option<SessionId>,
    /// All sessions of a study in one package: CSV, Parquet, and files for R, SPSS and REDCap.
    #[arg(long, value_name = "STUDY")]
    study: Option<String>,
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
/// If there is no such session, the policies are requested before unblinding, or the folder cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    wait_for(write(arguments))?
}

async fn write(arguments: &Arguments) -> Result<(), Failure> {
    let access_log = AccessLog::open(&arguments.data_dir, Arc::new(SystemClock)).await?;
    let written = match (arguments.session, &arguments.study) {
        (Some(session), _) => write_session(&access_log, session, arguments).await,
        (None, Some(study)) => write_study(&access_log, study, arguments).await,
        (None, None) => Err("name a session, or a study by --study".into()),
    };
    access_log.close().await;
    written
}

async fn write_session(access_log: &AccessLog, session: SessionId, arguments: &Arguments) -> Result<(), Failure> {
    let summary = export(access_log, session, &arguments.out, arguments.unblinded).await?;
    if arguments.json {
        return print_json(&summary);
    }
    let kind = if summary.unblinded { "unblinded" } else { "blinded" };
    let practice = if summary.practice { ", practice" } else { "" };
    let folder = summary.folder.display();
    print(&format!("{} files ({kind}{practice}) in {folder}\nchain {}\n", summary.files.len(), summary.head))
}

/// Exports all of `study`, and shows the progress.
async fn write_study(access_log: &AccessLog, study: &str, arguments: &Arguments) -> Result<(), Failure> {
    let steps = Arc::new(Steps::new());
    let report = {
        let steps = Arc::clone(&steps);
        move |progress: ExportProgress| match progress.steps {
            0 => steps.tell("sessions exported", progress.exported, progress.sessions),
            all => steps.tell("steps of joining", progress.joined, all),
        }
    };

    let exported = export_study(access_log, study, arguments.unblinded, &arguments.out, Arc::new(report)).await;
    steps.end();
    tell(&exported?.summary, arguments.json)
}

/// Writes the package of `sources`, shows the progress, and prints what the package holds.
pub fn join(sources: &[PackageSource], left_out: &[LeftOut], out: &Path, json: bool) -> Result<(), Failure> {
    let steps = Steps::new();
    let joined = package::write(sources, Sessions::Copied, left_out, out, &mut |done, all| {
        steps.tell("steps of joining", done, all);
    });
    steps.end();
    tell(&joined?, json)
}

/// Prints what a package holds.
fn tell(summary: &Summary, json: bool) -> Result<(), Failure> {
    if json {
        return print_json(summary);
    }
    let kind = if summary.unblinded { "unblinded" } else { "blinded" };
    let left_out = match summary.left_out.len() {
        0 => String::new(),
        number => format!("; left out because they were withdrawn: {number}"),
    };
    print(&format!(
        "study {} ({kind}), sites {}: {} sessions in {}{left_out}\n",
        summary.study,
        summary.sites.join(", "),
        summary.sessions,
        summary.folder.display(),
    ))
}

fn session(text: &str) -> Result<SessionId, String> {
    text.parse().map_err(|_| "must be a session's whole id, as on the researcher's page".to_owned())
}
