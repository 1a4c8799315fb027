//! A policy stepped over a recording.

use std::collections::BTreeMap;
use std::fs;

use super::*;
use parfocal_autofocus::mgm;
use parfocal_imaging::{PatchArea, Reconstructor};

/// The rows that `parfocal recording step` writes for `policy` over `recording`.
fn stepped(folder: &TempDir, recording: &Path, policy: &str) -> Vec<BTreeMap<String, String>> {
    let out = folder.path().join(format!("{policy}.csv"));
    let printed = done(&["recording", "step", text(recording), "--policy", policy, "--out", text(&out)]);
    assert!(printed.contains(&format!("steps of {policy} in")), "{printed}");
    csv::Reader::from_path(out).unwrap().deserialize().map(Result::unwrap).collect()
}

fn value(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} of {row:?}"))
}

#[test]
fn a_policy_steps_over_a_recording_and_says_what_it_saw_and_asked() {
    let folder = TempDir::new().unwrap();
    let recording = folder.path().join("phantom");
    let printed =
        done(&["recording", "record", "--out", text(&recording), "--seconds", "2", "--policy", "mgm-hill-climber"]);
    assert!(printed.contains("frames in"), "{printed}");
    let frames = Recording::open(&recording).unwrap();

    let rows = stepped(&folder, &recording, "mgm-hill-climber");
    assert_eq!(rows.len(), frames.rows().len());
    let mut last_metric = f64::NEG_INFINITY;
    let mut direction = 1.0;
    for (row, known) in rows.iter().zip(frames.rows()) {
        assert_eq!(row["frame_number"], known.number.to_string());
        let exposed_at = value(row, "focal_power");
        assert!((exposed_at - known.measured).abs() < 1e-12, "as the lens said: {row:?}");
        assert!((value(row, "recorded_asked") - known.asked).abs() < 1e-12, "{row:?}");

        // The paper's rule: a step of 0.05 in the last direction if the metric rose and 0 < f < 1, else in the other.
        let metric = value(row, "metric");
        let goes_on = metric > last_metric && exposed_at > 0.0 && exposed_at < 1.0;
        direction = if goes_on { direction } else { -direction };
        let expected = (exposed_at + 0.05 * direction).clamp(0.0, 1.0);
        assert!((value(row, "target") - expected).abs() < 1e-9, "{expected}: {row:?}");
        last_metric = metric;
    }

    // `recording record` looks for no circle, so its loop had the patch at the middle of 512x272 cells. The metric is
    // that of the patch there.
    let reconstructor = Reconstructor::new(&camera::calibration::read(&frames.calibration()).unwrap());
    let area = PatchArea { x: 240, y: 120, width: 32, height: 32 };
    for frame in [0, rows.len() - 1] {
        assert_eq!((value(&rows[frame], "patch_x"), value(&rows[frame], "patch_y")), (240.0, 120.0));
        let patch = reconstructor.gray_patch(&frames.frame(frame).unwrap(), area);
        assert!((mgm(&patch) - value(&rows[frame], "metric")).abs() < 1e-9, "{:?}", rows[frame]);
    }

    let fixed = stepped(&folder, &recording, "fixed");
    let start = value(&fixed[0], "focal_power");
    assert!(fixed.iter().all(|row| (value(row, "target") - start).abs() < 1e-12), "it stays where it began");
    assert!(fixed.iter().all(|row| row["metric"].is_empty()));
}

#[test]
fn a_table_is_written_whole_or_not_at_all() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 30);
    let out = folder.path().join("steps.csv");
    let step = |policy: &str| {
        complaint(&parfocal(&["recording", "step", text(&recording), "--policy", policy, "--out", text(&out)]))
    };
    assert!(step("guess").contains("there is no policy 'guess'"));
    assert!(step("file:/no/such.pt").contains("cannot read /no/such.pt"));
    assert!(step("exec:/no/such/program").contains("there is no program /no/such/program"));
    // The made-up mosaics are smaller than a patch.
    assert!(step("fixed").contains("frame 0 holds nothing to focus on"), "{}", step("fixed"));
    assert!(!out.exists());
}

