//! Makes and restores backups of a database. A backup can be made while a server writes, and is verified before it gets
//! its name.

use std::fs::{DirBuilder, File};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;
use serde::Serialize;
use tempfile::{NamedTempFile, PersistError, TempPath};

use super::export::verify::{Check, Verdict};
use super::lock::{FolderLock, LOCK};
use super::schema::{DATABASE, sibling};
use super::verify::checks;
use super::{Access, AccessLog, Head, Reader, StoreError};
use parfocal_base::boxed;
use parfocal_base::clock::Clock;
use parfocal_base::files::{folder_of, make_private, sync_folder_of};
use parfocal_recording::room;

/// What SQLite adds to a database's name for the files of its log.
const LOG_SUFFIXES: [&str; 3] = ["-wal", "-shm", "-journal"];

/// Why nothing was backed up or restored.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// The file to write exists already.
    #[error("{} exists; choose a new name", .0.display())]
    Exists(PathBuf),
    /// The copy does not verify.
    #[error("{what} does not verify: {problem}; nothing was changed")]
    Unsound {
        /// Path of the backup.
        what: String,
        /// The first problem found, in words.
        problem: String,
    },
    /// The database failed.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// A disk failed or is full, or another program is in the way. The message says which, and what to do.
    #[error("{0}")]
    Failed(String),
}

impl BackupError {
    /// The error that the file or folder at `path` could not be read or written.
    pub(super) fn file(path: &Path) -> impl Fn(io::Error) -> Self {
        |error| Self::Failed(format!("cannot use {}: {error}", path.display()))
    }
}

/// A backup that was made.
#[derive(Debug, Clone, Serialize)]
pub struct Backup {
    /// Path of its file.
    pub file: PathBuf,
    /// Size in bytes.
    pub bytes: u64,
    /// Head of its chain, `NUMBER:HASH`.
    pub head: String,
}

/// How the chain of a backup relates to the chain of the database that it replaces.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "relation", rename_all = "kebab-case")]
pub enum Relation {
    /// There was no database, or its chain cannot be read.
    Nothing,
    /// Both chains have the same rows.
    Same,
    /// The backup has all rows of the database, and more.
    Later,
    /// The database has all rows of the backup, and more.
    Earlier {
        /// Rows of the database that the backup does not have.
        rows: i64,
    },
    /// The chains have different histories.
    Apart {
        /// Number of the first row that differs, from 1.
        row: i64,
    },
}

/// The result of a restore.
#[derive(Debug, Clone, Serialize)]
pub struct Restored {
    /// Head of the backup's chain, `NUMBER:HASH`.
    pub backup: String,
    /// Head of the replaced database's chain; `None` if there was no readable one.
    pub replaced: Option<String>,
    /// Path where the replaced database is kept; `None` if there was none.
    pub kept: Option<PathBuf>,
    /// How the two chains relate.
    #[serde(flatten)]
    pub relation: Relation,
}

/// Copies the database of data folder `folder` to the new file `out`, whether or not a server has it open. The copy
/// gets its name only when it is verified and on disk.
///
/// # Errors
/// If `out` exists or cannot be written, the database cannot be read, or the copy does not verify.
#[boxed]
pub async fn backup(folder: &Path, out: &Path, clock: Arc<dyn Clock>) -> Result<Backup, BackupError> {
    if out.exists() {
        return Err(BackupError::Exists(out.to_owned()));
    }

    let temporary = temporary_beside(out)?;
    let access_log = AccessLog::open(folder, clock).await?;
    let copied = copy_into(&access_log, temporary, &out.display().to_string()).await;
    access_log.close().await;

    let VerifiedCopy { file, bytes, head } = copied?;
    put_in_place(file, out, |file, out| file.persist_noclobber(out))?;
    sync_folder_of(out);
    Ok(Backup { file: out.to_owned(), bytes, head: head.to_string() })
}

/// Sends a verified copy of the database of data folder `folder` to `receiver`, whether or not a server has the
/// database open. The copy is made in the data folder and removed afterwards.
///
/// # Errors
/// If the data folder has no room for the copy, the database cannot be read, the copy does not verify, or `receiver`
/// does not take all of it.
pub async fn backup_to(folder: &Path, receiver: &mut impl Write, clock: Arc<dyn Clock>) -> Result<Backup, BackupError> {
    let access_log = AccessLog::open(folder, clock).await?;
    let copied = verified_copy(&access_log, folder).await;
    access_log.close().await;

    let VerifiedCopy { file, bytes, head } = copied?;
    let mut content = file.reopen().map_err(BackupError::file(file.path()))?;
    io::copy(&mut content, receiver).and_then(|_| receiver.flush()).map_err(|error| {
        BackupError::Failed(format!("the backup was not sent whole: {error}; remove what arrived of it, and try again"))
    })?;
    Ok(Backup { file: PathBuf::from("-"), bytes, head: head.to_string() })
}

/// A verified copy of a database, in a file that is removed when this is dropped.
pub struct VerifiedCopy {
    file: NamedTempFile,
    /// Size in bytes.
    pub bytes: u64,
    /// Head of its chain.
    pub head: Head,
}

