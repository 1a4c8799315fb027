//! Calibrations in files: TOML, with 16-bit pictures beside it for references per pixel.

pub mod maker;
pub mod tables;

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use parfocal_base::files::replace;
use parfocal_imaging::{Calibration, MosaicFrame, Picture, Reference, decode, encode_tiff};
use parfocal_recording::Recording;

/// Why a calibration, or a maker's table, cannot be used or saved. The message names the file, and says what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct CalibrationFault(String);

impl From<String> for CalibrationFault {
    fn from(message: String) -> Self {
        Self(message)
    }
}

/// Name of the current calibration in its folder. Earlier ones stay beside it, by their version.
const CURRENT: &str = "calibration.toml";

/// Bits of a camera's samples, whatever its pixel format.
const CAMERA_BITS: u8 = 10;

/// Reads the calibration in the file `path`, or the current one of the folder `path`.
///
/// # Errors
/// If it cannot be read, or is invalid.
pub fn read(path: &Path) -> Result<Calibration, CalibrationFault> {
    read_into(Calibration::default(), path)
}

/// `calibration` with the values that the calibration in the file `path`, or the current one of the folder `path`, has.
///
/// # Errors
/// As [`read`].
pub fn read_into(calibration: Calibration, path: &Path) -> Result<Calibration, CalibrationFault> {
    let path = if path.is_dir() { path.join(CURRENT) } else { path.to_owned() };
    let text = fs::read_to_string(&path)
        .map_err(|error| format!("cannot read the calibration {}: {error}", path.display()))?;
    // Taken for a calibration without references, it would change every picture and spectrum without a word.
    if text.trim().is_empty() {
        return Err(
            format!("the calibration {} is empty; restore it from a copy, or make it again", path.display()).into()
        );
    }

    let folder = path.parent().unwrap_or(Path::new("."));
    let changed = calibration.changed_by_toml(&text, |name| picture(folder, name));
    Ok(changed.map_err(|error| format!("calibration {}, {error}", path.display()))?)
}

/// The calibration that is kept in `recording`.
///
/// # Errors
/// As [`read`], and if it does not fit the recording's mosaics, because another one was put there.
pub fn of_recording(recording: &Recording) -> Result<Calibration, CalibrationFault> {
    let calibration = read(&recording.calibration())?;

    let misfit = misfit(&calibration, "the recording", Some(recording.size()));
    if let Some(misfit) = misfit.or_else(|| other_scale(&calibration)) {
        let folder = recording.calibration();
        return Err(format!("{misfit}: put the recording's own back into {}", folder.display()).into());
    }
    Ok(calibration)
}

/// The calibration of `path` if one is given, else that of a typical unit.
///
/// # Errors
/// If it cannot be read, or is invalid.
pub fn read_or_default(path: Option<&Path>) -> Result<Calibration, CalibrationFault> {
    path.map_or_else(|| Ok(Calibration::default()), read)
}

/// Refuses a calibration whose references per pixel do not fit frames of `size`. `of` names the frames in the message.
///
/// # Errors
/// If they do not fit.
pub fn check_size(calibration: &Calibration, of: &str, size: Option<(usize, usize)>) -> Result<(), CalibrationFault> {
    let Some(misfit) = misfit(calibration, of, size) else { return Ok(()) };
    Err(format!(
        "{misfit}: take new references with `parfocal calibrate`, or set the camera to the size of the references"
    )
    .into())
}

/// How the references per pixel of `calibration` differ from frames of `size`; `None` if they fit.
fn misfit(calibration: &Calibration, of: &str, size: Option<(usize, usize)>) -> Option<String> {
    let (taken, size) = calibration.size().zip(size).filter(|(taken, size)| taken != size)?;
    Some(format!(
        "the calibration {} was taken at {}x{}, but {of} is {}x{}",
        calibration.title(),
        taken.0,
        taken.1,
        size.0,
        size.1
    ))
}

