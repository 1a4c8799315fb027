//! The data folder: no other account of the machine can read its contents.

use std::fs::{Permissions, metadata, read_dir, set_permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::process::Signal;

use crate::support::{Server, command};

/// `folder` and the files in it.
fn all_of(folder: &Path) -> Vec<PathBuf> {
    let files = read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    std::iter::once(folder.to_owned()).chain(files).collect()
}

fn mode(path: &Path) -> u32 {
    metadata(path).unwrap().permissions().mode() & 0o777
}

/// Checks the folder of a running server.
fn assert_private(folder: &Path) {
    let paths = all_of(folder);
    for name in ["parfocal.db", "parfocal.db-wal", "parfocal.db-shm", "keys.toml"] {
        assert!(paths.contains(&folder.join(name)), "{name} is not there");
    }
    for path in paths {
        let expected = if path == folder { 0o700 } else { 0o600 };
        assert_eq!(mode(&path), expected, "{:o} {}", mode(&path), path.display());
    }
}

#[test]
fn the_data_folder_is_its_owners_alone_and_an_older_one_becomes_so() {
    let parent = Arc::new(tempfile::tempdir().unwrap());
    let folder = parent.path().join("site/data");
    let start = || Server::run(Arc::clone(&parent), command(&folder, &["--bind", "127.0.0.1:0"]));

    let mut server = start();
    assert_private(&folder);
    // After a kill the files that processes share stay behind, too.
    assert!(!server.end(Signal::KILL));

    for path in all_of(&folder) {
        let open = if path == folder { 0o755 } else { 0o644 };
        set_permissions(&path, Permissions::from_mode(open)).unwrap();
    }
    let _server = start();
    assert_private(&folder);
}
