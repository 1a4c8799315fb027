//! Files that are whole or absent, even when the disk is full or the power fails; files that other accounts cannot
//! read; and files that one process has at a time.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, Permissions, TryLockError};
use std::io::{self, BufWriter, Write};
use std::ops::Deref;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// A file that no other process has locked, until it is dropped.
#[derive(Debug)]
#[must_use]
pub struct LockedFile(File);

impl LockedFile {
    /// Locks `file`.
    ///
    /// # Errors
    /// If another process holds the lock, or the file system has no locks.
    pub fn of(file: File) -> Result<Self, TryLockError> {
        file.try_lock()?;
        Ok(Self(file))
    }
}

impl Deref for LockedFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl Drop for LockedFile {
    fn drop(&mut self) {
        // To close the file is not enough: a child process has a copy of it from its fork until its program begins, and
        // the lock would last until then.
        let _ = self.0.unlock();
    }
}

/// Writes a file with these bytes to `path`, as [`replace_with`] does. If `path` is a symbolic link, its target is
/// replaced. A device or a pipe is written to, never replaced.
///
/// # Errors
/// If it cannot be written. No part of it is left then.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // A path such as /dev/stdout may lead to a plain file that other processes hold open.
    let lent = path.starts_with("/dev") || path.starts_with("/proc");
    if lent || fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        return fs::write(path, bytes);
    }

    replace_with(&fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()), |writer| writer.write_all(bytes))
}

/// Writes a file with the output of `fill` to `path`. It is first written under another name in the same folder, so
/// that the old file stays until all of the new one is on the disk.
///
/// # Errors
/// If it cannot be written. No part of it is left then.
pub fn replace_with(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let beside = partial(path);
    let written = File::create(&beside).and_then(|file| fill_through(file, fill));
    put_in_place(&beside, path, written)
}

/// Writes a file with these bytes to `path`, as [`replace_with`] does. Other accounts can never read it.
///
/// # Errors
/// If it cannot be written. No part of it is left then.
pub fn replace_private(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let beside = partial(path);
    // A partial file that a killed process left behind could be open in another process.
    let _ = fs::remove_file(&beside);

    let created = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&beside);
    let written = created.and_then(|file| fill_through(file, |writer| writer.write_all(bytes)));
    put_in_place(&beside, path, written)
}

/// Has `make` write a new file or folder, which becomes `path` once it is whole: `make` gets another name in the same
/// folder. What is there already stays.
///
/// # Errors
/// If there is something at `path`, or it cannot be written. No part of it is left then.
pub fn create_with<E: From<io::Error>>(path: &Path, make: impl FnOnce(&Path) -> Result<(), E>) -> Result<(), E> {
    let free = || -> io::Result<()> {
        if fs::symlink_metadata(path).is_ok() { Err(io::ErrorKind::AlreadyExists.into()) } else { Ok(()) }
    };
    free()?;

    let beside = partial(path);
    // What an earlier attempt left that was killed.
    remove(&beside);
    let whole = make(&beside).and_then(|()| {
        // Looked at again: making it may have taken minutes.
        free()?;
        Ok(File::open(&beside)?.sync_data()?)
    });
    let placed = put_in_place(&beside, path, whole);
    if placed.is_err() {
        remove(&beside);
    }
    placed
}

/// The path at which a file is written before it is moved to `path`.
fn partial(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.partial"))
}

/// Moves the file or folder at `beside` to `path`, or removes the file if writing (`written`) or moving failed.
fn put_in_place<E: From<io::Error>>(beside: &Path, path: &Path, written: Result<(), E>) -> Result<(), E> {
    let moved = written.and_then(|()| Ok(fs::rename(beside, path)?));

    match &moved {
        Ok(()) => sync_folder_of(path),
        Err(_) => drop(fs::remove_file(beside)),
    }

    moved
}

/// Removes the file or folder at `path`, if there is one.
pub fn remove(path: &Path) {
    // A folder may get another file meanwhile.
    for _ in 0..10 {
        let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        if removed.is_ok() || fs::symlink_metadata(path).is_err() {
            return;
        }
    }
}

/// Writes a file and waits until the disk has it.
///
/// # Errors
/// If it cannot be written. A part of it may be left then.
pub fn write_through(path: &Path, bytes: &[u8]) -> io::Result<()> {
    fill_through(File::create(path)?, |writer| writer.write_all(bytes))
}

fn fill_through(opened: File, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(1 << 20, opened);
    fill(&mut writer)?;

    // A file renamed before the disk has it may be empty after a power cut.
    writer.into_inner().map_err(io::IntoInnerError::into_error)?.sync_data()
}

