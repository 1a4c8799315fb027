//! Hyperspectral recordings from outside: made by the command, killed, damaged, played back, and opened by Python's
//! own libraries.

mod damage;
#[path = "../shared/program.rs"]
mod program;
mod spectrum;
mod step;
mod view;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, ManualClock, Moment, SystemClock};
use parfocal_devices::camera::{self, Camera, CameraSettings, FrameImage};
use parfocal_devices::lens::{Lens, SimulatedLens};
use parfocal_imaging::{BANDS, Calibration, MosaicFrame, Reference};
use parfocal_recording::{
    CALIBRATION, CapturedFrame, Ended, FORMAT, Header, PatchRow, Recorder, Recording, VERSION, Writer,
};
use serde_json::Value;
use tempfile::TempDir;

use self::program::{command, complaint, done, parfocal, said, text};

/// Width and height of the recordings that tests make up.
const SIZE: (usize, usize) = (64, 32);

fn info(recording: &Path) -> Value {
    serde_json::from_str(&done(&["recording", "info", text(recording), "--json"])).unwrap()
}

/// What Python's zarr and xarray find, and for a cube also spectral.
fn python(arguments: &[&str]) -> Value {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let packages = root.join("target/recordings");
    assert!(packages.join("installed").exists(), "Python's readers are missing; run `.ci/setup test` once");

    let mut python = Command::new("python3");
    python.arg("-s").arg(root.join("tests/recordings/read.py")).args(arguments).env("PYTHONPATH", packages);
    let output = python.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Sample (`x`, `y`) of frame `frame` of a recording that a test makes up.
fn sample(frame: usize, x: usize, y: usize) -> u16 {
    ((frame * 97 + y * 31 + x * 7) % 1024) as u16
}

fn mosaic(frame: usize) -> MosaicFrame {
    mosaic_of(frame, SIZE)
}

fn mosaic_of(frame: usize, (width, height): (usize, usize)) -> MosaicFrame {
    let samples = (0..width * height).map(|place| sample(frame, place % width, place / width)).collect();
    MosaicFrame::new(width, height, samples).unwrap()
}

fn header() -> Header {
    Header {
        format: FORMAT.to_owned(),
        version: VERSION,
        software: "a test".to_owned(),
        started: "2026-03-01T12:00:00.25Z".parse().unwrap(),
        camera: "a test's".to_owned(),
        lens: "a test's".to_owned(),
        simulated: true,
        calibration: Calibration::default().title(),
        camera_settings: [("gain".to_owned(), 2.5)].into(),
        session: None,
        run: None,
        monotonic_ns: None,
        frames_lost: 0,
        ended: None,
    }
}

/// A recording of `frames` frames at 50 a second whose camera lost every tenth frame. No focal power was measured.
fn made_up(folder: &TempDir, frames: usize) -> PathBuf {
    made_up_of(folder, frames, SIZE)
}

fn made_up_of(folder: &TempDir, frames: usize, size: (usize, usize)) -> PathBuf {
    made_up_by(folder, frames, size, &Calibration::default())
}

fn made_up_by(folder: &TempDir, frames: usize, size: (usize, usize), calibration: &Calibration) -> PathBuf {
    let path = folder.path().join("recording");
    let writer = Writer::create(&path, header(), size, calibration).unwrap();
    camera::calibration::save(&path.join(CALIBRATION), calibration, &[]).unwrap();

    let recorder = Recorder::start(writer, Moment::from_nanos(1_000_000_000)).unwrap();
    for frame in 0..frames {
        let number = (frame + frame / 9) as u64;
        recorder.intake().offer(CapturedFrame {
            number: 100 + number,
            exposed_at: Moment::from_nanos(1_000_000_000 + number * 20_000_000),
            exposure: Duration::from_micros(2500),
            asked: FocalPower::new(frame as f64 / frames as f64).unwrap(),
            measured: None,
            optimal: None,
            patch: PatchRow { corner: (frame as u64, 3), jumps: frame as u64 / 10 },
            mosaic: Arc::new(mosaic_of(frame, size)),
        });
        // Wait: if more frames were offered at once than fit, some would be lost, as they should.
        wait_for(|| recorder.progress().frames > frame as u64);
    }
    assert_eq!(recorder.stop().lost, 0);
    path
}

fn wait_for(mut happened: impl FnMut() -> bool) {
    let limit = SystemClock.now() + Duration::from_mins(1);
    while !happened() {
        assert!(SystemClock.now() < limit, "it did not happen within a minute");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn python_reads_every_sample_and_the_wavelengths_are_coordinates() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 60);
    let found = python(&[text(&recording)]);

    assert_eq!(found["shape"], serde_json::json!([60, 32, 64]));
    assert_eq!(found["dimensions"], serde_json::json!(["frame", "y", "x"]));
    assert_eq!((&found["same"], &found["lazily"]), (&Value::Bool(true), &Value::Bool(true)));
    assert_eq!(found["units"], "nm");
    assert_eq!(found["started"], "2026-03-01T12:00:00.25Z");
    let coordinates = found["coordinates"].as_array().unwrap();
    for name in ["wavelength", "fwhm", "time", "focal_power_asked", "frame_number", "patch_x"] {
        assert!(coordinates.contains(&name.into()), "{name} is no coordinate: {coordinates:?}");
    }

    // The published centres of the sensor's bands, sorted.
    let published = [
        460.1, 468.5, 475.4, 484.5, 496.0, 503.0, 513.3, 524.1, 532.0, 544.4, 550.8, 560.0, 570.5, 576.9, 586.9, 594.9,
    ];
    assert_eq!(found["wavelengths"], serde_json::json!(published));

    let first: Vec<u16> = (0..8).map(|place| sample(0, place % 4, place / 4)).collect();
    assert_eq!(found["first"], serde_json::json!(first));
    let sum = |frame| (0..64 * 32).map(|place| u64::from(sample(frame, place % 64, place / 64))).sum::<u64>();
    assert_eq!(found["sums"], serde_json::json!((0..60).map(sum).collect::<Vec<_>>()));

    assert_eq!(found["numbers"][59], 165);
    assert!((found["seconds"][59].as_f64().unwrap() - 65.0 * 0.02).abs() < 1e-9);
    assert!((found["asked"][30].as_f64().unwrap() - 0.5).abs() < 1e-12);
    assert_eq!(found["patches"][59], serde_json::json!([59, 3, 5]));

    let told = info(&recording);
    assert_eq!((&told["frames"], &told["frames_missing"], &told["frames_lost"]), (&60.into(), &6.into(), &0.into()));
    assert_eq!(told["camera_settings"]["gain"], 2.5);
}

#[test]
fn spectral_python_opens_a_frames_cube() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 30);
    let cube = folder.path().join("cube.hdr");
    done(&["recording", "cube", text(&recording), "--frame", "27", "--out", text(&cube)]);

    let found = python(&[text(&recording), text(&cube), "27"]);
    assert_eq!(found["cube"], serde_json::json!([8, 16, 16]));
    assert_eq!(found["equal"], true);
    assert_eq!((found["centres"][0].as_f64(), found["centres"][15].as_f64()), (Some(460.1), Some(594.9)));
    assert_eq!((found["widths"][0].as_f64(), found["widths"][15].as_f64()), (Some(10.9), Some(16.3)));

    let told = complaint(&parfocal(&["recording", "cube", text(&recording), "--frame", "30", "--out", text(&cube)]));
    assert!(told.contains("has 30 frames, counted from 0; there is no frame 30"), "{told}");
}

