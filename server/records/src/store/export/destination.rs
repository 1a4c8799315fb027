//! Where an export goes: a folder that appears whole or not at all, or a ZIP file that is sent while it is made.

use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use futures_util::{Stream, stream};
use tempfile::TempDir;
use tokio::sync::mpsc;
use tokio::time::timeout;
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipWriter};

use super::ExportError;
use parfocal_base::files::{files_below, folder_of, is_new_or_empty, put_folder, sync_folder_of};

/// Pieces of a ZIP file that may wait to be downloaded.
const PIECES: usize = 4;

/// Bytes of a ZIP file that are sent together.
const PIECE: usize = 64 * 1024;

/// A download that takes nothing for this long is given up. Until then, the database has to keep what the export reads.
const STALLED: Duration = Duration::from_mins(1);

/// Where an export goes, file by file.
pub enum Destination {
    /// A folder.
    Folder(NewFolder),
    /// A ZIP file.
    Zip(Box<ZipStream>),
}

impl Destination {
    /// Begins file `name`. One file is written at a time.
    pub fn begin(&mut self, name: &str) -> Result<(), ExportError> {
        match self {
            Self::Folder(folder) => folder.begin(name),
            Self::Zip(zip) => zip.begin(name),
        }
        .map_err(|error| self.unwritable(name, error))
    }

    /// Adds `bytes` to `name`, the file begun last.
    pub async fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), ExportError> {
        match self {
            Self::Folder(folder) => folder.write(bytes),
            Self::Zip(zip) => zip.write(bytes).await,
        }
        .map_err(|error| self.unwritable(name, error))
    }

    /// Ends `name`, the file begun last. In a folder, waits until it is on disk.
    pub fn end(&mut self, name: &str) -> Result<(), ExportError> {
        match self {
            Self::Folder(folder) => folder.end(),
            Self::Zip(_) => Ok(()),
        }
        .map_err(|error| self.unwritable(name, error))
    }

    /// Completes the export: moves the folder to its place, or writes the directory of the ZIP file.
    pub async fn finish(self) -> Result<(), ExportError> {
        match self {
            Self::Folder(folder) => folder.finish(),
            Self::Zip(zip) => {
                let path = PathBuf::from(&zip.root);
                Box::pin(zip.finish()).await.map_err(|error| ExportError::Unwritable { path, error })
            }
        }
    }

    fn unwritable(&self, name: &str, error: io::Error) -> ExportError {
        let path = match self {
            Self::Folder(folder) => folder.temporary.path().join(name),
            Self::Zip(zip) => Path::new(&zip.root).join(name),
        };
        ExportError::Unwritable { path, error }
    }
}

/// Checks that `out` is new or empty.
///
/// # Errors
/// If it is not, or it cannot be read.
pub fn check_new(out: &Path) -> Result<(), ExportError> {
    let unwritable = |error| ExportError::Unwritable { path: out.to_owned(), error };
    if is_new_or_empty(out).map_err(unwritable)? { Ok(()) } else { Err(ExportError::Exists(out.to_owned())) }
}

/// Makes a folder in `parent` that only its owner can look into. Its name begins with `prefix`. What participants said
/// goes into it, and perhaps the policies.
///
/// # Errors
/// If it cannot be made.
pub fn private_folder(parent: &Path, prefix: &str) -> io::Result<TempDir> {
    tempfile::Builder::new().prefix(prefix).permissions(Permissions::from_mode(0o700)).tempdir_in(parent)
}

/// A folder being written, beside its place and under another name until it is complete.
pub struct NewFolder {
    out: PathBuf,
    temporary: TempDir,
    file: Option<BufWriter<File>>,
}

impl NewFolder {
    /// Begins the folder that becomes `out`, which must be new or empty.
    ///
    /// # Errors
    /// If `out` has files, or the temporary folder cannot be made.
    pub fn beside(out: &Path) -> Result<Self, ExportError> {
        let unwritable = |error| ExportError::Unwritable { path: out.to_owned(), error };
        check_new(out)?;
        let parent = folder_of(out);
        std::fs::create_dir_all(parent).map_err(unwritable)?;
        let temporary = private_folder(parent, ".parfocal-export-").map_err(unwritable)?;
        Ok(Self { out: out.to_owned(), temporary, file: None })
    }

    /// Where the folder is until it is complete.
    pub fn path(&self) -> &Path {
        self.temporary.path()
    }

    fn begin(&mut self, name: &str) -> io::Result<()> {
        let path = self.temporary.path().join(name);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        self.file = Some(BufWriter::new(File::create(path)?));
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.as_mut().ok_or(io::ErrorKind::InvalidInput)?.write_all(bytes)
    }

    fn end(&mut self) -> io::Result<()> {
        let file = self.file.take().ok_or(io::ErrorKind::InvalidInput)?;
        file.into_inner().map_err(io::IntoInnerError::into_error)?.sync_data()
    }

    /// Moves the complete folder to its place.
    ///
    /// # Errors
    /// If it cannot be renamed. It is removed then.
    pub fn finish(self) -> Result<(), ExportError> {
        sync_folder_of(&self.temporary.path().join("any"));
        let unwritable = |error| ExportError::Unwritable { path: self.out.clone(), error };
        put_folder(self.temporary.path(), &self.out).map_err(unwritable)?;
        // It is at its place, and there is nothing to remove.
        let _ = self.temporary.keep();
        sync_folder_of(&self.out);
        Ok(())
    }
}

