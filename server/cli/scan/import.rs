//! `parfocal scan import`: makes a scan from a folder of pictures named by pose and focal power.

use std::path::PathBuf;

use crate::cli::output::{Failure, bar_of_poses, poses, print, stored};
use parfocal_imaging::PixelFormat;
use parfocal_learning::scans::recording::{Imported, import};

/// Arguments of `parfocal scan import`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of pictures or raw mosaics named like `pose0001_f0.350.png`: number of the pose, and focal power
    /// from 0 to 1.
    folder: PathBuf,
    /// Folder of the scan: a new one, or one that the same command began.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Name of the camera, for people; the folder's name by default.
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Bits of the samples in 16-bit files, for example 12; by default the fewest that hold the largest sample of all
    /// pictures.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(8..=16))]
    bits: Option<u8>,
    /// Format of .raw and .bin files: Mono8, Mono10, Mono10p, Mono12, Mono12p or Mono16; by default the one of their
    /// length.
    #[arg(long, value_name = "FORMAT")]
    raw: Option<PixelFormat>,
}

/// Imports the pictures.
///
/// # Errors
/// If the pictures are not a scan, or the scan cannot be stored.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let imported = Imported::look(&arguments.folder, arguments.bits, arguments.raw)?;
    let progress = bar_of_poses(imported.count());
    let folder = arguments.folder.file_name().unwrap_or(arguments.folder.as_os_str()).to_string_lossy().into_owned();
    let camera = arguments.camera.clone().unwrap_or(folder);
    import(&imported, &camera, &arguments.out, &|| progress.inc(1))?;
    progress.finish_and_clear();
    print(&stored(&poses(imported.count()), &arguments.out))
}