#[test]
fn the_phantom_is_recorded_small_enough_and_played_back() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("phantom");
    let printed =
        done(&["recording", "record", "--out", text(&out), "--seconds", "1.5", "--policy", "mgm-hill-climber"]);
    assert!(printed.contains("frames in"), "{printed}");

    let told = info(&out);
    let frames = told["frames"].as_u64().unwrap();
    assert!(frames >= 5, "{told}");
    assert_eq!((&told["width"], &told["height"], &told["simulated"]), (&2048.into(), &1088.into(), &true.into()));
    assert_eq!(told["ended"]["why"], "stopped");
    let share = told["share_of_packed"].as_f64().unwrap();
    assert!(share < 0.75, "{share} of packed 10 bit");
    assert_eq!(python(&[text(&out)])["shape"][0], frames);

    let recording = Recording::open(&out).unwrap();
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let optics = SimulatedLens::new(Arc::clone(&clock)).optics();
    let settings = CameraSettings { fps: 1.0, seed: 0, optics, clock };
    let mut camera = camera::open(&format!("recording:{}", out.display()), settings).unwrap();
    assert_eq!(camera.mosaic_size(), Some((2048, 1088)));

    let mut seen = Vec::new();
    while seen.len() < 3 {
        let frame = camera.next_frame(Duration::from_secs(5)).unwrap();
        let FrameImage::Mosaic(mosaic) = frame.image else { panic!("a recording plays mosaics") };
        let index = (frame.number - 1) % frames;
        assert!(*mosaic == recording.frame(index as usize).unwrap(), "frame {index}");
        assert!(frame.truth.is_some(), "what the simulation knew is kept");
        seen.push(frame.exposed_at);
    }
    assert!(camera.health().simulated && camera.health().name.contains("a recording of: brain phantom"));
    let period = 1.0 / recording.rate().unwrap();
    let paced = seen[2].since(seen[0]).as_secs_f64();
    assert!(paced > period, "3 frames within {paced} s, one every {period} s");
}

