//! Backups of a database: made while a server writes, verified before they get their name, and put back.

use std::fs::{DirBuilder, File};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;
use serde::Serialize;
use tempfile::NamedTempFile;

use super::database::lock;
use super::export::verify::{Check, Verdict};
use super::schema::DATABASE;
use super::verify::checks;
use super::{Access, Head, Reader, Recorder, StoreError};
use crate::clock::Clock;
use crate::files::{make_private, sync_folder_of};

/// Why nothing was backed up or restored.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// The file to write is there.
    #[error("{} exists; choose a new name", .0.display())]
    Exists(PathBuf),
    /// A file could not be read or written.
    #[error("cannot use {}: {error}", .path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The copy does not verify.
    #[error("{what} does not verify: {problem}; nothing was changed")]
    Unsound {
        /// Which copy.
        what: String,
        /// What is wrong with it.
        problem: String,
    },
    /// The database failed.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// Another program reads the database that is to be replaced.
    #[error("another program has the database {} open; close it and try again; nothing was changed", .0.display())]
    Open(PathBuf),
}

impl BackupError {
    fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |error| Self::File { path: path.to_owned(), error }
    }
}

/// A backup that was made.
#[derive(Debug, Clone, Serialize)]
pub struct Backup {
    /// Its file.
    pub file: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// The head of its chain.
    pub head: String,
}

/// How the chain of a backup and that of the database it replaced belong together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "relation", rename_all = "kebab-case")]
pub enum Relation {
    /// There was no database, or none with a chain that can be read.
    Nothing,
    /// They are the same.
    Same,
    /// The backup goes on where the database ended.
    Later,
    /// The database went on after the backup was made.
    Earlier {
        /// Rows of the database that the backup does not have.
        rows: i64,
    },
    /// They are of different histories.
    Apart {
        /// The first row that differs.
        row: i64,
    },
}

/// A restore that was made.
#[derive(Debug, Clone, Serialize)]
pub struct Restored {
    /// The head of the backup.
    pub backup: String,
    /// The head of what was replaced.
    pub replaced: Option<String>,
    /// Where that is kept.
    pub kept: Option<PathBuf>,
    /// How the two belong together.
    #[serde(flatten)]
    pub relation: Relation,
}

/// Copies the database of data folder `folder` to the new file `out`, whether or not a server has it open. The
/// copy gets its name once it is verified and on the disk.
///
/// # Errors
/// When `out` is there or cannot be written, the database cannot be read, or the copy does not verify.
pub async fn backup(folder: &Path, out: &Path, clock: Arc<dyn Clock>) -> Result<Backup, BackupError> {
    if out.exists() {
        return Err(BackupError::Exists(out.to_owned()));
    }

    let copy = temporary_beside(out)?;
    let recorder = Recorder::open(folder, clock).await?;
    recorder.record(&Access::BackedUp).await?;
    let copied = recorder.reader().copy_to(copy.path()).await;
    recorder.close().await;
    copied?;

    let head = verified(copy.path(), &out.display().to_string()).await?;
    let bytes = copy.as_file().metadata().map_err(BackupError::file(out))?.len();
    synced(copy.path())?;
    copy.persist_noclobber(out).map_err(|error| match error.error.kind() {
        std::io::ErrorKind::AlreadyExists => BackupError::Exists(out.to_owned()),
        _ => BackupError::File { path: out.to_owned(), error: error.error },
    })?;
    sync_folder_of(out);
    Ok(Backup { file: out.to_owned(), bytes, head: head.to_string() })
}

/// Puts the backup `file` in the place of the database of data folder `folder`. What was there is kept beside it.
///
/// # Errors
/// When a server has the folder, the backup does not verify, or a file cannot be written. Then nothing was changed.
pub async fn restore(folder: &Path, file: &Path, clock: Arc<dyn Clock>) -> Result<Restored, BackupError> {
    DirBuilder::new().recursive(true).mode(0o700).create(folder).map_err(BackupError::file(folder))?;
    let _lock = lock(folder)?;
    let database = folder.join(DATABASE);

    let copy = temporary_beside(&database)?;
    std::fs::copy(file, copy.path()).map_err(BackupError::file(file))?;
    make_private(copy.path()).map_err(BackupError::file(copy.path()))?;
    let head = verified(copy.path(), &file.display().to_string()).await?;

    let there = database.exists();
    let present = if there { readable(&database).await } else { None };
    let relation = relation(present.as_ref(), copy.path(), &head).await?;
    let replaced = match &present {
        Some(reader) => Some(reader.head().await?),
        None => None,
    };
    if let Some(reader) = present {
        reader.close().await;
    }

    let recorder = Recorder::open_file(copy.path(), Arc::clone(&clock)).await?;
    recorder.record(&Access::Restored { replaced: replaced.clone() }).await?;
    recorder.close().await;
    synced(copy.path())?;

    let kept = if there { Some(set_aside(&database, clock.wall()).await?) } else { None };
    copy.persist(&database).map_err(|error| BackupError::File { path: database.clone(), error: error.error })?;
    sync_folder_of(&database);
    let replaced = replaced.map(|head| head.to_string());
    Ok(Restored { backup: head.to_string(), replaced, kept, relation })
}

