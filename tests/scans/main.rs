//! Recorded focal-time scans from outside: recorded, interrupted, resumed, damaged, imported,
//! played and evaluated on.

mod bench;
mod evaluation;
mod from_stack;
mod import;
#[path = "../shared/program.rs"]
mod program;
mod raw;
mod tiff;

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment, SystemClock};
use parfocal_devices::camera::recorded::{POSES, ScanFolder};
use parfocal_devices::camera::{self, CameraSettings, FrameImage};
use parfocal_devices::lens::Optics;
use parfocal_devices::lens::emulator::{Emulator, Model};
use parfocal_devices::simulation::phantom::Trajectory;
use parfocal_learning::scans::recorded::{HASTE, Kept, RecordedScan};
use serde_json::Value;
use tempfile::TempDir;

use self::program::{command, complaint, parfocal, said, text};

/// What a command that succeeds tells on standard error.
fn notes(output: &Output) -> String {
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    told
}

/// Arguments that record a small scan of the phantom.
fn recording(out: &Path, poses: usize) -> Vec<String> {
    let arguments = ["scan", "record", "--camera", "phantom", "--focal-powers", "5", "--seed", "7", "--poses"];
    let rest = [poses.to_string(), "--out".to_owned(), out.display().to_string()];
    arguments.into_iter().map(str::to_owned).chain(rest).collect()
}

fn run(arguments: &[String]) -> Output {
    parfocal(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

/// A recorded scan of the phantom.
fn recorded(folder: &TempDir, poses: usize) -> PathBuf {
    let out = folder.path().join("scan");
    let output = run(&recording(&out, poses));
    assert!(output.status.success(), "{}", complaint(&output));
    out
}

/// Every file below `folder`, with its content.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() {
                folders.push(entry);
            } else {
                files.push((entry.strip_prefix(folder).unwrap().to_owned(), fs::read(&entry).unwrap()));
            }
        }
    }

    files.sort();
    files
}

#[test]
fn what_is_recorded_is_what_is_evaluated_on() {
    let folder = TempDir::new().unwrap();
    let out = recorded(&folder, 4);
    let stored = RecordedScan::read(&ScanFolder::open(&out).unwrap(), Kept::Surroundings, &|| ()).unwrap();
    let made = RecordedScan::phantom(&Trajectory::new(7, 4, HASTE), 7, 5, Kept::Surroundings, &|| ());
    assert!(stored == made, "the benchmark in memory is the scan on disk, to the last gray level");

    let plot = folder.path().join("plot.svg");
    let output = parfocal(&["scan", "info", text(&out), "--json", "--out", text(&plot)]);
    let info: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&info["poses"], &info["recorded"]), (&4.into(), &4.into()));
    assert_eq!(info["focal_powers"], serde_json::json!([0.0, 0.25, 0.5, 0.75, 1.0]));
    assert_eq!((&info["width"], &info["height"]), (&512.into(), &272.into()));
    assert!(info["deviation"]["mean"].as_f64().unwrap() < 0.25, "{info}");
    assert_eq!(info["deviation"]["within_step"], 1.0);
    assert!(fs::read_to_string(plot).unwrap().contains("<title>truth</title>"));

    let evaluate = |between: &str| {
        let output =
            parfocal(&["evaluate", "--scans", text(&out), "--policies", "fixed", "--between", between, "--json"]);
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };

    let report = evaluate("interpolated");
    assert_eq!((&report["between"], &report["seed"]), (&"interpolated".into(), &7.into()));
    let optimum: f64 = stored.poses().iter().map(|pose| (pose.optimum.get() - 0.5).abs()).sum::<f64>() / 4.0;
    assert!((report["rows"][1]["mae"].as_f64().unwrap() - optimum).abs() < 1e-12, "fixed stays at 0.5: {report}");
    let table = parfocal(&["evaluate", "--scans", text(&out), "--policies", "fixed"]);
    assert!(said(&table).contains("at the nearest focal power"), "{}", said(&table));
    assert!(said(&table).contains("0.262 ± 0.161"), "the paper's robotic column: {}", said(&table));

    let refused = |options: &[&str]| complaint(&parfocal(&[&["evaluate", "--policies", "fixed"], options].concat()));
    assert!(refused(&["--scans", text(&out), "--seed", "8"]).contains("its own seed; leave out --seed"));
    for drawn in ["simulated", "relief"] {
        assert!(refused(&["--scans", drawn, "--between", "nearest"]).contains("--between is for recorded scans"));
    }
}

