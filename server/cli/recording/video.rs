//! `parfocal recording video`: a recording as a video for people, or its frames as pictures.

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::cli::interrupt::undo_before_the_end;
use crate::cli::output::{Failure, print, save};
use parfocal_base::files::{create_with, remove};
use parfocal_devices::camera::calibration;
use parfocal_imaging::{Developer, GrayImage, MosaicFrame, RgbImage, Size, encode_png, encode_tiff};
use parfocal_recording::{FrameRow, Recording};

/// File endings of videos, and ffmpeg's names of their formats.
const VIDEOS: [(&str, &str); 4] = [("mp4", "mp4"), ("mkv", "matroska"), ("mov", "mov"), ("avi", "avi")];

/// Arguments of `parfocal recording video`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the recording.
    folder: PathBuf,
    /// A new video (.mp4, .mkv, .mov or .avi), or a new folder for a picture of each frame.
    #[arg(long, value_name = "FILE|DIR")]
    out: PathBuf,
    /// Begin so many seconds after the first frame.
    #[arg(long, value_name = "S", default_value = "0", value_parser = parse_seconds)]
    from: f64,
    /// End so many seconds after the first frame; at the last frame if left out.
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    to: Option<f64>,
    /// Size of developed pictures: one pixel per mosaic cell (by default), two by two per cell, or one per sample.
    #[arg(long, value_enum)]
    size: Option<Size>,
    /// Content of the folder: developed pictures (png, by default), or the raw mosaics with 16 bit per sample (tiff).
    #[arg(long, value_enum)]
    pictures: Option<Pictures>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Pictures {
    /// Developed, 8 bit sRGB.
    Png,
    /// Raw mosaics.
    Tiff,
}

/// Saves the video or the pictures.
///
/// # Errors
/// If a frame cannot be read, `ffmpeg` is missing or fails, or a file cannot be written.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let format = format(&arguments.out)?;
    if format.is_some() && arguments.pictures.is_some() {
        bail!("--pictures is for a folder of pictures; a video is always developed");
    }
    if arguments.pictures == Some(Pictures::Tiff) && arguments.size.is_some() {
        bail!("--size is for developed pictures; raw mosaics have the size that they were recorded with");
    }

    let recording = Recording::open(&arguments.folder)?;
    let calibration = calibration::of_recording(&recording)?;
    let frames = chosen(arguments, &recording)?;
    if fs::symlink_metadata(&arguments.out).is_ok() {
        bail!("{} exists already; give a name that is not taken", arguments.out.display());
    }

    let mut developer = Developer::new(&calibration);
    let size = arguments.size.unwrap_or(Size::Cell);
    let mut develop = |mosaic: &MosaicFrame, picture: &mut RgbImage| {
        developer.develop(mosaic, size, picture, &mut GrayImage::default());
    };

    let made = create_with(&arguments.out, |part| -> Result<(), Failure> {
        // Ctrl-C must not leave a part beside the place of the whole.
        let left = part.to_owned();
        undo_before_the_end(move || remove(&left))?;
        match format {
            Some(format) => save_video(&Video { file: part, format }, &recording, &frames, &mut develop),
            None => save_pictures(part, arguments.pictures, &recording, &frames, &mut develop),
        }
    });
    made.map_err(|failure| format!("cannot write {}: {failure}", arguments.out.display()))?;
    print(&format!("{} frames in {}\n", frames.len(), arguments.out.display()))
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| seconds.is_finite() && *seconds >= 0.0);
    seconds.ok_or_else(|| "must be a number of seconds, 0 or more".to_owned())
}

/// The video's format; `None` if `out` names a folder.
fn format(out: &Path) -> Result<Option<&'static str>, Failure> {
    let Some(ending) = out.extension().filter(|_| !out.as_os_str().as_encoded_bytes().ends_with(b"/")) else {
        return Ok(None);
    };
    let known = VIDEOS.iter().find(|(known, _)| ending.eq_ignore_ascii_case(known));

    let Some((_, format)) = known else {
        bail!(
            "{}: videos are .mp4, .mkv, .mov or .avi, not .{}; for a folder of pictures, end its name with a /",
            out.display(),
            ending.display()
        );
    };
    Ok(Some(*format))
}

/// Numbers of the frames within the requested span.
fn chosen(arguments: &Arguments, recording: &Recording) -> Result<Vec<usize>, Failure> {
    let rows = recording.rows();
    let first = rows.first().map_or(0, |row| row.time);
    let to = arguments.to.unwrap_or(f64::INFINITY);
    let within = |&frame: &usize| {
        let seconds = (rows[frame].time - first) as f64 / 1e9;
        (arguments.from..=to).contains(&seconds)
    };

    let frames: Vec<usize> = (0..rows.len()).filter(within).collect();
    if frames.is_empty() {
        let length = recording.seconds();
        bail!("no frame of {} lies within the seconds asked for; it lasts {length:.1} s", arguments.folder.display());
    }
    Ok(frames)
}