/// The folder that `path` is in.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Waits until the disk has the name of `path`. Otherwise a renamed file may have its old name after a power cut. The
/// file is whole under either name, so it is not an error if the folder cannot be read or the file system cannot do
/// this.
pub fn sync_folder_of(path: &Path) {
    let _ = File::open(folder_of(path)).and_then(|folder| folder.sync_all());
}

/// Removes all other accounts' access to the file or folder `path`.
///
/// # Errors
/// If it does not exist or is not ours, or if it is a folder that all accounts share, such as /tmp. Such a folder must
/// stay open to them.
pub fn make_private(path: &Path) -> io::Result<()> {
    const OTHERS: u32 = 0o077;
    const SHARED: u32 = 0o1000;

    let there = fs::metadata(path)?;
    let mode = there.permissions().mode();
    if mode & OTHERS == 0 {
        return Ok(());
    }

    // The sticky bit marks a folder that is shared on purpose.
    if there.is_dir() && mode & SHARED != 0 {
        return Err(io::Error::other("all accounts share this folder"));
    }

    fs::set_permissions(path, Permissions::from_mode(mode & !OTHERS & 0o7777))
}

/// Whether a file or folder with this name is not a person's but an operating system's, which puts it into folders that
/// people open: hidden files such as `.DS_Store` and `._picture.jpg`, `Thumbs.db` and `desktop.ini`.
pub fn is_systems_own(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    name.starts_with('.') || ["Thumbs.db", "desktop.ini"].iter().any(|own| name.eq_ignore_ascii_case(own))
}