impl VerifiedCopy {
    /// The path of the file, which is removed when the path is dropped.
    pub fn into_path(self) -> TempPath {
        self.file.into_temp_path()
    }
}

/// Records a backup, and copies the database of `access_log` into a new file in `folder`, which is in its data folder.
///
/// # Errors
/// If the disk has no room for the copy, the file cannot be written, the database cannot be read, or the copy does not
/// verify.
#[boxed]
pub async fn verified_copy(access_log: &AccessLog, folder: &Path) -> Result<VerifiedCopy, BackupError> {
    let needed = access_log.reader().bytes().await?;
    // Comments and answers of a session need the reserve. If the free space is unknown, writing reports a full disk.
    if room(folder).is_ok_and(|room| room.spare() < needed) {
        return Err(BackupError::Failed(format!(
            "the disk of {} has no room for a copy of the database ({needed} bytes) beside the reserve that is kept \
             for a session; make room, or run `parfocal backup` with --out on another disk",
            folder.display()
        )));
    }
    copy_into(access_log, temporary_in(folder)?, "the backup").await
}

/// Records a backup, and copies the database of `access_log` into `file`. Errors call the copy `what`.
async fn copy_into(access_log: &AccessLog, file: NamedTempFile, what: &str) -> Result<VerifiedCopy, BackupError> {
    access_log.record(&Access::BackedUp).await?;
    // A connection of its own: its thread has the priority of this one, and the server's readers stay free.
    let reader = Reader::open(access_log.folder()).await?;
    let copied = reader.copy_to(file.path()).await;
    reader.close().await;
    copied?;

    let head = verified(file.path(), what).await?;
    let bytes = file.as_file().metadata().map_err(BackupError::file(file.path()))?.len();
    synced(file.path())?;
    Ok(VerifiedCopy { file, bytes, head })
}

/// Gives `file` the name `out`, unless there is such a file. `rename` does so in one step, where the file system can.
fn put_in_place(
    file: NamedTempFile,
    out: &Path,
    rename: impl FnOnce(NamedTempFile, &Path) -> Result<File, PersistError>,
) -> Result<(), BackupError> {
    let failed = |error: io::Error| match error.kind() {
        ErrorKind::AlreadyExists => BackupError::Exists(out.to_owned()),
        _ => BackupError::file(out)(error),
    };
    let file = match rename(file, out) {
        Ok(_) => return Ok(()),
        Err(error) if error.error.kind() == ErrorKind::AlreadyExists => return Err(failed(error.error)),
        Err(error) => error.file,
    };

    // Some file systems, such as exFAT, can neither rename without replacing nor link. There an empty file of ours takes
    // the name, if nobody has it, and is then replaced.
    File::options().write(true).create_new(true).open(out).map_err(failed)?;
    file.persist(out).map_err(|error| {
        let _ = std::fs::remove_file(out);
        failed(error.error)
    })?;
    Ok(())
}

/// Replaces the database of data folder `folder` by the backup `file`. The replaced database is kept beside it.
///
/// # Errors
/// If a server uses the folder, the backup does not verify, or a file cannot be written. Then nothing was changed.
#[boxed]
pub async fn restore(folder: &Path, file: &Path, clock: Arc<dyn Clock>) -> Result<Restored, BackupError> {
    let is_new = !folder.exists();
    DirBuilder::new().recursive(true).mode(0o700).create(folder).map_err(BackupError::file(folder))?;

    let (lock, restored) = match FolderLock::of(folder) {
        Ok(lock) => (Some(lock), restore_locked(folder, file, clock).await),
        Err(error) => (None, Err(error.into())),
    };
    let is_anothers = matches!(restored, Err(BackupError::Store(StoreError::InUse { .. })));
    if is_new && restored.is_err() && !is_anothers {
        // A server would start with an empty database in a folder that was left here.
        let _ = std::fs::remove_file(folder.join(LOCK));
        let _ = std::fs::remove_dir(folder);
    }
    drop(lock);
    restored
}

/// The same in a folder that this process has locked.
async fn restore_locked(folder: &Path, file: &Path, clock: Arc<dyn Clock>) -> Result<Restored, BackupError> {
    let database = folder.join(DATABASE);

    let copy = temporary_beside(&database)?;
    std::fs::copy(file, copy.path()).map_err(|error| {
        // Only the copy can be too large for its disk.
        let too_large = [ErrorKind::StorageFull, ErrorKind::QuotaExceeded, ErrorKind::FileTooLarge];
        BackupError::file(if too_large.contains(&error.kind()) { folder } else { file })(error)
    })?;
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

    let access_log = AccessLog::open_file(copy.path(), Arc::clone(&clock)).await?;
    access_log.record(&Access::Restored { replaced: replaced.clone() }).await?;
    access_log.close().await;
    synced(copy.path())?;

    let aside = set_aside(&database, there, clock.wall()).await?;
    if let Err(error) = copy.persist(&database) {
        put_back(&database, &aside);
        return Err(BackupError::file(&database)(error.error));
    }
    sync_folder_of(&database);
    let replaced = replaced.map(|head| head.to_string());
    Ok(Restored { backup: head.to_string(), replaced, kept: there.then_some(aside), relation })
}

