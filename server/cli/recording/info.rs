//! `parfocal recording info`: what a recording holds, and whether it is whole and unchanged.

use std::fmt::Write;
use std::path::PathBuf;

use serde::Serialize;

use super::view_info;
use crate::cli::output::{Failure, print_result};
use parfocal_devices::camera::calibration;
use parfocal_recording::{AnyRecording, Header, Recording};

/// Bytes per sample when four samples of 10 bit are packed into five bytes.
const PACKED: f64 = 1.25;

/// Arguments of `parfocal recording info`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the recording.
    folder: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Info {
    path: String,
    #[serde(flatten)]
    header: Header,
    width: usize,
    height: usize,
    frames: usize,
    seconds: f64,
    fps: Option<f64>,
    /// Frames that the camera numbered but that are missing here, including those that the recorder lost.
    frames_missing: u64,
    /// Bytes of the frames on disk.
    bytes: u64,
    /// `bytes` divided by the size of the samples packed at 10 bit; `None` without frames.
    share_of_packed: Option<f64>,
    /// Descriptions of the frames and files that cannot be read.
    damaged: Vec<String>,
}

/// Looks at the recording and checks every frame.
///
/// # Errors
/// If there is no recording. If frames are damaged, after reporting them.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let folder = &arguments.folder;
    match AnyRecording::open(folder)? {
        AnyRecording::Mosaic(recording) => {
            let info = look(arguments, &recording);
            tell(arguments, &info, describe, &info.damaged)
        }
        AnyRecording::View(recording) => {
            let info = view_info::look(folder, &recording);
            tell(arguments, &info, view_info::describe, &info.damaged)
        }
    }
}

/// Prints `info` in the requested format; fails if something is damaged.
fn tell<I: Serialize>(
    arguments: &Arguments,
    info: &I,
    describe: impl Fn(&I) -> String,
    damaged: &[String],
) -> Result<(), Failure> {
    print_result(arguments.json, info, || describe(info))?;

    match damaged {
        [] => Ok(()),
        [only] => Err(only.clone().into()),
        [first, rest @ ..] => Err(format!("{first} (and {} more)", rest.len()).into()),
    }
}

fn look(arguments: &Arguments, recording: &Recording) -> Info {
    let frames = recording.rows().len();
    let (width, height) = recording.size();
    let packed = PACKED * (width * height * frames) as f64;
    let bytes = recording.bytes();
    let mut damaged = recording.check();
    damaged.extend(calibration::of_recording(recording).err().map(|fault| fault.to_string()));

    Info {
        path: arguments.folder.display().to_string(),
        header: recording.header().clone(),
        width,
        height,
        frames,
        seconds: recording.seconds(),
        fps: recording.rate(),
        frames_missing: recording.missing(),
        bytes,
        share_of_packed: (frames > 0).then(|| bytes as f64 / packed),
        damaged,
    }
}

fn describe(info: &Info) -> String {
    let Info { header, width, height, frames, seconds, bytes, .. } = info;
    let mut text = String::new();

    let _ = writeln!(text, "recording    {} by {}", header.started, header.software);
    let _ = writeln!(text, "camera       {}, {width}x{height}", header.camera);
    let _ = writeln!(text, "lens         {}", header.lens);
    let _ = writeln!(text, "calibration  {}", header.calibration);
    if let Some(session) = &header.session {
        let _ = writeln!(text, "session      {session}");
    }
    for (name, value) in &header.camera_settings {
        let _ = writeln!(text, "{name:12} {value}");
    }

    let rate = info.fps.map_or(String::new(), |fps| format!(", {fps:.1} a second"));
    let _ = writeln!(text, "frames       {frames} over {seconds:.1} s{rate}");
    let _ = writeln!(
        text,
        "missing      {} ({} because this machine or its disk was too slow)",
        info.frames_missing, header.frames_lost
    );

    let share = info.share_of_packed.map_or(String::new(), |share| format!(", {share:.2} of packed 10 bit"));
    let _ = writeln!(text, "size         {:.1} MB{share}", *bytes as f64 / 1e6);

    text + &view_info::state(header.ended.as_ref(), "every frame matches its checksum", &info.damaged)
}
