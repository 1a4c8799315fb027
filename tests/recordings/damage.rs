//! Recordings that are cut short, damaged or of another version, and disks without space.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};

use super::*;

/// Damages a frame in the middle of a recording.
pub(super) fn damage_frame(recording: &Path, frame: usize) {
    let shard = recording.join("mosaic/c/0/0/0");
    // By the format's description: pairs of offset and length, and four bytes of checksum, at the end.
    let bytes = fs::read(&shard).unwrap();
    let index = &bytes[bytes.len() - 25 * 16 - 4..];
    let offset = u64::from_le_bytes(index[16 * frame..16 * frame + 8].try_into().unwrap());
    flip(&shard, offset + 40);
}

/// Flips a bit of the byte at offset `at`.
fn flip(file: &Path, at: u64) {
    let mut file = OpenOptions::new().read(true).write(true).open(file).unwrap();
    let mut byte = [0];
    file.seek(SeekFrom::Start(at)).unwrap();
    file.read_exact(&mut byte).unwrap();
    file.seek(SeekFrom::Start(at)).unwrap();
    file.write_all(&[byte[0] ^ 0x10]).unwrap();
}

fn check(recording: &Path) -> String {
    complaint(&parfocal(&["recording", "info", text(recording)]))
}

#[test]
fn what_a_killed_recording_had_stored_opens() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("recording");
    let mut recording = command(&["recording", "record", "--out", text(&out)]).stderr(Stdio::null()).spawn().unwrap();
    wait_for(|| Recording::open(&out).is_ok_and(|there| there.rows().len() >= 50));
    recording.kill().unwrap();
    recording.wait().unwrap();

    let told = info(&out);
    assert!(told["frames"].as_u64().unwrap() >= 50);
    assert_eq!((&told["ended"], &told["damaged"]), (&Value::Null, &serde_json::json!([])));
    assert!(done(&["recording", "info", text(&out)]).contains("cut short"));
    assert_eq!(python(&[text(&out)])["shape"][0], told["frames"]);
}

#[test]
fn a_recording_whose_terminal_closes_keeps_its_last_frames() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("recording");
    let mut recording = command(&["recording", "record", "--out", text(&out)]).stderr(Stdio::null()).spawn().unwrap();
    wait_for(|| Recording::open(&out).is_ok_and(|there| !there.rows().is_empty()));
    let process = rustix::process::Pid::from_child(&recording);
    for _ in 0..2 {
        rustix::process::kill_process(process, rustix::process::Signal::HUP).unwrap();
    }

    assert!(recording.wait().unwrap().success());
    assert_eq!(info(&out)["ended"]["why"], "stopped");
}

#[test]
fn a_damaged_frame_is_named_and_the_others_are_read() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 30);
    damage_frame(&recording, 3);

    let told = check(&recording);
    assert!(told.contains("frame 3 does not match its checksum"), "{told}");
    assert!(!told.contains("more)"), "only this one: {told}");
    let opened = Recording::open(&recording).unwrap();
    assert!(opened.frame(3).is_err() && opened.frame(2).unwrap() == mosaic(2) && opened.frame(4).unwrap() == mosaic(4));
}

#[test]
fn of_pictures_or_a_video_that_a_damaged_frame_ends_no_part_is_left() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 30);
    damage_frame(&recording, 3);

    for name in ["pictures", "video.mp4"] {
        let out = folder.path().join(name);
        let told = complaint(&parfocal(&["recording", "video", text(&recording), "--out", text(&out)]));
        assert!(told.contains("frame 3") && told.contains(text(&out)), "{told}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing but the recording");
}

#[test]
fn a_cut_or_missing_file_names_its_frames() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 60);
    let shard = recording.join("mosaic/c/1/0/0");
    let length = fs::metadata(&shard).unwrap().len();
    File::options().write(true).open(&shard).unwrap().set_len(length - 1).unwrap();
    let told = check(&recording);
    assert!(told.contains("so frames 25 to 49 cannot be found in it") && !told.contains("more)"), "{told}");

    fs::remove_file(&shard).unwrap();
    let told = check(&recording);
    assert!(told.contains("the file is missing, so frames 25 to 49 are lost"), "{told}");
    assert!(Recording::open(&recording).unwrap().frame(50).unwrap() == mosaic(50));

    flip(&recording.join("time/c/0"), 100);
    assert!(check(&recording).contains("the values of `time` are missing or do not match their checksum"));
}