/// Opens the database `file`; `None` if this version cannot read it.
async fn readable(file: &Path) -> Option<Reader> {
    let reader = Reader::open_checked(file).await.ok()?;
    if reader.head().await.is_ok() { Some(reader) } else { None }
}

/// How the chain in `backup`, whose head is `head`, relates to the one that `present` reads.
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

/// Gives the database a second, dated name beside it, and returns that. The new database can then replace it in one
/// step. If the database is not `there`, a log of it may be, which SQLite would read into the new database: it gets
/// another name too.
async fn set_aside(database: &Path, there: bool, now: Timestamp) -> Result<PathBuf, BackupError> {
    if there {
        // Moves the log into the file, so that one file holds everything. A damaged database keeps its log.
        let folded = Reader::fold_log(database).await;
        let log = sibling(database, "-wal");
        if folded.is_ok() && log.metadata().is_ok_and(|log| log.len() > 0) {
            return Err(BackupError::Failed(format!(
                "another program has the database {} open; close it and try again; nothing was changed",
                database.display()
            )));
        }
    }

    let stamp = now.strftime("%Y%m%dT%H%M%SZ");
    let name = |number: u32| match number {
        0 => database.with_file_name(format!("parfocal-replaced-{stamp}.db")),
        _ => database.with_file_name(format!("parfocal-replaced-{stamp}-{number}.db")),
    };
    // Several restores within a second are possible; a hundred are not.
    let is_free = |path: &PathBuf| !path.exists() && !sibling(path, "-wal").exists();
    let kept = (0..100).map(name).find(is_free).unwrap_or_else(|| name(0));

    if there {
        // Where the file system has no links, a copy keeps the database at its place as well.
        std::fs::hard_link(database, &kept)
            .or_else(|_| std::fs::copy(database, &kept).map(|_| ()))
            .map_err(BackupError::file(&kept))?;
    }
    for suffix in LOG_SUFFIXES {
        match std::fs::rename(sibling(database, suffix), sibling(&kept, suffix)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                put_back(database, &kept);
                return Err(BackupError::file(&kept)(error));
            }
            _ => {}
        }
    }
    sync_folder_of(&kept);
    Ok(kept)
}

/// Undoes [`set_aside`], as far as the disk lets it. What cannot be moved back stays beside the database as `kept`.
fn put_back(database: &Path, kept: &Path) {
    let moved = |suffix| sibling(kept, suffix).exists();
    let back = |suffix| std::fs::rename(sibling(kept, suffix), sibling(database, suffix));
    if LOG_SUFFIXES.into_iter().filter(|&suffix| moved(suffix)).all(|suffix| back(suffix).is_ok()) {
        // The database itself was never moved: `kept`, if there is one, is a second name or a copy of it.
        let _ = std::fs::remove_file(kept);
    }
}

/// Verifies the copy at `path` and returns its head. Errors call it `what`.
async fn verified(path: &Path, what: &str) -> Result<Head, BackupError> {
    let snapshot = Reader::open_snapshot(path).await.map_err(|error| match error {
        // It would speak of the data folder, which may be well.
        StoreError::Damaged(problem) => BackupError::Unsound { what: what.to_owned(), problem },
        StoreError::Empty(_) => BackupError::Unsound { what: what.to_owned(), problem: "it is empty".to_owned() },
        error => error.into(),
    })?;
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

/// A temporary file beside `path`. It is removed unless it is renamed.
fn temporary_beside(path: &Path) -> Result<NamedTempFile, BackupError> {
    temporary_in(folder_of(path))
}

/// A temporary file in `folder`. It is removed unless it is renamed.
fn temporary_in(folder: &Path) -> Result<NamedTempFile, BackupError> {
    let builder = tempfile::Builder::new().prefix(".parfocal-backup-").tempfile_in(folder);
    builder.map_err(BackupError::file(folder))
}

fn synced(path: &Path) -> Result<(), BackupError> {
    File::open(path).and_then(|file| file.sync_all()).map_err(BackupError::file(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a file system does that can neither rename without replacing nor link, such as exFAT.
    fn not_permitted(file: NamedTempFile, _: &Path) -> Result<File, PersistError> {
        Err(PersistError { error: io::Error::from_raw_os_error(1), file })
    }

    #[test]
    fn a_copy_gets_its_name_on_a_file_system_without_links_and_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("backup.db");
        let copy = |text: &str| {
            let mut file = temporary_beside(&out).unwrap();
            file.write_all(text.as_bytes()).unwrap();
            file
        };

        put_in_place(copy("first"), &out, not_permitted).unwrap();
        let refused = put_in_place(copy("second"), &out, not_permitted).unwrap_err();
        assert!(matches!(refused, BackupError::Exists(_)), "{refused}");
        assert_eq!(std::fs::read_to_string(&out).unwrap(), "first");
        assert_eq!(folder.path().read_dir().unwrap().count(), 1, "nothing is left beside it");
    }
}
