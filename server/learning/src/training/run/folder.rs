//! The folder of a training. It belongs to one training and one process at a time, and is never left with an incomplete
//! file under its final name.

use std::fs::{self, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::checkpoint::{CHECKPOINT, Checkpoint};
use crate::LearningError;
use parfocal_base::files::{self, LockedFile};

/// File in a run folder from the moment a training begins there, before its pictures are drawn.
pub(super) const LOCK: &str = ".lock";

/// A training's folder.
#[derive(Debug)]
pub(super) struct RunFolder {
    path: PathBuf,
    /// Holds the lock until it is dropped.
    _lock: LockedFile,
}

impl RunFolder {
    /// Locks a new or empty folder for a new training.
    ///
    /// # Errors
    /// If it holds anything, another process is training there, or it cannot be written.
    pub fn begin(path: &Path) -> Result<Self, LearningError> {
        let failed = |error| unwritable(path, &error);
        fs::create_dir_all(path).map_err(failed)?;
        let was_locked_before = path.join(LOCK).exists();
        let lock = lock(path)?;

        let foreign = |entry: fs::DirEntry| {
            let name = entry.file_name();
            name != LOCK && !files::is_systems_own(&name)
        };

        if fs::read_dir(path).map_err(failed)?.filter_map(Result::ok).any(foreign) {
            if !was_locked_before {
                // Leave no file of ours in a folder with other files.
                let _ = fs::remove_file(path.join(LOCK));
            }

            let problem = if path.join(CHECKPOINT).exists() {
                "already holds a training; continue it with --resume, or choose another folder"
            } else {
                "holds other files, or a training that ended before its first checkpoint; choose a new or empty folder"
            };
            bail!("{} {problem}", path.display());
        }

        Ok(Self { path: path.to_owned(), _lock: lock })
    }

    /// Locks the folder of a training that is resumed, and reads its checkpoint. Removes partial files that a killed
    /// process left.
    ///
    /// # Errors
    /// If there is no checkpoint, it cannot be used, or another process is training there.
    pub fn go_on(path: &Path) -> Result<(Self, Checkpoint<'static>), LearningError> {
        if !path.join(CHECKPOINT).exists() {
            bail!(
                "{} has no checkpoint to continue from; check the folder, or start again without --resume",
                path.display()
            );
        }

        let lock = lock(path)?;
        let failed = |error| unwritable(path, &error);

        for entry in fs::read_dir(path).map_err(failed)?.filter_map(Result::ok) {
            if files::is_partial(&entry.file_name().to_string_lossy()) {
                fs::remove_file(entry.path()).map_err(failed)?;
            }
        }

        let checkpoint = Checkpoint::read(&path.join(CHECKPOINT))?;
        Ok((Self { path: path.to_owned(), _lock: lock }, checkpoint))
    }

    /// The folder's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes or replaces file `name`.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), LearningError> {
        let path = self.path.join(name);
        files::replace(&path, bytes).map_err(|error| unwritable(&path, &error))
    }

    /// Writes or replaces the checkpoint.
    pub fn save(&self, checkpoint: &Checkpoint<'_>) -> Result<(), LearningError> {
        let path = self.path.join(CHECKPOINT);
        checkpoint.write(&path).map_err(|error| unwritable(&path, &error))
    }

    /// Reads file `name`.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, LearningError> {
        let path = self.path.join(name);
        fs::read(&path).map_err(|error| {
            let path = path.display();
            LearningError::new(format!(
                "cannot read {path}: {error}; it belongs to the training and must stay where it is"
            ))
        })
    }
}

/// The error that `path`, the run folder or a file in it, could not be written.
pub(super) fn unwritable(path: &Path, error: &io::Error) -> LearningError {
    let file = path.display();
    LearningError::new(match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            let has_checkpoint = path.join(CHECKPOINT).exists() || path.with_file_name(CHECKPOINT).exists();
            let then = if has_checkpoint {
                "continue from the last checkpoint with --resume"
            } else {
                "start again in a new folder"
            };
            format!("the disk is too full to write {file}; make room, then {then}")
        }
        _ => {
            format!("cannot write to {file}: {error}; choose a folder that you can write to, or make this one writable")
        }
    })
}

fn lock(folder: &Path) -> Result<LockedFile, LearningError> {
    let path = folder.join(LOCK);
    let failed = |error: io::Error| unwritable(&path, &error);
    let file = OpenOptions::new().write(true).create(true).truncate(false).open(&path).map_err(failed)?;

    LockedFile::of(file).map_err(|error| match error {
        TryLockError::WouldBlock => LearningError::new(format!(
            "another training is running in {}; choose another folder, or wait until it ends",
            folder.display()
        )),
        TryLockError::Error(error) => failed(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_one_trainings_and_one_processes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let run = RunFolder::begin(&path).unwrap();
        assert!(RunFolder::begin(&path).unwrap_err().to_string().contains("another training is running in"));
        run.save(&Checkpoint::default()).unwrap();
        assert!(RunFolder::go_on(&path).unwrap_err().to_string().contains("another training is running in"));
        drop(run);
        assert!(RunFolder::begin(&path).unwrap_err().to_string().contains("already holds a training"));
        let half = path.join(".checkpoint.safetensors.partial");
        fs::write(&half, "half").unwrap();
        RunFolder::go_on(&path).unwrap();
        assert!(!half.exists());
    }

    #[test]
    fn files_of_others_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("MODEL_CARD.md"), "mine").unwrap();
        assert!(RunFolder::begin(folder.path()).unwrap_err().to_string().contains("holds other files"));
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        assert!(RunFolder::go_on(folder.path()).unwrap_err().to_string().contains("no checkpoint to continue from"));
        // A training that was refused for its footage leaves only the lock file. The folder can be used again.
        fs::remove_file(folder.path().join("MODEL_CARD.md")).unwrap();
        drop(RunFolder::begin(folder.path()).unwrap());
        RunFolder::begin(folder.path()).unwrap();
    }

    #[test]
    fn a_full_disk_is_reported_with_advice() {
        let folder = tempfile::tempdir().unwrap();
        let told = |path: &Path| unwritable(path, &io::ErrorKind::StorageFull.into()).to_string();
        let file = folder.path().join("curves.csv");
        let error = told(&file);
        assert!(error.contains("curves.csv") && error.contains("make room, then start again"), "{error}");
        fs::write(folder.path().join(CHECKPOINT), "").unwrap();
        for path in [&file, folder.path()] {
            assert!(told(path).contains("make room, then continue from the last checkpoint with --resume"));
        }
    }
}
