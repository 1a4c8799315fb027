//! Files that are there and whole, or not there at all: written aside, synced, then renamed into their place.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes what `fill` writes to `path`, in the place of what lies there.
///
/// # Errors
/// When it cannot be written; then what lay there is still there, and nothing else is left.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let partial = path.with_file_name(format!(".{name}.partial"));
    let write = || -> io::Result<()> {
        let mut writer = BufWriter::with_capacity(1 << 20, File::create(&partial)?);
        fill(&mut writer)?;
        // A file renamed before the disk has it may be empty after a power cut.
        writer.into_inner().map_err(io::IntoInnerError::into_error)?.sync_data()?;
        fs::rename(&partial, path)
    };
    write().inspect_err(|_| {
        let _ = fs::remove_file(&partial);
    })
}

/// Writes `bytes` to `path`, in the place of what lies there.
///
/// # Errors
/// As [`write_with`].
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |writer| writer.write_all(bytes))
}

/// Whether `name` is that of a file that a process killed while writing left behind.
#[must_use]
pub fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".partial")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_written_whole_leaves_what_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write(&path, b"before").unwrap();
        let full = |writer: &mut BufWriter<File>| -> io::Result<()> {
            writer.write_all(b"half")?;
            writer.flush()?;
            Err(io::ErrorKind::StorageFull.into())
        };
        assert_eq!(write_with(&path, full).unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"before");
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        // A folder is in the way.
        fs::create_dir_all(folder.path().join("b.txt/inside")).unwrap();
        write(&folder.path().join("b.txt"), b"after").unwrap_err();
        assert_eq!(folder.path().read_dir().unwrap().count(), 2);
    }

    #[test]
    fn only_what_was_written_aside_is_partial() {
        assert!(is_partial(".checkpoint.safetensors.partial"));
        assert!(!is_partial("my.partial") && !is_partial(".hidden"));
    }
}
