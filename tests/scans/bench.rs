//! A bench recorded with an emulated lens: by an external stepper and by hand.

use super::*;

/// A still picture that serves as footage, and an emulated lens.
fn bench(folder: &TempDir) -> (String, Emulator) {
    let still = folder.path().join("still.png");
    let noise = |x: u32, y: u32| u8::try_from((x * 7919 + y * 104_729 + x * y * 31) % 200).unwrap();
    image::GrayImage::from_fn(160, 120, |x, y| image::Luma([noise(x, y)])).save(&still).unwrap();
    let larger = folder.path().join("larger.png");
    image::GrayImage::from_fn(320, 240, |x, y| image::Luma([noise(x, y)])).save(&larger).unwrap();
    let model = Model { latency: Duration::ZERO, ..Model::default() };
    (format!("footage:{}", still.display()), Emulator::start(model, Arc::new(SystemClock)).unwrap())
}

#[test]
fn a_bench_is_recorded_by_a_stepper_whose_failure_loses_nothing() {
    let folder = TempDir::new().unwrap();
    let (camera, emulator) = bench(&folder);
    let lens = format!("optotune:{}", emulator.path().display());
    let out = folder.path().join("scan");
    let log = folder.path().join("log");
    let broken = folder.path().join("broken");
    fs::write(&broken, "").unwrap();
    let stepper =
        format!("echo {{pose}} >> {}; if [ {{pose}} = 3 -a -e {} ]; then exit 5; fi", text(&log), text(&broken));
    let record = || {
        parfocal(&[
            "scan",
            "record",
            "--camera",
            &camera,
            "--lens",
            &lens,
            "--stepper",
            &stepper,
            "--poses",
            "4",
            "--focal-powers",
            "3",
            "--fps",
            "500",
            "--out",
            text(&out),
        ])
    };

    let told = complaint(&record());
    assert!(told.contains("failed at pose 3 (exit status: 5)") && told.contains("2 of 4 poses are saved"), "{told}");
    fs::remove_file(&broken).unwrap();

    // A camera that was set to another size in between does not spoil the poses before.
    let [still, larger, aside] = ["still.png", "larger.png", "aside.png"].map(|name| folder.path().join(name));
    fs::rename(&still, &aside).unwrap();
    fs::rename(&larger, &still).unwrap();
    let told = complaint(&record());
    assert!(told.contains("holds another scan (with pictures of 120x90 pixels, not 240x180)"), "{told}");
    fs::rename(&aside, &still).unwrap();

    let output = record();
    assert!(output.status.success(), "{}", complaint(&output));
    assert_eq!(fs::read_to_string(&log).unwrap().split_whitespace().collect::<String>(), "123334");
    let scan = ScanFolder::open(&out).unwrap().whole().unwrap();
    assert!(scan.header().lens.as_ref().unwrap().contains("Optotune") && scan.header().simulated);
    // 5 to 10 dpt in the units of firmware A: (dpt + 5) * 200; each pose sends the lens to all three, in its own order.
    let sent: Vec<i16> =
        emulator.commands().iter().map(|&(_, raw)| raw).filter(|raw| [2000, 2500, 3000].contains(raw)).collect();
    let raw = |power: FocalPower| {
        let ends = [(FocalPower::MIN, 2000), (FocalPower::MIDDLE, 2500), (FocalPower::MAX, 3000)];
        ends.into_iter().find(|end| end.0 == power).unwrap().1
    };

    for pose in scan.poses().values() {
        let asked: Vec<i16> = pose.images.iter().map(|image| raw(image.focal_power)).collect();
        assert!(sent.windows(3).any(|three| three == asked), "{asked:?} in {sent:?}");
    }
}

#[test]
fn a_person_at_the_bench_is_asked_for_each_pose() {
    let folder = TempDir::new().unwrap();
    let (camera, _) = bench(&folder);
    let out = folder.path().join("scan");
    let record = |typed: &[u8]| {
        let mut child = command(&[
            "scan",
            "record",
            "--camera",
            &camera,
            "--lens",
            "simulated",
            "--poses",
            "3",
            "--focal-powers",
            "2",
            "--fps",
            "500",
            "--out",
            text(&out),
        ])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();

        child.stdin.take().unwrap().write_all(typed).unwrap();
        child.wait_with_output().unwrap()
    };

    let left = record(b"\n\n");
    assert!(complaint(&left).contains("nobody confirmed pose 3"), "{}", complaint(&left));
    assert!(String::from_utf8_lossy(&left.stderr).contains("pose 1 of 3: move the camera there, then press Enter"));
    let back = record(b"\n");
    assert!(back.status.success(), "{}", complaint(&back));
    assert_eq!(ScanFolder::open(&out).unwrap().whole().unwrap().poses().len(), 3);
    let lens = parfocal(&["scan", "record", "--camera", &camera, "--out", text(&folder.path().join("none"))]);
    assert!(complaint(&lens).contains("--lens"));
}