/// The database `file` if it can be read by this version.
async fn readable(file: &Path) -> Option<Reader> {
    let reader = Reader::open_checked(file).await.ok()?;
    if reader.head().await.is_ok() { Some(reader) } else { None }
}

/// How the chain in `backup`, with this head, belongs to the one that `present` reads.
async fn relation(present: Option<&Reader>, backup: &Path, head: &Head) -> Result<Relation, BackupError> {
    let Some(present) = present else { return Ok(Relation::Nothing) };
    let ours = present.hashes().await?;
    let reader = Reader::open_checked(backup).await?;
    let theirs = reader.hashes().await?;
    reader.close().await;

    if let Some(place) = ours.iter().zip(&theirs).position(|(ours, theirs)| ours != theirs) {
        return Ok(Relation::Apart { row: place as i64 + 1 });
    }
    Ok(match ours.len() as i64 - head.number {
        0 => Relation::Same,
        ..0 => Relation::Later,
        rows => Relation::Earlier { rows },
    })
}

/// Gives the database a dated name beside it. The new one can then take its place in one step.
async fn set_aside(database: &Path, now: Timestamp) -> Result<PathBuf, BackupError> {
    let sibling = |of: &Path, suffix: &str| {
        let name = of.file_name().unwrap_or_default().to_string_lossy().into_owned();
        of.with_file_name(name + suffix)
    };

    // What its log holds goes into the file, so that one file is all of it. A damaged database keeps its log.
    let folded = Reader::fold_log(database).await;
    let log = sibling(database, "-wal");
    if folded.is_ok() && log.metadata().is_ok_and(|log| log.len() > 0) {
        return Err(BackupError::Open(database.to_owned()));
    }

    let stamp = now.strftime("%Y%m%dT%H%M%SZ");
    let name = |number: u32| match number {
        0 => database.with_file_name(format!("parfocal-replaced-{stamp}.db")),
        _ => database.with_file_name(format!("parfocal-replaced-{stamp}-{number}.db")),
    };
    // Several restores within a second are possible; a hundred are not.
    let kept = (0..100).map(name).find(|path| !path.exists()).unwrap_or_else(|| name(0));

    std::fs::hard_link(database, &kept).map_err(BackupError::file(&kept))?;
    for suffix in ["-wal", "-shm"] {
        match std::fs::rename(sibling(database, suffix), sibling(&kept, suffix)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(BackupError::File { path: kept, error });
            }
            _ => {}
        }
    }
    sync_folder_of(&kept);
    Ok(kept)
}

/// The head of the copy at `path`, if all of it verifies. `what` names it.
async fn verified(path: &Path, what: &str) -> Result<Head, BackupError> {
    let snapshot = Reader::open_snapshot(path).await?;
    let problem = checks(&snapshot, None).await.into_iter().find_map(|check| match check {
        Check { verdict: Verdict::Failed(problem), .. } => Some(problem),
        _ => None,
    });
    let head = snapshot.head().await;
    snapshot.close().await;

    match problem {
        Some(problem) => Err(BackupError::Unsound { what: what.to_owned(), problem }),
        None => Ok(head?),
    }
}

/// A file beside `path` that is removed unless it gets its name.
fn temporary_beside(path: &Path) -> Result<NamedTempFile, BackupError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let builder = tempfile::Builder::new().prefix(".parfocal-backup-").tempfile_in(folder);
    builder.map_err(BackupError::file(folder))
}

fn synced(path: &Path) -> Result<(), BackupError> {
    File::open(path).and_then(|file| file.sync_all()).map_err(BackupError::file(path))
}