#[test]
fn a_recording_whose_bands_or_calibration_are_damaged_is_not_called_whole() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 2);
    done(&["recording", "info", text(&recording)]);

    let row = recording.join("cell_row/c/0");
    flip(&row, 5);
    assert!(check(&recording).contains("the values of `cell_row` do not match their checksum"));
    flip(&row, 5);

    let widths = recording.join("fwhm/c/0");
    let before = fs::read(&widths).unwrap();
    fs::remove_file(&widths).unwrap();
    assert!(check(&recording).contains("the values of `fwhm` cannot be read"));
    fs::write(&widths, before).unwrap();

    fs::write(recording.join(CALIBRATION).join("calibration.toml"), "").unwrap();
    assert!(check(&recording).contains("calibration.toml is empty"));
    let spectrum = parfocal(&["recording", "spectrum", text(&recording), "--at", "30,20"]);
    assert!(complaint(&spectrum).contains("calibration.toml is empty"), "it would be taken for a typical unit's");
}

#[test]
fn a_calibration_that_does_not_fit_the_recording_is_refused_by_all_that_use_it() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 2);
    let out = |name: &str| text(&folder.path().join(name)).to_owned();
    let (cube, video, table) = (out("cube.hdr"), out("pictures"), out("steps.csv"));
    let uses: [&[&str]; 4] = [
        &["cube", "--frame", "1", "--out", &cube],
        &["spectrum", "--at", "30,20"],
        &["video", "--out", &video],
        &["step", "--policy", "fixed", "--out", &table],
    ];

    let dark = Reference::PerPixel(MosaicFrame::new(8, 4, vec![1; 32]).unwrap());
    let small = Calibration { dark, ..Calibration::default() };
    let white = Reference::PerBand([4095.0; BANDS]);
    let deep = Calibration { bit_depth: 12, white, ..Calibration::default() };
    for (other, why) in [(small, "was taken at 8x4, but the recording is 64x32"), (deep, "for samples of 12 bit")] {
        camera::calibration::save(&recording.join(CALIBRATION), &other, &["dark"]).unwrap();
        for arguments in uses {
            let told =
                complaint(&parfocal(&[&["recording", arguments[0], text(&recording)], &arguments[1..]].concat()));
            assert!(told.contains(why) && told.contains("put the recording's own back into"), "{told}");
        }
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing was written");
}

#[test]
fn a_folder_that_is_not_a_recording_of_this_version_is_named_as_such() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 2);
    let description = recording.join("zarr.json");
    let original = fs::read_to_string(&description).unwrap();
    let told = |from: &str, to: &str| {
        assert!(original.contains(from));
        fs::write(&description, original.replace(from, to)).unwrap();
        check(&recording)
    };

    assert!(told("\"version\": 1", "\"version\": 2").contains("format version 2, but this parfocal reads version 1"));
    assert!(told("parfocal-recording", "something").contains("is not a recording"));
    assert!(told("2026-03-01T12:00:00.25Z", "yesterday").contains("does not describe a recording"));
    assert!(told("{", "[").contains("does not describe a recording"));
    let sensor = told("      \"mosaic\": {", "      \"mosaics\": {");
    assert!(sensor.contains("it has no mosaics"), "{sensor}");

    let told = complaint(&parfocal(&["recording", "info", text(&folder.path().join("nowhere"))]));
    assert!(told.contains("is not a recording"), "{told}");
}

#[test]
fn a_folder_that_exists_and_a_camera_without_mosaics_are_refused() {
    let folder = TempDir::new().unwrap();
    let told = complaint(&parfocal(&["recording", "record", "--out", text(folder.path()), "--seconds", "1"]));
    assert!(told.contains("exists; choose a new folder"), "{told}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);

    let still = folder.path().join("still.png");
    image::GrayImage::from_pixel(320, 240, image::Luma([90])).save(&still).unwrap();
    let camera = format!("footage:{}", still.display());
    let out = folder.path().join("out");
    let told = complaint(&parfocal(&["recording", "record", "--out", text(&out), "--camera", &camera]));
    assert!(told.contains("delivers colour pictures") && !out.exists(), "{told}");

    let told = complaint(&parfocal(&["recording", "record", "--out", text(&out), "--policy", "guess"]));
    assert!(told.contains("guess") && !out.exists(), "{told}");
}

#[test]
fn a_frame_rate_too_low_for_the_control_loop_is_refused_by_all_that_run_it() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    for arguments in [["recording", "record", "--out"], ["serve", "--bind=127.0.0.1:0", "--data-dir"]] {
        let output = parfocal(&[&arguments[..], &[text(&out), "--fps", "4"]].concat());
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains("4 is not in 5..=1000"), "{told}");
    }
    assert!(!out.exists());
}

