//! `parfocal scan from-stack`: makes a scan from pictures of one still scene in order of focus.

use std::path::PathBuf;

use sha2::{Digest, Sha256};

use super::info;
use crate::cli::input::whole_number;
use crate::cli::output::{Failure, bar_of_poses, poses, print, stored};
use parfocal_base::notices::tell;
use parfocal_devices::camera::recorded::{LEAST_SIDE, MOST_POSES};
use parfocal_imaging::PixelFormat;
use parfocal_learning::scans::benchmark::SEED;
use parfocal_learning::scans::recording::{Cut, from_stack};
use parfocal_learning::scans::stack::FocalStack;
use parfocal_learning::scans::stack::check::check;
use parfocal_learning::scans::stack::optics::StackOptics;

/// Default number of poses: 20 s at 25 per second.
const POSES: usize = 500;
/// Default limit on the planes that a pose sees: they are as far apart as the paper's step.
const PLANES: usize = 21;

/// Arguments of `parfocal scan from-stack`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of pictures or raw mosaics of one still scene, each at another position of focus. The position is
    /// the one number in which the names differ, or else the order of the names. Or a TIFF with a page for each
    /// position: plain, OME-TIFF or ImageJ's.
    folder: PathBuf,
    /// Folder of the scan: a new one, or one that the same command began.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// File with a line `name,position` for each picture, used instead of the numbers in the names. For a TIFF,
    /// `page,position`, pages counted from 1.
    #[arg(long, value_name = "FILE")]
    list: Option<PathBuf>,
    /// Format of .raw and .bin files: Mono8, Mono10, Mono10p, Mono12, Mono12p or Mono16; by default the one of their
    /// length.
    #[arg(long, value_name = "FORMAT")]
    raw: Option<PixelFormat>,
    /// Bits of the samples in 16-bit files, for example 12; by default the fewest that hold the largest sample of all
    /// pictures.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(8..=16))]
    bits: Option<u8>,
    /// Planes that each pose sees, fewer than the stack has; by default about half of them, 21 at most.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(3..=1000))]
    planes: Option<u16>,
    /// Width and height in pixels of the window that drifts over the stack.
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = whole_number(LEAST_SIDE..=4096))]
    size: usize,
    /// Make the pictures smaller: average blocks of S x S pixels.
    #[arg(long, value_name = "S", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64))]
    scale: u8,
    /// Number of poses.
    #[arg(long, value_name = "N", default_value_t = POSES, value_parser = whole_number(1..=MOST_POSES))]
    poses: usize,
    /// Seed of the walks of window and optimum.
    #[arg(long, value_name = "N", default_value_t = SEED)]
    seed: u64,
}

/// Makes the scan.
///
/// # Errors
/// If the pictures are not a focal stack, or the scan cannot be stored.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let list = arguments.list.as_deref();
    let stack = FocalStack::load(&arguments.folder, list, arguments.scale.into(), arguments.raw, arguments.bits)?;
    for note in check(&stack)? {
        tell(format_args!("note: {note}"));
    }

    let taken = stack.planes().len();
    let (even, note) = stack.even()?;
    if let Some(note) = note {
        tell(format_args!("note: {note}"));
    }

    let folder = arguments.folder.file_name().unwrap_or(arguments.folder.as_os_str()).to_string_lossy();
    let cut = Cut {
        name: format!("{folder} at scale {} ({:.12})", arguments.scale, digest(&even)),
        planes: arguments.planes.map_or((even.planes().len() / 2 + 1).min(PLANES), usize::from),
        size: arguments.size,
        poses: arguments.poses,
        seed: arguments.seed,
    };

    let progress = bar_of_poses(cut.poses);
    from_stack(&even, &cut, &arguments.out, &|| progress.inc(1))?;
    progress.finish_and_clear();

    let (width, height) = stack.size();
    print(&format!(
        "{taken} pictures of {width}x{height} pixels\n{}{}",
        info::optics(&StackOptics::of(&stack), "position"),
        stored(&format!("{} of {} planes", poses(cut.poses), cut.planes), &arguments.out)
    ))
}

/// A checksum of the stack's content, so that another stack is not mistaken for it.
fn digest(stack: &FocalStack) -> String {
    let mut hash = Sha256::new();
    for plane in stack.planes() {
        hash.update(plane.position.to_le_bytes());
        plane.picture.data.iter().for_each(|level| hash.update(level.to_le_bytes()));
    }
    hex::encode(hash.finalize())
}