/// A recording of frames that were exposed at these nanoseconds.
fn exposed_at(folder: &TempDir, times: &[u64]) -> PathBuf {
    let path = folder.path().join("recording");
    let calibration = Calibration::default();
    let writer = Writer::create(&path, header(), SIZE, &calibration).unwrap();
    camera::calibration::save(&path.join(CALIBRATION), &calibration, &[]).unwrap();
    let recorder = Recorder::start(writer, Moment::default()).unwrap();
    for (number, &exposed_at) in (1..).zip(times) {
        recorder.intake().offer(CapturedFrame {
            number,
            exposed_at: Moment::from_nanos(exposed_at),
            exposure: Duration::ZERO,
            asked: FocalPower::MIDDLE,
            measured: None,
            optimal: None,
            patch: PatchRow::default(),
            mosaic: Arc::new(mosaic(number as usize)),
        });
    }
    assert_eq!(recorder.stop().frames, times.len() as u64);
    path
}

fn play(recording: &Path, clock: Arc<dyn Clock>) -> Box<dyn Camera> {
    let optics = SimulatedLens::new(Arc::clone(&clock)).optics();
    let settings = CameraSettings { fps: 25.0, seed: 0, optics, clock };
    camera::open(&format!("recording:{}", recording.display()), settings).unwrap()
}

#[test]
fn a_recording_whose_times_fall_is_played_too() {
    let folder = TempDir::new().unwrap();
    let path = exposed_at(&folder, &[90_000_000, 20_000_000]);
    assert_eq!(info(&path)["seconds"], 0.0);
    assert!(play(&path, Arc::new(SystemClock)).next_frame(Duration::from_secs(5)).is_ok());
}

#[test]
fn a_recording_whose_frames_are_a_nanosecond_apart_is_played_too() {
    let folder = TempDir::new().unwrap();
    let clock = Arc::new(ManualClock::new(jiff::Timestamp::UNIX_EPOCH));
    let mut camera = play(&exposed_at(&folder, &[1, 2]), clock.clone());
    assert_eq!(camera.next_frame(Duration::ZERO).unwrap().number, 1);

    // An hour has as many frames as nanoseconds.
    clock.advance(Duration::from_hours(1));
    assert_eq!(camera.next_frame(Duration::ZERO).unwrap().number, 3_600_000_000_001);
    assert_eq!(camera.health().lost, 3_599_999_999_999);
}

#[test]
fn a_span_becomes_a_video_or_pictures() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 60);
    let video = folder.path().join("video.mp4");
    done(&["recording", "video", text(&recording), "--out", text(&video), "--size", "full"]);

    let mut probe = Command::new("ffprobe");
    probe.args([
        "-v",
        "error",
        "-count_frames",
        "-show_entries",
        "stream=width,height,nb_read_frames",
        "-of",
        "csv=p=0",
    ]);
    let output = probe.arg(&video).output().unwrap();
    // The camera numbered 66 frames, 50 a second. The video has as many; in place of a lost frame it shows the one before
    // for longer.
    let fields: Vec<u32> = said(&output).trim().split(',').map(|field| field.parse().unwrap()).collect();
    assert_eq!(fields[..2], [64, 32]);
    assert_eq!(fields[2], 66);

    let pictures = folder.path().join("pictures");
    let span = ["--from", "0.1", "--to", "0.15", "--pictures", "tiff"];
    let arguments = ["recording", "video", text(&recording), "--out", text(&pictures)];
    done(&[&arguments[..], &span[..]].concat());
    let mut names: Vec<String> =
        fs::read_dir(&pictures).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["frame000005.tiff", "frame000006.tiff", "frame000007.tiff"]);
    let picture = image::open(pictures.join("frame000006.tiff")).unwrap().into_luma16();
    assert!(picture.into_raw() == mosaic(6).samples());

    let told = complaint(&parfocal(&[&arguments[..], &["--from", "9"]].concat()));
    assert!(told.contains("lies within the seconds asked for"), "{told}");
}

#[test]
fn a_video_that_is_interrupted_leaves_nothing() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 3);
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();

    // An encoder that begins the file that is named last, and then waits until somebody writes into its pipe.
    let tools = folder.path().join("tools");
    fs::create_dir(&tools).unwrap();
    let pipe = tools.join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let encoder = tools.join("ffmpeg");
    let script = format!("#!/bin/sh\nfor last; do :; done\necho begun > \"${{last#file:}}\"\ncat '{}'\n", text(&pipe));
    fs::write(&encoder, script).unwrap();
    fs::set_permissions(&encoder, fs::Permissions::from_mode(0o755)).unwrap();

    let video = out.join("video.mp4");
    let mut command = command(&["recording", "video", text(&recording), "--out", text(&video)]);
    let path = format!("{}:{}", text(&tools), std::env::var("PATH").unwrap());
    let mut saving = command.env("PATH", path).stderr(Stdio::null()).spawn().unwrap();
    while fs::read_dir(&out).unwrap().next().is_none() {
        assert!(saving.try_wait().unwrap().is_none(), "it waits for the encoder");
        std::thread::yield_now();
    }

    rustix::process::kill_process(rustix::process::Pid::from_child(&saving), rustix::process::Signal::TERM).unwrap();
    assert!(!saving.wait().unwrap().success());
    assert!(fs::read_dir(&out).unwrap().next().is_none());
    fs::write(&pipe, "end").unwrap();
}