/// A small disk in memory, unmounted when dropped.
struct SmallDisk(TempDir);

impl SmallDisk {
    /// A disk of this many megabytes. `None`, with a message on standard error, if this user may not mount one.
    fn mount(megabytes: u32) -> Option<Self> {
        let folder = TempDir::new().unwrap();
        let size = format!("size={megabytes}m");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder.path()).output();
        if mounted.is_ok_and(|output| output.status.success()) {
            return Some(Self(folder));
        }
        eprintln!("skipped: to try a full disk, one has to be mounted, which takes root");
        None
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("--lazy").arg(self.0.path()).status();
    }
}

#[test]
fn a_recording_stops_by_itself_before_the_disk_is_full() {
    let Some(disk) = SmallDisk::mount(60) else { return };
    let out = disk.0.path().join("recording");
    let told = complaint(&parfocal(&["recording", "record", "--out", text(&out), "--seconds", "60"]));
    assert!(told.contains("nearly full"), "{told}");

    let found = info(&out);
    assert!(found["frames"].as_u64().unwrap() >= 25, "{found}");
    assert_eq!(found["ended"]["why"], "disk-nearly-full");
    assert!(told.contains(&format!("{} frames in", found["frames"])), "{told}");

    // A twentieth of the disk is left.
    let free = rustix::fs::statvfs(disk.0.path()).unwrap();
    assert!(free.f_bavail * free.f_frsize > 60 * 1024 * 1024 / 21, "{} blocks", free.f_bavail);
}

#[test]
fn a_disk_that_something_else_fills_costs_only_what_was_not_stored() {
    let Some(disk) = SmallDisk::mount(200) else { return };
    let out = disk.0.path().join("recording");
    let recording = command(&["recording", "record", "--out", text(&out)]).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(|| Recording::open(&out).is_ok_and(|there| !there.rows().is_empty()));

    let mut filler = File::create(disk.0.path().join("filler")).unwrap();
    while filler.write_all(&[0; 4096]).is_ok() {}
    let told = complaint(&recording.wait_with_output().unwrap());
    assert!(told.contains("full"), "{told}");

    let found = info(&out);
    assert!(found["frames"].as_u64().unwrap() >= 25 && found["damaged"] == serde_json::json!([]), "{found}");
    assert!(told.contains(&format!("{} frames in", found["frames"])), "{told} {found}");
}

#[test]
fn a_recording_for_which_the_disk_has_no_room_leaves_no_folder() {
    let Some(disk) = SmallDisk::mount(1) else { return };
    let mut filler = File::create(disk.0.path().join("filler")).unwrap();
    while filler.write_all(&[0; 4096]).is_ok() {}

    let out = disk.0.path().join("recording");
    let told = complaint(&parfocal(&["recording", "record", "--out", text(&out), "--seconds", "1"]));
    assert!(told.contains("no space is left") && !out.exists(), "{told}");
}

#[test]
fn a_video_for_whose_end_the_disk_has_no_room_is_not_called_done() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 150);
    let whole = folder.path().join("whole.mp4");
    done(&["recording", "video", text(&recording), "--out", text(&whole), "--size", "full"]);
    assert!(fs::metadata(&whole).unwrap().len() > 4096, "more than is left on the disk");

    let Some(disk) = SmallDisk::mount(1) else { return };
    let mut filler = File::create(disk.0.path().join("filler")).unwrap();
    while filler.write_all(&[0; 4096]).is_ok() {}
    filler.set_len(filler.metadata().unwrap().len() - 4096).unwrap();

    let out = disk.0.path().join("video.mp4");
    let told = complaint(&parfocal(&["recording", "video", text(&recording), "--out", text(&out), "--size", "full"]));
    assert!(told.contains("No space left on device"), "{told}");
    assert_eq!(fs::read_dir(disk.0.path()).unwrap().count(), 1, "nothing but what was there");
}