/// Waits until a recording has stored `poses` of its poses.
fn until_stored(out: &Path, poses: usize, child: &mut Child) {
    let lines = || fs::read_to_string(out.join(POSES)).map_or(0, |text| text.matches('\n').count());
    while lines() < poses {
        assert!(child.try_wait().unwrap().is_none(), "it ended too early");
        std::thread::yield_now();
    }
}

#[test]
fn a_killed_or_stopped_recording_continues_to_the_same_scan() {
    let folder = TempDir::new().unwrap();
    let whole = recorded(&folder, 6);
    let out = folder.path().join("parts");
    let arguments = recording(&out, 6);
    let start = || {
        let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
        command(&arguments).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
    };

    let mut killed = start();
    until_stored(&out, 1, &mut killed);
    killed.kill().unwrap();
    killed.wait().unwrap();
    // As if the power had failed while a line was being written and a pose was being stored.
    fs::OpenOptions::new().append(true).open(out.join(POSES)).unwrap().write_all(b"{\"pose\":9").unwrap();
    fs::create_dir_all(out.join(".pose0005.partial")).unwrap();

    let mut stopped = start();
    until_stored(&out, 3, &mut stopped);
    let id = rustix::process::Pid::from_child(&stopped);
    rustix::process::kill_process(id, rustix::process::Signal::INT).unwrap();
    let stopped = stopped.wait_with_output().unwrap();
    assert!(stopped.status.success() && said(&stopped).contains("run the same command again"), "{}", said(&stopped));

    let other = run(&recording(&out, 5));
    assert!(complaint(&other).contains("another scan (of another number of poses)"), "{}", complaint(&other));
    assert!(run(&arguments).status.success());
    assert!(contents(&whole) == contents(&out), "the scan differs from one that was not interrupted");
}

#[test]
fn what_is_missing_or_damaged_is_named() {
    let folder = TempDir::new().unwrap();
    let out = recorded(&folder, 3);
    let journal = fs::read_to_string(out.join(POSES)).unwrap();
    let lines: Vec<_> = journal.lines().collect();
    let refusals = |told: &str| {
        let camera = format!("scan:{}", text(&out));
        let data = folder.path().join("data");
        for arguments in [
            vec!["evaluate", "--scans", text(&out), "--policies", "fixed"],
            vec!["scan", "info", text(&out)],
            vec!["serve", "--camera", &camera, "--bind", "127.0.0.1:0", "--data-dir", text(&data)],
        ] {
            let complaint = complaint(&parfocal(&arguments));
            assert!(complaint.contains(told), "{arguments:?}: {complaint}");
        }
    };

    fs::write(out.join(POSES), format!("{}\n{}\n", lines[0], lines[2])).unwrap();
    refusals("pose 2 of 3 is missing");

    fs::write(out.join(POSES), format!("{}\n", lines[0])).unwrap();
    let info = said(&parfocal(&["scan", "info", text(&out)]));
    assert!(info.contains("changes by 0.0000 per pose") && info.contains("missing       poses 2, 3\n"), "{info}");

    fs::write(out.join(POSES), format!("{0}\n{0}\n", lines[0])).unwrap();
    refusals("pose 1 is listed twice");

    fs::write(out.join(POSES), journal.replace("pose0002/pose0002", "../scan/pose0002")).unwrap();
    refusals("is not a file in the scan's folder");

    fs::write(out.join(POSES), &journal).unwrap();
    let header = fs::read_to_string(out.join("scan.json")).unwrap();
    fs::write(out.join("scan.json"), header.replace("\"version\": 1", "\"version\": 2")).unwrap();
    refusals("this program reads version 1");
    fs::write(out.join("scan.json"), header.replace("\"poses\": 3", "\"poses\": 100000000000")).unwrap();
    refusals("it has 100000000000 poses; a scan has 1 to 100000");
    fs::write(out.join("scan.json"), header).unwrap();

    let picture = out.join("pose0002/pose0002_f0.250.png");
    let mut bytes = fs::read(&picture).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&picture, bytes).unwrap();

    let info = parfocal(&["scan", "info", text(&out), "--json"]);
    assert!(complaint(&info).contains("pose0002/pose0002_f0.250.png is damaged: its SHA-256"), "{}", complaint(&info));
    assert_eq!(serde_json::from_slice::<Value>(&info.stdout).unwrap()["damaged"][0], "pose0002/pose0002_f0.250.png");

    let evaluated = complaint(&parfocal(&["evaluate", "--scans", text(&out), "--policies", "fixed"]));
    assert!(evaluated.contains("pose0002_f0.250.png is damaged"), "{evaluated}");

    let nothing = complaint(&parfocal(&["scan", "info", text(folder.path())]));
    assert!(nothing.contains("is not a recorded scan"), "{nothing}");
}

