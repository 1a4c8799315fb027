//! Disks that can be filled, and users who may not write. They need root; without it the tests are skipped.

use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use tempfile::TempDir;

/// A small disk in memory; unmounted when dropped.
pub struct SmallDisk {
    /// Folder where it is mounted.
    pub folder: Arc<TempDir>,
}

impl SmallDisk {
    /// A disk of 4 megabytes. `None`, with a message on standard error, if this user may not mount one.
    pub fn mount() -> Option<Self> {
        Self::of_megabytes(4)
    }

    /// The same with `size` megabytes.
    pub fn of_megabytes(size: u32) -> Option<Self> {
        let folder = Arc::new(tempfile::tempdir().unwrap());
        let options = format!("size={size}m,mode=777");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &options, "tmpfs"]).arg(folder.path()).output();
        match mounted {
            Ok(output) if output.status.success() => Some(Self { folder }),
            _ => {
                eprintln!("skipped: to try a full disk, one has to be mounted, which takes root");
                None
            }
        }
    }

    /// Uses up all space.
    pub fn fill(&self) {
        let mut filler = std::fs::File::create(self.filler()).unwrap();
        while filler.write_all(&[0; 4096]).is_ok() {}
    }

    /// Leaves this many bytes of space, or a few thousand less.
    pub fn fill_but(&self, bytes: u64) {
        let disk = rustix::fs::statvfs(self.folder.path()).unwrap();
        let filling = (disk.f_bavail * disk.f_frsize).checked_sub(bytes).expect("there is as much room");
        std::fs::write(self.filler(), vec![0; filling as usize]).unwrap();
    }

    /// Frees the space again.
    pub fn empty(&self) {
        std::fs::remove_file(self.filler()).unwrap();
    }

    /// Makes it read-only for everyone, including root.
    pub fn make_read_only(&self) {
        let done = Command::new("mount").args(["-o", "remount,ro"]).arg(self.folder.path()).status();
        assert!(done.unwrap().success());
    }

    fn filler(&self) -> std::path::PathBuf {
        self.folder.path().join("filler")
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Lazily, because a server that is about to be killed may still use it.
        let _ = Command::new("umount").arg("--lazy").arg(self.folder.path()).status();
    }
}

/// `command` as a user who owns nothing. `None`, with a message on standard error, if this user may not do that.
pub fn as_nobody(command: &Command) -> Option<Command> {
    let nobody = |program: &Path| {
        let mut nobody = Command::new("setpriv");
        nobody.args(["--reuid=65534", "--regid=65534", "--clear-groups"]).arg(program);
        nobody
    };

    let program = Path::new(command.get_program());
    if !nobody(program).arg("--version").output().is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: to be another user takes root, setpriv, and a program that this user may run");
        return None;
    }

    let mut nobody = nobody(program);
    nobody.args(command.get_args()).env("RUST_LOG", "warn");
    Some(nobody)
}
