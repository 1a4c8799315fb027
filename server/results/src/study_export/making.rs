//! Makes the export of a study. Sessions are read and verified on a few threads of lower priority than all others, so
//! that neither the control loop nor a viewer waits for the export.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use serde::Serialize;
use tokio::runtime::Handle;
use tokio::sync::oneshot;
use utoipa::ToSchema;

use super::error::StudyExportError;
use crate::package::{self, LeftOut, PackageSource, Sessions, Summary};
use parfocal_base::boxed;
use parfocal_base::files::{files_below, folder_of};
use parfocal_base::ids::SessionId;
use parfocal_base::priority;
use parfocal_recording::room;
use parfocal_records::store::export::{Export, check_new, private_folder};
use parfocal_records::store::{AccessLog, Reader};
use parfocal_trial::study::places::Enrolled;
use parfocal_trial::study::stage::Stage;

/// Maximum number of sessions that are exported at the same time. Each takes about 50 MB of memory. More sessions than
/// processors would bring nothing.
const AT_A_TIME: usize = 4;

/// The progress of an export.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = StudyExportProgress)]
pub struct ExportProgress {
    /// Number of sessions to export.
    pub sessions: usize,
    /// Number of sessions that are exported and verified.
    pub exported: usize,
    /// Number of steps for joining the sessions; 0 until all sessions are exported.
    pub steps: usize,
    /// Number of steps for joining that are done.
    pub joined: usize,
}

/// A callback that is given the progress of an export.
pub type ProgressCallback = Arc<dyn Fn(ExportProgress) + Send + Sync>;

/// A package, and the sessions in it.
pub struct ExportedStudy {
    /// What the package holds.
    pub summary: Summary,
    /// The sessions that were exported for it.
    pub sessions: Vec<SessionId>,
}

/// Exports the study `study` as a package into the folder `out`. The folder must be new or empty, and appears complete
/// or not at all. Each session's export is recorded in the database as an export of its own.
///
/// # Errors
/// If there is no such study, it has no session to export, the policies are requested before it is unblinded, an export
/// cannot be verified, or `out` cannot be written.
#[boxed]
pub async fn export_study(
    access_log: &AccessLog,
    study: &str,
    unblinded: bool,
    out: &Path,
    progress: ProgressCallback,
) -> Result<ExportedStudy, StudyExportError> {
    let (sessions, left_out) = sessions_of(access_log.reader(), study, unblinded).await?;
    // An export that cannot be written is not recorded.
    check_new(out)?;
    let exported = sessions.clone();
    let making =
        Making { access_log: access_log.clone(), sessions, left_out, unblinded, out: out.to_owned(), progress };

    let runtime = Handle::current();
    let (done, made) = oneshot::channel();
    let thread = thread::Builder::new().name("study-export".to_owned());
    let work = move || {
        // The threads that this one starts inherit the lower priority.
        priority::lower_further();
        // The receiver may have been dropped; then nobody needs the result.
        let _ = done.send(making.run(&runtime));
    };

    thread.spawn(work).map_err(|error| StudyExportError::unwritable(out, &error))?;
    let summary = made.await.map_err(|_| StudyExportError::broken())??;
    Ok(ExportedStudy { summary, sessions: exported })
}

/// Checks that `study` can be exported, before anything is recorded or started.
///
/// # Errors
/// If there is no such study, it has no session to export, the policies are requested before it is unblinded, or the
/// database failed.
pub async fn check(reader: &Reader, study: &str, unblinded: bool) -> Result<(), StudyExportError> {
    sessions_of(reader, study, unblinded).await.map(|_| ())
}

/// The sessions of `study` to export, and those that are left out because they are withdrawn.
#[boxed]
async fn sessions_of(
    reader: &Reader,
    study: &str,
    unblinded: bool,
) -> Result<(Vec<SessionId>, Vec<LeftOut>), StudyExportError> {
    let Some(stored) = reader.study(study).await? else {
        let names = reader.study_names().await?;
        let known = if names.is_empty() { "none yet".to_owned() } else { names.join(", ") };
        return Err(StudyExportError::NoStudy { study: study.to_owned(), known });
    };

    let withdrawn = |session: &Enrolled| LeftOut {
        session: session.session.to_string(),
        site: session.site.clone(),
        protocol: session.protocol.clone(),
        reason: "the participant withdrew".to_owned(),
    };
    let left_out = stored.sessions.iter().filter(|session| session.withdrawn).map(withdrawn).collect();
    let kept: Vec<&Enrolled> = stored.sessions.iter().filter(|session| !session.withdrawn).collect();
    if kept.is_empty() {
        return Err(StudyExportError::Refused(format!("study '{study}' has no session to export")));
    }
    if unblinded && stored.state().stage != Stage::Unblinded && kept.iter().any(|session| !session.unblinded) {
        return Err(StudyExportError::Refused(format!(
            "study '{study}' is not unblinded: export it without its policies, or unblind it first"
        )));
    }

    Ok((kept.into_iter().map(|session| session.session).collect(), left_out))
}