/// A recording of 96x40 cells whose level rises by the same amount from cell to cell. Its patch
/// moves to the right by a cell a frame, and jumps in frame 6.
fn slope(folder: &TempDir) -> PathBuf {
    const SIZE: (usize, usize) = (4 * 96, 4 * 40);
    let path = folder.path().join("slope");
    let calibration = Calibration::default();
    let writer = Writer::create(&path, header(), SIZE, &calibration).unwrap();
    camera::calibration::save(&path.join(CALIBRATION), &calibration, &[]).unwrap();

    let recorder = Recorder::start(writer, Moment::default()).unwrap();
    let level = |place: usize| (100 + place % SIZE.0 / 4) as u16;
    let mosaic = Arc::new(MosaicFrame::new(SIZE.0, SIZE.1, (0..SIZE.0 * SIZE.1).map(level).collect()).unwrap());
    for frame in 0..12u64 {
        recorder.intake().offer(CapturedFrame {
            number: frame,
            exposed_at: Moment::from_nanos(frame * 20_000_000),
            exposure: Duration::from_millis(2),
            asked: FocalPower::MIDDLE,
            measured: None,
            optimal: None,
            patch: PatchRow { corner: (if frame < 6 { frame } else { 50 + frame }, 8), jumps: u64::from(frame >= 6) },
            mosaic: Arc::clone(&mosaic),
        });
        wait_for(|| recorder.progress().frames > frame);
    }
    assert_eq!(recorder.stop().lost, 0);
    path
}

/// The name of a policy in a process of its own, `outside.py`, that does `deed` in the sixth frame that it sees.
fn outside(deed: &str) -> String {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recordings/outside.py");
    format!("exec:python3 -s '{script}' {deed}")
}

#[test]
fn a_policy_in_another_process_steps_on_the_patch_where_it_was() {
    let folder = TempDir::new().unwrap();
    let recording = slope(&folder);
    let out = folder.path().join("steps.csv");
    let policy = outside("nothing");
    done(&["recording", "step", text(&recording), "--policy", &policy, "--out", text(&out)]);
    let rows: Vec<BTreeMap<String, String>> =
        csv::Reader::from_path(out).unwrap().deserialize().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 12);

    // Its metric is the patch's mean level, which tells the column.
    let rise = value(&rows[1], "metric") - value(&rows[0], "metric");
    assert!(rise > 0.0, "{rows:?}");
    for (row, frame) in rows.iter().zip(0..) {
        let column = if frame < 6 { frame } else { 50 + frame };
        assert_eq!((value(row, "patch_x"), value(row, "patch_y")), (f64::from(column), 8.0));
        let found = (value(row, "metric") - value(&rows[0], "metric")) / rise;
        assert!((found - f64::from(column)).abs() < 0.01 * f64::from(column.max(1)), "{found} is not {column}");
        // Its target tells how many frames it has seen since it was told to forget.
        let seen = if frame < 6 { frame } else { frame - 6 };
        assert!((value(row, "target") - 0.01 * f64::from(seen + 1)).abs() < 1e-9, "{row:?}");
    }
}

#[test]
fn a_process_that_fails_leaves_no_table_and_says_why() {
    let folder = TempDir::new().unwrap();
    let recording = slope(&folder);
    let out = folder.path().join("steps.csv");
    for (deed, words) in [
        ("end", "at frame 5 the policy gave no focal power: its process ended (exit code 3)"),
        ("nonsense", "at frame 5 the policy gave no focal power: it sent 5 bytes where an answer has 40"),
        ("nan", "at frame 5 the policy returned NaN, which is not a focal power from 0 to 1"),
        ("hang", "at frame 5 the policy gave no focal power: it did not answer in time"),
    ] {
        let arguments = ["recording", "step", text(&recording), "--policy", &outside(deed), "--out", text(&out)];
        let told = complaint(&parfocal(&arguments));
        assert!(told.contains(words), "{deed}: {told}");
        assert!(!out.exists());
    }
}

#[test]
fn a_recording_that_lacks_the_places_of_the_patch_is_damaged() {
    let folder = TempDir::new().unwrap();
    let recording = slope(&folder);
    fs::remove_dir_all(recording.join("patch_y")).unwrap();

    let out = folder.path().join("steps.csv");
    let told = complaint(&parfocal(&["recording", "step", text(&recording), "--policy", "fixed", "--out", text(&out)]));
    assert!(told.contains("the values of `patch_y` are missing or do not match their checksum"), "{told}");
}
