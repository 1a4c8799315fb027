//! Raw mosaics in a folder: all in one pixel format, told by the caller or by the length of the first file.

use std::path::{Path, PathBuf};

use parfocal_base::files::is_systems_own;
use parfocal_base::notices::tell;
use parfocal_devices::camera::footage::is_raw;
use parfocal_imaging::{DecodeError, MosaicFrame, PixelFormat, decode_raw, raw_format};

/// Reads the raw mosaics of one stack or scan, and prints once how it reads them.
#[derive(Debug, Default)]
pub struct RawMosaics {
    /// The format that the caller gave, or that of the first file.
    format: Option<PixelFormat>,
    is_given: bool,
    is_noted: bool,
}

impl RawMosaics {
    /// Mosaics in `format`; if it is `None`, in the one of the first file's length.
    pub fn new(format: Option<PixelFormat>) -> Self {
        Self { format, is_given: format.is_some(), is_noted: false }
    }

    /// The format of the file at `path`, which has `length` bytes.
    ///
    /// # Errors
    /// If a file of the mosaics' format has another length.
    pub fn format(&mut self, path: &Path, length: usize) -> Result<PixelFormat, DecodeError> {
        let format = raw_format(length, self.format)?;
        self.format = Some(format);

        if !self.is_noted {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let reason = if self.is_given { "as --raw says" } else { "by their length; --raw says otherwise" };
            tell(format_args!("note: the raw mosaics in {} are read as {format}, {reason}", folder.display()));
            self.is_noted = true;
        }
        Ok(format)
    }

    /// Decodes the content of the file at `path`.
    ///
    /// # Errors
    /// If it has another length, or counts that its format cannot have.
    pub fn read(&mut self, path: &Path, bytes: &[u8]) -> Result<MosaicFrame, DecodeError> {
        let format = self.format(path, bytes.len())?;
        decode_raw(bytes, Some(format)).map(|(frame, _)| frame)
    }
}

/// The raw mosaics directly in `folder`, sorted by name; none if it cannot be read.
pub fn mosaics_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_mosaic = |path: &PathBuf| is_raw(path) && !path.file_name().is_some_and(is_systems_own);
    let mut files: Vec<PathBuf> = entries.filter(is_mosaic).collect();
    files.sort();
    files
}