/// A ZIP file that is made while it is downloaded. Nothing is kept of what was taken, and no more is made until it is
/// taken.
pub struct ZipStream {
    /// The folder in the archive that holds its files.
    root: String,
    archive: ZipWriter<StreamWriter<UnsentBytes>>,
    made: UnsentBytes,
    pieces: mpsc::Sender<Piece>,
}

/// A part of a ZIP file.
enum Piece {
    /// The next bytes.
    Bytes(Bytes),
    /// There are no more. If this never comes, the file was cut off.
    End,
}

impl ZipStream {
    /// A ZIP file whose files are in a folder named `root`, and a stream of its bytes. The stream ends with an error if
    /// the file was cut off.
    pub fn new(root: String) -> (Self, impl Stream<Item = io::Result<Bytes>> + Send + use<>) {
        let (pieces, receiver) = mpsc::channel(PIECES);
        let made = UnsentBytes::default();
        let archive = ZipWriter::new_stream(made.clone());
        let bytes = stream::unfold(Some(receiver), async |receiver| {
            let mut receiver = receiver?;
            match receiver.recv().await {
                Some(Piece::Bytes(bytes)) => Some((Ok(bytes), Some(receiver))),
                Some(Piece::End) => None,
                None => Some((Err(io::Error::other("the export was cut off")), None)),
            }
        });

        (Self { root, archive, made, pieces }, bytes)
    }

    /// Sends every file in `folder` and in its subfolders, no faster than the download takes them.
    ///
    /// # Errors
    /// If a file cannot be read, or the download stops. Then the ZIP file is cut off.
    pub async fn send_folder(mut self, folder: &Path) -> io::Result<()> {
        let mut block = vec![0; PIECE];
        for name in files_below(folder)? {
            let mut file = File::open(folder.join(&name))?;
            // A study's telemetry is large, and what a slower level saves is not worth the wait. The archive has to
            // know beforehand that a file is larger than 4 GB.
            let large = file.metadata()?.len() >= u64::from(u32::MAX);
            let options = options().compression_level(Some(1)).large_file(large);
            self.archive.start_file(format!("{}/{}", self.root, name.display()), options)?;

            loop {
                match file.read(&mut block)? {
                    0 => break,
                    read => self.write(&block[..read]).await?,
                }
            }
        }
        Box::pin(self.finish()).await
    }

    fn begin(&mut self, name: &str) -> io::Result<()> {
        Ok(self.archive.start_file(format!("{}/{name}", self.root), options())?)
    }

    async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        for part in bytes.chunks(PIECE) {
            self.archive.write_all(part)?;
            if self.made.len() >= PIECE {
                send(&self.pieces, Piece::Bytes(self.made.take())).await?;
            }
        }
        Ok(())
    }

    async fn finish(self) -> io::Result<()> {
        let Self { archive, made, pieces, .. } = self;
        archive.finish()?;
        send(&pieces, Piece::Bytes(made.take())).await?;
        send(&pieces, Piece::End).await
    }
}

fn options() -> SimpleFileOptions {
    SimpleFileOptions::default().compression_method(CompressionMethod::Deflated)
}

async fn send(pieces: &mpsc::Sender<Piece>, piece: Piece) -> io::Result<()> {
    let left = |_| io::Error::new(io::ErrorKind::BrokenPipe, "the download was closed");
    let stalled = |_| io::Error::new(io::ErrorKind::TimedOut, "the download stalled for a minute");
    timeout(STALLED, pieces.send(piece)).await.map_err(stalled)?.map_err(left)
}

/// Bytes of a ZIP file that were made and not yet sent.
#[derive(Clone, Default)]
struct UnsentBytes(Arc<Mutex<Vec<u8>>>);

impl UnsentBytes {
    fn len(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    fn take(&self) -> Bytes {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner)).into()
    }
}

impl Write for UnsentBytes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use futures_util::{FutureExt, StreamExt};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha12Rng;

    use super::*;

    #[tokio::test]
    async fn a_download_that_was_cut_off_does_not_look_whole() {
        for whole in [true, false] {
            let (mut zip, bytes) = ZipStream::new("session".to_owned());
            let mut bytes = Box::pin(bytes);
            zip.begin("comments.csv").unwrap();
            zip.write(b"number\n1\n").await.unwrap();
            if whole {
                Box::pin(zip.finish()).await.unwrap();
            } else {
                drop(zip);
            }

            let mut pieces = Vec::new();
            while let Some(piece) = bytes.next().await {
                pieces.push(piece.is_ok());
            }
            assert_eq!(pieces, [whole]);
        }
    }

    #[tokio::test]
    async fn a_download_that_nobody_reads_is_not_made() {
        let (mut zip, bytes) = ZipStream::new("session".to_owned());
        zip.begin("noise.bin").unwrap();
        let mut noise = vec![0; 100 * PIECE];
        ChaCha12Rng::seed_from_u64(1).fill_bytes(&mut noise);

        assert!(zip.write(&noise).now_or_never().is_none(), "it waits");
        assert!(zip.made.len() < 2 * PIECE, "{} bytes", zip.made.len());
        drop(bytes);
        assert_eq!(zip.write(&noise).await.unwrap_err().kind(), io::ErrorKind::BrokenPipe);
    }
}