/// Width and height of a video's pictures.
fn video_size(video: &Path) -> String {
    let mut probe = Command::new("ffprobe");
    probe.args(["-v", "error", "-show_entries", "stream=width,height", "-of", "csv=p=0"]);
    said(&probe.arg(video).output().unwrap()).trim().to_owned()
}

#[test]
fn a_video_is_a_new_and_whole_file_of_a_known_kind_and_any_size() {
    let folder = TempDir::new().unwrap();
    // Cells of 17x9 pixels; most encoders take even sizes only.
    let recording = made_up_of(&folder, 12, (68, 36));
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    let video = |name: &str| {
        let name = out.join(name);
        parfocal(&["recording", "video", text(&recording), "--out", text(&name)])
    };

    for name in ["odd.mp4", "odd.mkv", "odd.mov", "odd.AVI"] {
        let output = video(name);
        assert!(output.status.success(), "{name}: {}", complaint(&output));
        assert_eq!(video_size(&out.join(name)), "18,10", "{name}");
    }

    let before = fs::read(out.join("odd.mp4")).unwrap();
    let told = complaint(&video("odd.mp4"));
    assert!(told.contains("odd.mp4 exists already"), "{told}");
    assert!(fs::read(out.join("odd.mp4")).unwrap() == before);

    for name in ["film.webm", "film.mp4.old"] {
        let told = complaint(&video(name));
        assert!(told.contains(&format!("{name}: videos are .mp4, .mkv, .mov or .avi, not .")), "{told}");
    }
    assert!(video("film.webm/").status.success());

    // Of what was written before a damaged frame, nothing is left.
    damage::damage_frame(&recording, 9);
    let told = complaint(&video("damaged.mp4"));
    assert!(told.contains("frame 9 does not match its checksum"), "{told}");
    let mut names: Vec<String> =
        fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["film.webm", "odd.AVI", "odd.mkv", "odd.mov", "odd.mp4"]);
}

#[test]
fn what_does_not_fit_into_a_recorder_is_lost_and_counted() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("recording");
    let writer = Writer::create(&path, header(), (2048, 1088), &Calibration::default()).unwrap();
    let recorder = Recorder::start(writer, Moment::default()).unwrap();

    let shot = |number| CapturedFrame {
        number,
        exposed_at: Moment::from_nanos(number),
        exposure: Duration::ZERO,
        asked: FocalPower::MIDDLE,
        measured: None,
        optimal: None,
        patch: PatchRow { corner: (240, 120), jumps: 0 },
        mosaic: Arc::new(MosaicFrame::new(2048, 1088, vec![number as u16; 2048 * 1088]).unwrap()),
    };
    let shots: Vec<CapturedFrame> = (1..=100).map(shot).collect();
    let intake = recorder.intake();
    for shot in shots {
        intake.offer(shot);
    }

    let progress = recorder.stop();
    assert!(progress.lost > 0 && progress.frames > 0, "{progress:?}");
    assert_eq!(progress.lost + progress.frames, 100);
    let stored = Recording::open(&path).unwrap();
    assert_eq!(stored.header().frames_lost, progress.lost);
    assert_eq!(stored.rows().len() as u64, progress.frames);
}

#[test]
fn a_recording_whose_folder_is_deleted_meanwhile_is_not_begun_anew_without_its_first_frames() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("recording");
    let writer = Writer::create(&path, header(), SIZE, &Calibration::default()).unwrap();
    let recorder = Recorder::start(writer, Moment::default()).unwrap();
    std::fs::remove_dir_all(&path).unwrap();
    recorder.intake().offer(CapturedFrame {
        number: 1,
        exposed_at: Moment::from_nanos(1),
        exposure: Duration::ZERO,
        asked: FocalPower::MIDDLE,
        measured: None,
        optimal: None,
        patch: PatchRow::default(),
        mosaic: Arc::new(mosaic(1)),
    });

    let ended = recorder.stop().ended;
    assert!(matches!(&ended, Some(Ended::Failed(why)) if why.contains("deleted or moved away")), "{ended:?}");
    assert!(!path.exists());
}
