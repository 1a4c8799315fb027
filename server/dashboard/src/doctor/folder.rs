//! Checks the data folder: free space on its disk, and who may read and write it.

use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use super::finding::Finding;
use parfocal_recording::room;

/// Free bytes below which a trial should not begin: a day of sessions takes some 100 MB.
pub const LEAST_ROOM: u64 = 1 << 30;
/// Free bytes below which recordings soon fill the disk.
const AMPLE_ROOM: u64 = 20 << 30;
/// Bytes a second of a mosaic recording at 25 frames a second, as docs/recordings.md measures it.
const RECORDING_RATE: u64 = 41_000_000;

const DISK: &str = "disk";
const FOLDER: &str = "data folder";

/// Whether the disk of `data` has enough free space.
pub fn disk(data: &Path) -> Finding {
    let free = match room(data) {
        Ok(room) => room,
        Err(error) => {
            let found = format!("The disk of {} does not report its free space: {error}.", data.display());
            return Finding::wrong(DISK, found, "Check that the disk is connected and mounted.");
        }
    };

    let minutes = free.spare() / RECORDING_RATE / 60;
    let found = format!(
        "{:.1} GB are free, enough for about {minutes} minutes of hyperspectral recording.",
        free.available as f64 / 1e9
    );

    if free.available < LEAST_ROOM {
        Finding::wrong(DISK, found, "Free some space before a trial: comments and events need room.")
    } else if free.available < AMPLE_ROOM {
        Finding::advice(DISK, found, "Free some space if sessions are to be recorded.")
    } else {
        Finding::well(DISK, found)
    }
}

/// Whether this user can write `data`, and nobody else can read it.
pub fn access(data: &Path) -> Finding {
    let folder = data.display();
    let attributes = match std::fs::metadata(data) {
        Ok(attributes) => attributes,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let found = format!("There is no folder {folder} yet.");
            return Finding::advice(
                FOLDER,
                found,
                "The server makes it at its first start; or name it: --data-dir DIR.",
            );
        }
        Err(error) => {
            let found = format!("{folder} cannot be examined: {error}.");
            return Finding::wrong(FOLDER, found, "Run this as the user that runs the server.");
        }
    };

    if !attributes.is_dir() {
        let found = format!("{folder} is not a folder.");
        return Finding::wrong(FOLDER, found, "Name the server's data folder: --data-dir DIR.");
    }

    // The temporary file is removed automatically, whatever happens.
    if let Err(error) = tempfile::tempfile_in(data) {
        let found = format!("{folder} cannot be written: {error}.");
        return Finding::wrong(FOLDER, found, "Run this as the user that runs the server, or give it the folder.");
    }

    let others = attributes.permissions().mode() & 0o077;
    if others != 0 {
        let found = format!("Other users of this machine can look into {folder}.");
        return Finding::advice(FOLDER, found, format!("Close it to them: chmod 700 {folder}"));
    }

    Finding::well(FOLDER, format!("{folder} can be written, and is closed to other users."))
}

#[cfg(test)]
mod tests {
    use std::fs::{Permissions, set_permissions};

    use super::*;
    use crate::doctor::finding::Verdict;

    #[test]
    fn a_folder_that_others_can_read_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
        assert_eq!(access(folder.path()).verdict, Verdict::Advice);
        set_permissions(folder.path(), Permissions::from_mode(0o700)).unwrap();
        assert_eq!(access(folder.path()).verdict, Verdict::Well);
    }

    #[test]
    fn a_file_is_not_a_folder_and_a_missing_folder_is_reported() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert_eq!(access(file.path()).verdict, Verdict::Wrong);
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(access(&folder.path().join("none")).verdict, Verdict::Advice);
        assert!(disk(&folder.path().join("none")).found.contains("GB are free"));
    }
}