/// An export with its sessions and its target folder.
struct Making {
    access_log: AccessLog,
    sessions: Vec<SessionId>,
    left_out: Vec<LeftOut>,
    unblinded: bool,
    out: PathBuf,
    progress: ProgressCallback,
}

impl Making {
    /// Makes the package. Must not be called on a thread of `runtime`, because it blocks.
    fn run(&self, runtime: &Handle) -> Result<Summary, StudyExportError> {
        let parent = folder_of(&self.out);
        let unwritable = |error| StudyExportError::unwritable(parent, &error);
        std::fs::create_dir_all(parent).map_err(unwritable)?;
        let exports = private_folder(parent, ".parfocal-exports-").map_err(unwritable)?;

        let sources = self.export_sessions(runtime, exports.path())?;
        // The joined tables take about as much space again as the exports.
        check_room(parent, size_of(exports.path()).map_err(unwritable)?)?;

        let all = self.sessions.len();
        let summary = package::write(&sources, Sessions::Moved, &self.left_out, &self.out, &mut |joined, steps| {
            (self.progress)(ExportProgress { sessions: all, exported: all, steps, joined });
        })?;
        Ok(summary)
    }

    /// Exports and verifies each session into a folder of its own below `folder`.
    fn export_sessions(&self, runtime: &Handle, folder: &Path) -> Result<Vec<PackageSource>, StudyExportError> {
        let processors = thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let work = Work {
            making: self,
            runtime,
            folder,
            next: AtomicUsize::new(0),
            stopped: AtomicBool::new(false),
            exported: Mutex::new(Vec::new()),
            turn: tokio::sync::Mutex::new(()),
        };

        self.tell(0);
        let outcomes: Vec<Result<(), StudyExportError>> = thread::scope(|scope| {
            let workers: Vec<_> = (0..processors.min(AT_A_TIME)).map(|_| scope.spawn(|| work.run())).collect();
            workers
                .into_iter()
                .map(|worker| worker.join().unwrap_or_else(|_| Err(StudyExportError::broken())))
                .collect()
        });
        outcomes.into_iter().collect::<Result<(), _>>()?;

        let mut exported = work.exported.into_inner().unwrap_or_else(PoisonError::into_inner);
        exported.sort_by_key(|(place, _)| *place);
        Ok(exported.into_iter().map(|(_, source)| source).collect())
    }

    fn tell(&self, exported: usize) {
        (self.progress)(ExportProgress { sessions: self.sessions.len(), exported, steps: 0, joined: 0 });
    }
}

/// The sessions being exported, shared by all worker threads.
struct Work<'a> {
    making: &'a Making,
    runtime: &'a Handle,
    folder: &'a Path,
    /// Index of the next session to export.
    next: AtomicUsize,
    /// Whether an export failed, so that the other threads can stop.
    stopped: AtomicBool,
    /// The finished exports, each with the session's index in the study.
    exported: Mutex<Vec<(usize, PackageSource)>>,
    /// Held while an export is prepared. An export ends with its own record in the chain, so two exports must not be
    /// recorded at the same moment.
    turn: tokio::sync::Mutex<()>,
}

impl Work<'_> {
    fn run(&self) -> Result<(), StudyExportError> {
        while !self.stopped.load(Ordering::Relaxed) {
            let place = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(&session) = self.making.sessions.get(place) else { break };
            let source = self.export(session).inspect_err(|_| self.stopped.store(true, Ordering::Relaxed))?;

            let mut exported = self.exported.lock().unwrap_or_else(PoisonError::into_inner);
            exported.push((place, source));
            self.making.tell(exported.len());
        }
        Ok(())
    }

    fn export(&self, session: SessionId) -> Result<PackageSource, StudyExportError> {
        check_room(self.folder, 1)?;
        let folder = self.folder.join(session.to_string());
        self.runtime.block_on(async {
            let turn = self.turn.lock().await;
            let export = Export::prepare(&self.making.access_log, session, self.making.unblinded).await?;
            drop(turn);
            export.into_folder(&folder).await
        })?;
        Ok(PackageSource::open(&folder)?)
    }
}

/// Checks that `bytes` more on the disk of `folder` leave its reserve free. Comments and answers of a session need that
/// space.
fn check_room(folder: &Path, bytes: u64) -> Result<(), StudyExportError> {
    // If the free space is unknown, writing reports an error when the disk is full.
    let Ok(room) = room(folder) else { return Ok(()) };
    if room.spare() < bytes {
        return Err(StudyExportError::Failed(format!(
            "the disk of {} has no room for the export: {:.1} GB have to stay free for trials; remove what is no \
             longer needed there, and export again",
            folder.display(),
            room.reserve as f64 / 1e9
        )));
    }
    Ok(())
}

/// Total size of all files below `folder`, in bytes.
fn size_of(folder: &Path) -> io::Result<u64> {
    let mut bytes = 0;
    for file in files_below(folder)? {
        bytes += std::fs::metadata(folder.join(file))?.len();
    }
    Ok(bytes)
}