/// Whether the folder at `path` is missing, or holds nothing but [files of operating systems](is_systems_own).
///
/// # Errors
/// If it cannot be read.
pub fn is_new_or_empty(path: &Path) -> io::Result<bool> {
    let entries = match fs::read_dir(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => return Ok(!path.exists()),
        entries => entries?,
    };
    for entry in entries {
        if !is_systems_own(&entry?.file_name()) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Renames the finished folder `whole` to `out`, a folder beside it that [is new or empty](is_new_or_empty). What an
/// operating system keeps in `out` stays there.
///
/// # Errors
/// If it cannot be renamed. `out` is as before then.
pub fn put_folder(whole: &Path, out: &Path) -> io::Result<()> {
    let has_files = fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if !has_files {
        return fs::rename(whole, out);
    }
    if !is_new_or_empty(out)? {
        return Err(io::ErrorKind::DirectoryNotEmpty.into());
    }

    let aside = whole.with_extension("before");
    fs::rename(out, &aside)?;
    if let Err(error) = fs::rename(whole, out) {
        fs::rename(&aside, out)?;
        return Err(error);
    }
    for entry in fs::read_dir(&aside)? {
        let entry = entry?;
        fs::rename(entry.path(), out.join(entry.file_name()))?;
    }
    fs::remove_dir(aside)
}

/// All files below `folder`, at any depth, without [those of operating systems](is_systems_own): their paths relative
/// to `folder`, sorted.
///
/// # Errors
/// If a folder cannot be read.
pub fn files_below(folder: &Path) -> io::Result<Vec<PathBuf>> {
    Ok(below(folder)?.0)
}

/// The files of operating systems below `folder`, at any depth: their paths relative to `folder`, sorted. Of a hidden
/// folder only the folder itself is listed.
///
/// # Errors
/// If a folder cannot be read.
pub fn systems_own_below(folder: &Path) -> io::Result<Vec<PathBuf>> {
    Ok(below(folder)?.1)
}

/// People's files below `folder`, and those of operating systems.
fn below(folder: &Path) -> io::Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let mut files = Vec::new();
    let mut systems_own = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(within) = folders.pop() {
        for entry in fs::read_dir(folder.join(&within))? {
            let entry = entry?;
            let name = within.join(entry.file_name());
            if is_systems_own(&entry.file_name()) {
                systems_own.push(name);
            } else if entry.path().is_dir() {
                folders.push(name);
            } else {
                files.push(name);
            }
        }
    }

    files.sort();
    systems_own.sort();
    Ok((files, systems_own))
}

/// Whether `name` is that of a file which a process killed in [`replace`] may have left.
pub fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".partial")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_locked_file_is_free_as_soon_as_it_is_dropped_even_while_a_child_has_a_copy_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        let open = || OpenOptions::new().write(true).create(true).truncate(false).open(&path).unwrap();
        let locked = LockedFile::of(open()).unwrap();
        assert!(matches!(LockedFile::of(open()), Err(TryLockError::WouldBlock)));

        // As between a fork and the start of the child's program.
        let copy = locked.try_clone().unwrap();
        drop(locked);
        drop(LockedFile::of(open()).unwrap());
        drop(copy);
    }

    #[test]
    fn a_folder_takes_a_place_where_only_a_systems_own_files_are() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let whole = || {
            let whole = folder.path().join("whole");
            fs::create_dir(&whole).unwrap();
            fs::write(whole.join("new"), "new").unwrap();
            whole
        };

        assert!(is_new_or_empty(&out).unwrap());
        put_folder(&whole(), &out).unwrap();
        assert!(!is_new_or_empty(&out).unwrap() && !is_new_or_empty(&out.join("new")).unwrap());
        assert!(put_folder(&whole(), &out).is_err());
        fs::remove_dir_all(folder.path().join("whole")).unwrap();

        fs::remove_file(out.join("new")).unwrap();
        fs::write(out.join("desktop.ini"), "kept").unwrap();
        assert!(is_new_or_empty(&out).unwrap());
        put_folder(&whole(), &out).unwrap();
        assert_eq!(fs::read_to_string(out.join("new")).unwrap(), "new");
        assert_eq!(fs::read_to_string(out.join("desktop.ini")).unwrap(), "kept");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn an_existing_file_is_replaced_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("results.json");
        for text in ["first", "second"] {
            replace(&file, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
        }

        // A folder with that name cannot be replaced, and stays.
        let occupied = folder.path().join("figure.svg");
        fs::create_dir(&occupied).unwrap();
        assert!(replace(&occupied, b"").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn what_cannot_be_written_whole_leaves_what_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        replace(&path, b"before").unwrap();
        let full = |writer: &mut BufWriter<File>| -> io::Result<()> {
            writer.write_all(b"half")?;
            writer.flush()?;
            Err(io::ErrorKind::StorageFull.into())
        };

        assert_eq!(replace_with(&path, full).unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"before");
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }

    #[test]
    fn a_private_file_is_its_owners_alone_even_if_a_readable_one_was_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("secret.pem");
        let beside = folder.path().join(".secret.pem.partial");
        for before in [&path, &beside] {
            fs::write(before, "old").unwrap();
            fs::set_permissions(before, Permissions::from_mode(0o644)).unwrap();
        }

        replace_private(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert!(!beside.exists());
    }

    #[test]
    fn a_device_is_written_to_and_stays_a_device() {
        let full = Path::new("/dev/full");
        assert_eq!(replace(full, b"text").unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert!(!fs::metadata(full).unwrap().is_file());
    }

    #[test]
    fn a_link_leads_to_the_file_that_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("real.svg");
        let link = folder.path().join("link.svg");
        fs::write(&file, "before").unwrap();
        std::os::unix::fs::symlink("real.svg", &link).unwrap();
        replace(&link, b"after").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"after");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn what_is_made_private_keeps_its_owners_rights_and_a_shared_folder_stays_shared() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("there");
        fs::create_dir(&path).unwrap();
        for (before, after) in [(0o755, 0o700), (0o750, 0o700), (0o500, 0o500), (0o1777, 0o1777)] {
            fs::set_permissions(&path, Permissions::from_mode(before)).unwrap();
            assert_eq!(make_private(&path).is_ok(), before != 0o1777);
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o7777, after);
        }

        assert_eq!(make_private(&folder.path().join("missing")).unwrap_err().kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn files_of_operating_systems_are_told_from_peoples_own() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join("voice/.Spotlight-V100")).unwrap();
        let own = [".DS_Store", "._a.jpg", "Thumbs.db", "THUMBS.DB", "Desktop.ini", "voice/._b.webm"];
        for name in own.iter().chain(&["a.jpg", "voice/b.webm", "thumbs.db.jpg", "voice/.Spotlight-V100/store"]) {
            fs::write(folder.path().join(name), "").unwrap();
        }

        let named = |names: Vec<PathBuf>| -> Vec<String> {
            names.into_iter().map(|name| name.to_string_lossy().into_owned()).collect()
        };
        assert_eq!(named(files_below(folder.path()).unwrap()), ["a.jpg", "thumbs.db.jpg", "voice/b.webm"]);
        let mut expected = [&own[..], &["voice/.Spotlight-V100"]].concat();
        expected.sort_unstable();
        let mut found = named(systems_own_below(folder.path()).unwrap());
        found.sort();
        assert_eq!(found, expected);
    }

    #[test]
    fn only_what_was_written_aside_is_partial() {
        assert!(is_partial(".checkpoint.safetensors.partial"));
        assert!(!is_partial("my.partial") && !is_partial(".hidden"));
    }
}
