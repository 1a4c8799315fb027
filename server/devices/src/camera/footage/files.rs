//! Files of pictures: which they are, and reading them.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::video::FootageError;
use parfocal_base::files::is_systems_own;
use parfocal_base::notices::tell;
use parfocal_imaging::{DecodeError, Picture, PictureFile, PixelFormat, decode_raw};

/// Bytes from which a PNG's or JPEG's size and orientation can be read.
const HEAD: u64 = 1 << 20;

/// The beginning of the picture in `file`, for [`PictureFile::size`]. Of a TIFF, whose pages may be described at its
/// end, the whole file.
///
/// # Errors
/// If the file cannot be read.
pub fn picture_head(file: &Path) -> io::Result<Vec<u8>> {
    let mut file = File::open(file)?;
    let mut head = Vec::new();
    (&mut file).take(HEAD).read_to_end(&mut head)?;
    if head.starts_with(b"II") || head.starts_with(b"MM") {
        file.read_to_end(&mut head)?;
    }
    Ok(head)
}

/// Reads the first picture of a file, or a raw mosaic; says on standard error how many others are left out, and in
/// which format a raw mosaic was read if that is not 16 bit a sample. Samples of a picture that fill 16 bit are numbers
/// of `bits` bits.
///
/// # Errors
/// If it is not a picture or is damaged.
pub fn read_picture(path: &Path, bytes: &[u8], mosaic: bool, bits: u8) -> Result<Picture, DecodeError> {
    if is_raw(path) {
        let (frame, format) = decode_raw(bytes, None)?;
        if format != PixelFormat::Mono10 {
            tell(format_args!("note: {} is read as {format}, by its length", path.display()));
        }
        return Ok(Picture::Mosaic(frame));
    }

    let file = PictureFile::open(bytes)?.with_bits(bits);
    let picture = file.read(0, mosaic)?;
    tell_unread(path, file.pages());
    Ok(picture)
}

/// Says that only the first of `pages` pictures in a file is used.
pub fn tell_unread(path: &Path, pages: usize) {
    if pages > 1 {
        tell(format_args!("note: {} holds {pages} pictures; only the first is used", path.display()));
    }
}

/// Whether `path` has the file extension of a raw mosaic.
pub fn is_raw(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("raw") || end.eq_ignore_ascii_case("bin"))
}

/// Whether `path` has the file extension of a picture.
pub fn is_picture(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["png", "jpg", "jpeg", "tif", "tiff"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// The pictures in a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read or has no picture.
pub fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, FootageError> {
    let unreadable = |error: std::io::Error| FootageError::unreadable(folder, error);
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
    let mut files = paths.map_err(unreadable)?;

    files.retain(|file| is_picture(file) && !file.file_name().is_some_and(is_systems_own));
    files.sort();
    if files.is_empty() {
        return Err(FootageError(format!("there is no picture (PNG, JPEG or TIFF) in {}", folder.display())));
    }
    Ok(files)
}