/// Refuses a calibration that does not fit, in size or in scale, a camera with mosaics of `size` (`None` if it delivers
/// no mosaics).
///
/// # Errors
/// If it does not fit.
pub fn check_camera(calibration: &Calibration, size: Option<(usize, usize)>) -> Result<(), CalibrationFault> {
    check_size(calibration, "the camera's picture", size)?;
    if size.is_some() { check_scale(calibration) } else { Ok(()) }
}

/// Refuses a calibration whose bit depth is not that of the cameras' samples.
///
/// # Errors
/// If it does not fit.
pub fn check_scale(calibration: &Calibration) -> Result<(), CalibrationFault> {
    let Some(other) = other_scale(calibration) else { return Ok(()) };
    Err(format!("{other}: give dark and white on that scale, and `bit_depth = {CAMERA_BITS}`").into())
}

/// How the scale of `calibration` differs from that of the cameras' samples; `None` if it does not.
fn other_scale(calibration: &Calibration) -> Option<String> {
    (calibration.bit_depth != CAMERA_BITS).then(|| {
        format!(
            "the calibration {} is for samples of {} bit, but parfocal converts every camera to {CAMERA_BITS} bit",
            calibration.title(),
            calibration.bit_depth
        )
    })
}

fn picture(folder: &Path, name: &str) -> Result<MosaicFrame, String> {
    let path = folder.join(name);
    let bytes = fs::read(&path).map_err(|error| format!("cannot read the picture {}: {error}", path.display()))?;
    match decode(&bytes, true) {
        Ok(Picture::Mosaic(frame)) => Ok(frame),
        Ok(_) => Err(format!("{name} is not a 16-bit gray picture")),
        Err(error) => Err(format!("{name}: {error}")),
    }
}

/// The calibration that a new version in `folder` builds on: the current one, or a typical unit's
/// if there is none yet.
///
/// # Errors
/// If it cannot be read, or if it is missing while earlier versions are still there: a new one would take their names.
pub fn begun(folder: &Path) -> Result<Calibration, CalibrationFault> {
    if folder.join(CURRENT).exists() {
        return read(folder);
    }

    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let number = |name: &String| name.strip_prefix("calibration-")?.strip_suffix(".toml")?.parse::<u32>().ok();
    let Some(latest) = names.filter_map(|name| number(&name)).max() else { return Ok(Calibration::default()) };

    Err(format!(
        "{} holds earlier calibrations but no {CURRENT}: copy calibration-{latest}.toml to that name, \
         or give another folder",
        folder.display()
    )
    .into())
}

/// The number of the version after `version` in `folder`. After one that is no number it is the first whose files are
/// not there yet.
pub fn next_version(folder: &Path, version: &str) -> String {
    if let Some(next) = version.parse::<u32>().ok().and_then(|number| number.checked_add(1)) {
        return next.to_string();
    }

    let is_free = |version: &String| {
        let files = [("calibration", "toml"), ("dark", "tiff"), ("white", "tiff")];
        files.iter().all(|(what, ending)| !folder.join(format!("{}.{ending}", of_version(what, version))).exists())
    };
    (1..u32::MAX).map(|number| number.to_string()).find(is_free).unwrap_or_else(|| "1".to_owned())
}