/// A video to write.
struct Video<'a> {
    file: &'a Path,
    format: &'static str,
}

/// Pipes the frames into `ffmpeg`, each repeated for as long as it was the latest.
fn save_video(
    video: &Video,
    recording: &Recording,
    frames: &[usize],
    develop: &mut impl FnMut(&MosaicFrame, &mut RgbImage),
) -> Result<(), Failure> {
    let rows = recording.rows();
    let fps = pictures_a_second(rows);
    let start = rows[frames[0]].time;
    let tick = |frame: usize| ((rows[frame].time - start) as f64 / 1e9 * fps).round() as usize;

    let mut encoder: Option<Encoder> = None;
    let mut picture = RgbImage::default();
    let mut shown = 0;

    for (place, &frame) in frames.iter().enumerate() {
        let until = frames.get(place + 1).map_or(shown + 1, |&next| tick(next));
        if until <= shown {
            continue;
        }

        develop(&recording.frame(frame)?, &mut picture);
        if encoder.is_none() {
            encoder = Some(Encoder(start_encoder(video, fps, &picture)?));
        }
        let Some(input) = encoder.as_mut().and_then(|encoder| encoder.0.stdin.as_mut()) else { break };

        // If a write fails, `ffmpeg` has ended early, and its error output says why.
        if (shown..until).any(|_| input.write_all(&picture.data).is_err()) {
            break;
        }
        shown = until;
    }

    let Some(mut encoder) = encoder else { return Ok(()) };
    drop(encoder.0.stdin.take());
    let mut complaint = String::new();
    if let Some(mut errors) = encoder.0.stderr.take() {
        errors.read_to_string(&mut complaint)?;
    }

    // It calls it a success, too, when the disk gets full while it writes the last part, without which nothing plays.
    // Of several errors, the first is the cause of the others.
    let ended = encoder.0.wait()?;
    match complaint.lines().find(|line| !line.trim().is_empty()) {
        None if ended.success() => Ok(()),
        reason => Err(format!("ffmpeg: {}", reason.unwrap_or("no reason given")).into()),
    }
}

/// Pictures a second by the usual time between two frames. The mean would leave out frames of a recording with gaps.
fn pictures_a_second(rows: &[FrameRow]) -> f64 {
    let times = rows.windows(2).map(|pair| pair[1].time.saturating_sub(pair[0].time));
    let mut times: Vec<i64> = times.filter(|time| *time > 0).collect();
    if times.is_empty() {
        return 25.0;
    }

    let middle = times.len() / 2;
    let (_, usual, _) = times.select_nth_unstable(middle);
    (1e9 / *usual as f64).round().clamp(1.0, 1000.0)
}

/// A running `ffmpeg`, ended if the frames cannot be read to the last.
struct Encoder(Child);

impl Drop for Encoder {
    fn drop(&mut self) {
        // These fail only if it has ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start_encoder(video: &Video, fps: f64, picture: &RgbImage) -> Result<Child, Failure> {
    let mut target = std::ffi::OsString::from("file:");
    target.push(video.file);

    let size = format!("{}x{}", picture.width, picture.height);
    let rate = fps.to_string();
    let input = ["-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", &size, "-framerate", &rate];
    let mut command = Command::new("ffmpeg");
    command.args(input).args(["-i", "-", "-pix_fmt", "yuv420p"]);
    // Two by two pixels share a colour: a column or line of black completes an odd size.
    command.args(["-vf", "pad='ceil(iw/2)*2':'ceil(ih/2)*2'", "-f", video.format]).arg(target);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());

    command.spawn().map_err(|error| {
        format!("cannot start `ffmpeg`, which makes videos ({error}); install it, on Debian with `apt install ffmpeg`")
            .into()
    })
}

fn save_pictures(
    folder: &Path,
    kind: Option<Pictures>,
    recording: &Recording,
    frames: &[usize],
    develop: &mut impl FnMut(&MosaicFrame, &mut RgbImage),
) -> Result<(), Failure> {
    fs::create_dir(folder)?;

    let mut picture = RgbImage::default();
    for &frame in frames {
        let mosaic = recording.frame(frame)?;
        let (ending, written) = match kind.unwrap_or(Pictures::Png) {
            Pictures::Png => {
                develop(&mosaic, &mut picture);
                ("png", encode_png(&picture))
            }
            Pictures::Tiff => ("tiff", encode_tiff(&mosaic)),
        };

        let path = folder.join(format!("frame{frame:06}.{ending}"));
        save(&path, &written.map_err(|error| format!("cannot write {}: {error}", path.display()))?)?;
    }
    Ok(())
}