/// A lens that stays at one focal power.
struct At(f64);

impl Optics for At {
    fn focal_power_at(&self, _: Moment) -> FocalPower {
        FocalPower::nearest(self.0)
    }
}

#[test]
fn a_scan_plays_as_a_camera_and_the_lens_picks_the_picture() {
    let folder = TempDir::new().unwrap();
    let out = recorded(&folder, 1);
    let scan = ScanFolder::open(&out).unwrap();
    let pose = &scan.poses()[&1];
    for (power, nearest) in [(0.1, 0.0), (0.4, 0.5), (0.9, 1.0)] {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock);
        let settings = CameraSettings { fps: 500.0, seed: 1, optics: Arc::new(At(power)), clock };
        let mut camera = camera::open(&format!("scan:{}", out.display()), settings).unwrap();

        let frame = camera.next_frame(Duration::from_secs(5)).unwrap();
        let FrameImage::Rgb(rgb) = &frame.image else { panic!("a gray picture in colour") };

        let image = pose.images.iter().find(|image| image.focal_power == FocalPower::nearest(nearest)).unwrap();
        let stored = image::open(out.join(&image.file)).unwrap().into_rgb8();
        assert!(rgb.data == stored.into_raw(), "at {power}");
        assert_eq!(frame.truth.unwrap().optimal, pose.optimum);

        let health = camera.health();
        assert!(health.simulated && health.name.contains("recording"), "{}", health.name);
    }

    let data = folder.path().join("data");
    let spec = format!("scan:{}", out.display());
    let mut server = command(&["serve", "--camera", &spec, "--bind", "127.0.0.1:0", "--data-dir", text(&data)])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();

    let lines = BufReader::new(server.stdout.take().unwrap()).lines().map(Result::unwrap);
    let said: Vec<String> = lines.take_while(|line| !line.starts_with("Ctrl-C")).collect();
    server.kill().unwrap();
    server.wait().unwrap();

    let said = said.join("\n");
    assert!(said.contains("recorded scan scan (a recording of: brain phantom") && said.contains("SIMULATED"), "{said}");
}

#[test]
fn a_full_disk_keeps_what_is_whole() {
    let folder = TempDir::new().unwrap();
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let program = env!("CARGO_BIN_EXE_parfocal");
    // A disk of 600 KB holds three poses of 180 KB. The disk ends with the namespace in which it is mounted.
    let script = format!(
        "mount -t tmpfs -o size=600k tmpfs {0} || exit 77
         {1} scan record --poses 6 --focal-powers 5 --seed 7 --out {0}/scan; echo code $?; ls -A {0}/scan
         mount -o remount,size=9m {0} && {1} scan record --poses 6 --focal-powers 5 --seed 7 --out {0}/scan
         {1} scan info {0}/scan --json",
        disk.display(),
        program
    );

    let output = Command::new("unshare").args(["-rm", "sh", "-c", &script]).stdin(Stdio::null()).output();
    let output = match output {
        Ok(output) if output.status.code() != Some(77) && !said(&output).is_empty() => output,
        other => return println!("skipped: a small disk cannot be mounted here: {other:?}"),
    };

    let out = said(&output);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(out.starts_with("code 1\n") && error.contains("no space is left on the disk of"), "{out}{error}");
    let kept: usize = error.split(" poses are saved").next().unwrap().rsplit(' ').next().unwrap().parse().unwrap();
    let listed = out.lines().filter(|line| line.starts_with("pose0")).count();
    assert!((1..6).contains(&kept) && listed == kept && !out.contains(".partial"), "{out}{error}");
    let info: Value = serde_json::from_str(out.lines().last().unwrap()).unwrap();
    assert_eq!((&info["recorded"], &info["damaged"]), (&6.into(), &serde_json::json!([])), "{out}{error}");
}