/// Saves `calibration` in `folder` as the current one; the previous one stays there under its version's name. `changed`
/// names the references that are new. Returns the file's path.
///
/// # Errors
/// If it has a value that [`read`] refuses, as a maker's table may, or the folder cannot be written. In the first case
/// nothing is written.
pub fn save(folder: &Path, calibration: &Calibration, changed: &[&str]) -> Result<PathBuf, CalibrationFault> {
    let failed = |error: std::io::Error| format!("cannot write to {}: {error}", folder.display());
    let current = folder.join(CURRENT);
    let before = match fs::read_to_string(&current) {
        Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
        before => before.map_err(failed)?,
    };

    let mut names = ["dark", "white"].map(|key| named(&before, key));
    let mut new = Vec::new();
    let references = [("dark", &calibration.dark), ("white", &calibration.white)];
    for ((key, reference), name) in references.into_iter().zip(&mut names) {
        if let Reference::PerPixel(frame) = reference
            && (changed.contains(&key) || name.is_empty())
        {
            *name = format!("{}.tiff", of_version(key, &calibration.version));
            new.push((folder.join(name.as_str()), frame));
        }
    }

    let text = calibration.to_toml(&names[0], &names[1]);
    check_readable(calibration, &text, &names[0])?;

    fs::create_dir_all(folder).map_err(failed)?;
    for (path, frame) in new {
        write_picture(&path, frame)?;
    }

    // The earlier calibration is kept under its version before the new one takes its place.
    if !before.is_empty() {
        let kept = format!("{}.toml", of_version("calibration", &named(&before, "version")));
        replace(&folder.join(kept), before.as_bytes()).map_err(failed)?;
    }

    replace(&current, text.as_bytes()).map_err(failed)?;
    Ok(current)
}

/// The name of what belongs to `version`, without its ending. People write versions as they like, such as 3/2026.
fn of_version(what: &str, version: &str) -> String {
    format!("{what}-{}", version.replace('/', "-"))
}

/// Refuses a calibration that could not be read again from `text`, in which `dark` is the dark reference's picture.
fn check_readable(calibration: &Calibration, text: &str, dark: &str) -> Result<(), CalibrationFault> {
    let picture = |name: &str| {
        let reference = if name == dark { &calibration.dark } else { &calibration.white };
        match reference {
            Reference::PerPixel(frame) => Ok(frame.clone()),
            Reference::PerBand(_) => Err(format!("there is no picture {name}")),
        }
    };

    match Calibration::default().changed_by_toml(text, picture) {
        Ok(_) => Ok(()),
        Err(error) => Err(format!("this is not a usable calibration, and nothing was saved: {error}").into()),
    }
}

/// The text that `key` has in a calibration's TOML; empty if it has none.
fn named(toml: &str, key: &str) -> String {
    let table: toml::Table = toml::from_str(toml).unwrap_or_default();
    table.get(key).and_then(toml::Value::as_str).unwrap_or_default().to_owned()
}

fn write_picture(path: &Path, frame: &MosaicFrame) -> Result<(), CalibrationFault> {
    let failed = |problem: &dyn std::fmt::Display| format!("cannot write {}: {problem}", path.display());
    let bytes = encode_tiff(frame).map_err(|error| failed(&error))?;
    Ok(replace(path, &bytes).map_err(|error| failed(&error))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_version_takes_no_earlier_ones_files() {
        let folder = tempfile::tempdir().unwrap();
        let dark = Reference::PerPixel(MosaicFrame::new(8, 4, vec![7; 32]).unwrap());
        let first = Calibration { version: "1".to_owned(), dark, ..Calibration::default() };
        save(folder.path(), &first, &["dark"]).unwrap();
        let named = Calibration { version: "spring".to_owned(), ..first };
        save(folder.path(), &named, &[]).unwrap();

        let next = |version| next_version(folder.path(), version);
        assert_eq!(next("spring"), "2", "the files of version 1 are still in use");
        assert_eq!([next("2"), next("4294967295")], ["3", "2"]);
        assert_eq!(next_version(&folder.path().join("new"), "default"), "1");
    }

    #[test]
    fn a_version_may_be_any_text() {
        let folder = tempfile::tempdir().unwrap();
        let dark = Reference::PerPixel(MosaicFrame::new(8, 4, vec![7; 32]).unwrap());
        let first = Calibration { version: "../3/2026".to_owned(), dark, ..Calibration::default() };
        save(folder.path(), &first, &["dark"]).unwrap();
        assert_eq!(read(folder.path()).unwrap(), first);

        let second = Calibration { version: "4".to_owned(), ..first.clone() };
        save(folder.path(), &second, &[]).unwrap();
        assert_eq!(read(folder.path()).unwrap(), second);
        assert_eq!(read(&folder.path().join("calibration-..-3-2026.toml")).unwrap(), first);
    }
}
