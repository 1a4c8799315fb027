//! `parfocal export`: a session's data, or a whole study's, as a folder, while the server runs or not.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::output::{Failure, print, steps};
use crate::clock::SystemClock;
use crate::ids::SessionId;
use crate::package::{self, LeftOut, Source};
use crate::store::Recorder;
use crate::store::export::export;
use crate::trial::study::places::Enrolled;

/// Arguments of `parfocal export`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Id of the session, as on the researcher's page.
    #[arg(required_unless_present = "study", conflicts_with = "study")]
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
/// When there is no such session, it has not been unblinded though the policies are asked for, or the
/// folder cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(write(arguments))
}

async fn write(arguments: &Arguments) -> Result<(), Failure> {
    let recorder = Recorder::open(&arguments.data_dir, Arc::new(SystemClock)).await?;
    let written = match (arguments.session, &arguments.study) {
        (Some(session), _) => write_session(&recorder, session, arguments).await,
        (None, Some(study)) => write_study(&recorder, study, arguments).await,
        (None, None) => Err("name a session, or a study by --study".into()),
    };
    recorder.close().await;
    written
}

async fn write_session(recorder: &Recorder, session: SessionId, arguments: &Arguments) -> Result<(), Failure> {
    let summary = export(recorder, session, &arguments.out, arguments.unblinded).await?;
    if arguments.json {
        return print(&(serde_json::to_string(&summary)? + "\n"));
    }
    let kind = if summary.unblinded { "unblinded" } else { "blinded" };
    let practice = if summary.practice { ", practice" } else { "" };
    let folder = summary.folder.display();
    print(&format!("{} files ({kind}{practice}) in {folder}\nchain {}\n", summary.files.len(), summary.head))
}

/// Exports each session of `study` into a temporary folder, and joins them.
async fn write_study(recorder: &Recorder, study: &str, arguments: &Arguments) -> Result<(), Failure> {
    let out = &arguments.out;
    let stored = recorder.reader().study(study).await?;
    let stored = stored.ok_or_else(|| format!("there is no study '{study}'; `parfocal study show` lists all"))?;

    let withdrawn = |session: &Enrolled| LeftOut {
        session: session.session.to_string(),
        reason: "the participant withdrew".to_owned(),
    };
    let left_out: Vec<LeftOut> = stored.sessions.iter().filter(|session| session.withdrawn).map(withdrawn).collect();
    let sessions: Vec<&Enrolled> = stored.sessions.iter().filter(|session| !session.withdrawn).collect();
    if sessions.is_empty() {
        return Err(format!("study '{study}' has no session to export").into());
    }

    let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(parent).map_err(|error| format!("cannot write {}: {error}", parent.display()))?;
    let exports = tempfile::Builder::new().prefix(".parfocal-exports-").tempdir_in(parent)?;

    let progress = steps(sessions.len(), "sessions exported");
    let mut sources = Vec::new();
    for session in &sessions {
        let folder = exports.path().join(session.session.to_string());
        export(recorder, session.session, &folder, arguments.unblinded).await?;
        sources.push(Source::open(&folder)?);
        progress.inc(1);
    }
    progress.finish_and_clear();

    join(&sources, &left_out, out, arguments.json)
}

/// Writes the package of `sources` with a progress bar, and tells what it holds.
pub fn join(sources: &[Source], left_out: &[LeftOut], out: &Path, json: bool) -> Result<(), Failure> {
    let progress = steps(0, "steps of joining");
    let summary = package::write(sources, left_out, out, &mut |done, total| {
        progress.set_length(total as u64);
        progress.set_position(done as u64);
    })?;
    progress.finish_and_clear();

    if json {
        return print(&(serde_json::to_string(&summary)? + "\n"));
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
