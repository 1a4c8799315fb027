//! GigE Vision cameras, tested with Aravis's fake camera, a separate program on the loopback (Debian's package
//! `aravis-tools`).

use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_devices::camera::gige::GigeCamera;
use parfocal_devices::camera::{Camera, CameraError, CameraSettings, Controls, Frame, FrameImage, Setting};
use parfocal_devices::lens::Lens;
use parfocal_devices::lens::SimulatedLens;
use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::support::Server;
use crate::support::fake_camera::Fake;

const SECOND: Duration = Duration::from_secs(1);

fn settings(fps: f64) -> CameraSettings {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    CameraSettings { fps, seed: 0, optics: SimulatedLens::new(clock.clone()).optics(), clock }
}

fn open(options: &str, fps: f64) -> Result<GigeCamera, CameraError> {
    GigeCamera::open(&format!("Aravis-Fake-TEST{options}"), settings(fps))
}

fn refused(options: &str) -> String {
    open(options, 10.0).err().expect("it must not open").to_string()
}

/// Collects frames for `time`. Returns them, and how often none came in time.
fn watch(camera: &mut GigeCamera, time: Duration) -> (Vec<Frame>, usize) {
    let mut frames = Vec::new();
    let mut failures = 0;
    let begun = SystemClock.now();
    while SystemClock.now().since(begun) < time {
        match camera.next_frame(Duration::from_millis(200)) {
            Ok(frame) => frames.push(Frame { image: shrunk(&frame.image), ..frame }),
            Err(_) => failures += 1,
        }
    }

    (frames, failures)
}

/// Drops the large picture, as the control loop does.
fn shrunk(image: &FrameImage) -> FrameImage {
    match image {
        FrameImage::Mosaic(_) => FrameImage::Rgb(Arc::default()),
        FrameImage::Rgb(image) => FrameImage::Rgb(image.clone()),
    }
}

fn until(what: &str, mut condition: impl FnMut() -> bool) -> Duration {
    let begun = SystemClock.now();
    while !condition() {
        assert!(SystemClock.now().since(begun) < 30 * SECOND, "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
    SystemClock.now().since(begun)
}

#[test]
fn delivers_whole_mosaics_with_rising_numbers_and_times() {
    let Some(_fake) = Fake::start(&[]) else { return };
    let mut camera = open("?format=Mono16", 25.0).unwrap();
    let frame = camera.next_frame(5 * SECOND).unwrap();
    let FrameImage::Mosaic(mosaic) = &frame.image else { panic!("a mosaic") };
    assert_eq!((mosaic.width(), mosaic.height()), (2048, 1088));
    assert!(mosaic.samples().iter().all(|&sample| sample < 1024));
    // The fake camera shows a diagonal ramp: one grey level more for each step right or down.
    let differing = mosaic.samples().windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(differing > 2048, "{differing}");

    let mut before = frame;
    for _ in 0..20 {
        let next = camera.next_frame(5 * SECOND).unwrap();
        assert!(before.number < next.number && before.exposed_at < next.exposed_at);
        before = next;
    }
    let health = camera.health();
    assert!(health.working && health.simulated, "{health:?}");
    assert!(health.message.starts_with("2048x1088 Mono16, packets of "), "{}", health.message);
}

#[test]
fn killed_in_mid_stream_it_is_found_again() {
    let Some(mut fake) = Fake::start(&[]) else { return };
    let mut camera = open("?format=Mono8&width=512&height=512&exposure=5000", 25.0).unwrap();
    let before = camera.next_frame(5 * SECOND).unwrap();
    let controls = camera.controls().unwrap();
    let exposed = |to: f64| {
        let offered = controls.offered().settings.into_iter().find(|one| one.setting == Setting::Exposure);
        offered.is_some_and(|exposure| (exposure.value - to).abs() < 0.5)
    };

    controls.ask(Setting::Exposure, 12_000.0).unwrap();
    until("the exposure is changed", || {
        let _ = camera.next_frame(Duration::from_millis(200));
        exposed(12_000.0)
    });

    fake.kill();
    until("the loss is noticed", || {
        let _ = camera.next_frame(Duration::from_millis(50));
        !camera.health().working
    });

    assert!(camera.health().message.ends_with("looking for it again"), "{}", camera.health().message);
    assert!(matches!(camera.next_frame(Duration::from_millis(50)), Err(CameraError::Failed(_))));
    fake.restart();
    let mut after = None;
    let found = until("a frame comes again", || {
        after = camera.next_frame(Duration::from_millis(50)).ok();
        after.is_some()
    });

    println!("found again after {found:?}");
    assert!(after.unwrap().number > before.number);
    assert!(camera.health().working);
    assert!(exposed(12_000.0), "what was changed before is changed again");
}

#[test]
fn frames_with_lost_packets_are_counted_and_skipped() {
    let Some(_fake) = Fake::start(&["-r", "2"]) else { return };
    let mut camera = open("?format=Mono8&width=512&height=512&packet=1400", 25.0).unwrap();
    let (frames, _) = watch(&mut camera, 3 * SECOND);
    let health = camera.health();
    println!("{} frames came, {} were lost", frames.len(), health.lost);
    let span = frames.last().unwrap().number - frames[0].number + 1;
    assert!(frames.len() > 5 && health.working, "{health:?}");
    assert!(health.lost > 0, "of 187 packets a frame, each lost with probability 0.002");
    assert!(span <= frames.len() as u64 + health.lost, "every gap is counted");
}

#[test]
fn frames_that_never_come_whole_are_reported_with_advice() {
    let Some(_fake) = Fake::start(&["-r", "500"]) else { return };
    let camera = open("?format=Mono8&width=512&height=512&packet=1400", 25.0).unwrap();
    until("it is told", || camera.health().message.contains("parts missing: larger packets"));
    assert!(camera.health().working, "it is there, and not looked for anew");
}

#[test]
fn exposure_gain_and_rate_can_be_changed_within_the_cameras_bounds() {
    let Some(_fake) = Fake::start(&[]) else { return };
    let mut camera = open("?width=512&height=512", 10.0).unwrap();
    camera.next_frame(5 * SECOND).unwrap();
    let controls = camera.controls().unwrap();
    let value = |controls: &Controls, setting| {
        controls.offered().settings.into_iter().find(|one| one.setting == setting).map(|one| one.value)
    };
    let mut change = |setting, to: f64| {
        controls.ask(setting, to).unwrap();
        until("the change is made", || {
            let _ = camera.next_frame(Duration::from_millis(200));
            value(&controls, setting).is_some_and(|value| (value - to).abs() < 0.5)
        });
    };

    change(Setting::Exposure, 12_000.0);
    change(Setting::FrameRate, 20.0);
    change(Setting::Gain, 6.0);
    assert!(controls.ask(Setting::Exposure, -1.0).is_err());
}

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    let Some(_fake) = Fake::start(&[]) else { return };
    assert!(
        refused("?format=Mono12").contains("does not offer Mono12; it offers BayerBG8"),
        "{}",
        refused("?format=Mono12")
    );

    assert!(refused("?format=RGB8").contains("choose from Mono10p"));
    assert!(refused("?width=30").contains("multiples of 4"), "{}", refused("?width=30"));
    let missing = GigeCamera::open("No-Such", settings(10.0)).err().unwrap().to_string();
    assert!(missing.contains("cameras that answer: gige:Aravis-Fake-TEST"), "{missing}");
    let listed = GigeCamera::open("list", settings(10.0)).err().unwrap().to_string();
    assert!(listed.starts_with("cameras that answer: gige:Aravis-Fake-TEST (Aravis Fake"), "{listed}");
}

async fn offered(server: &Server, setting: &str) -> Value {
    let offer: Value = server.get_as("operator", "/api/operator/camera").send().await.unwrap().json().await.unwrap();
    let settings = offer["settings"].as_array().unwrap();
    settings.iter().find(|one| one["setting"] == setting).cloned().unwrap_or_default()
}

#[tokio::test]
async fn the_operator_changes_them_through_the_server() {
    let Some(_fake) = Fake::start(&[]) else { return };
    let server = Server::with(&["--bind", "127.0.0.1:0", "--camera", "gige:Aravis-Fake-TEST?width=512&height=512"]);
    let change = async |setting: &str, value: f64| {
        let request =
            server.post_as("operator", "/api/operator/camera").json(&json!({"setting": setting, "value": value}));
        let response = request.send().await.unwrap();
        (response.status(), response.text().await.unwrap())
    };

    assert!(offered(&server, "exposure").await["max"].as_f64().unwrap() > 1000.0);
    assert_eq!(change("exposure", 12_000.0).await.0, StatusCode::NO_CONTENT);
    let begun = SystemClock.now();
    while (offered(&server, "exposure").await["value"].as_f64().unwrap() - 12_000.0).abs() > 0.5 {
        assert!(SystemClock.now().since(begun) < 30 * SECOND, "the change is never made");
    }
    let (status, said) = change("exposure", 1e12).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(said.contains("Exposure must be from"), "{said}");
}

#[tokio::test]
async fn a_server_starts_before_its_camera_and_finds_it() {
    let Some(mut fake) = Fake::start(&[]) else { return };
    fake.kill();
    let server = Server::with(&["--bind", "127.0.0.1:0", "--camera", "gige:Aravis-Fake-TEST?width=512&height=512"]);
    assert!(server.said.contains("THE CAMERA IS NOT THERE YET"), "{}", server.said);
    let health = async || server.get("/healthz").send().await.unwrap().json::<Value>().await.unwrap();
    let camera = async || {
        let checks = server.get_as("operator", "/api/operator/checks").send().await.unwrap();
        let checks: Value = checks.json().await.unwrap();
        let findings = checks["findings"].as_array().unwrap().clone();
        findings.into_iter().find(|finding| finding["subject"] == "camera").unwrap()
    };
    assert_eq!(camera().await["verdict"], "wrong");
    assert!(camera().await["found"].as_str().unwrap().contains("looking for it again"), "{}", camera().await);

    fake.restart();
    let begun = SystemClock.now();
    while health().await["status"] != "ok" {
        assert!(SystemClock.now().since(begun) < 30 * SECOND, "it is never found: {}", health().await);
    }
    assert!(camera().await["found"].as_str().unwrap().contains("512x512"), "{}", camera().await);
}

/// Runs `parfocal calibrate` with the fake camera. Returns whether it succeeded, and its error output.
fn calibrate(which: &str, options: &str, out: &std::path::Path) -> (bool, String) {
    let camera = format!("gige:Aravis-Fake-TEST?width=512&height=512{options}");
    let output = Command::new(env!("CARGO_BIN_EXE_parfocal"))
        .args(["calibrate", which, "--camera", &camera, "--frames", "4", "--out"])
        .arg(out)
        .output()
        .unwrap();
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn references_are_taken_or_refused() {
    let Some(_fake) = Fake::start(&[]) else { return };
    let folder = tempfile::tempdir().unwrap();
    // The camera's diagonal ramp gets darker with a shorter exposure, and is never even.
    let (taken, said) = calibrate("dark", "&exposure=10000", folder.path());
    assert!(!taken && said.contains("this is not dark"), "{said}");
    let (taken, said) = calibrate("dark", "&exposure=100", folder.path());
    assert!(taken, "{said}");
    assert!(folder.path().join("dark-1.tiff").exists());
    let (taken, said) = calibrate("white", "&exposure=10000", folder.path());
    assert!(!taken && said.contains("uneven"), "{said}");
}

/// Streams the paper's size and rate for `time`; less than 1 % of the frames may be lost.
fn hardly_a_frame_is_lost_in(time: Duration) {
    let Some(_fake) = Fake::start(&[]) else { return };
    let mut camera = open("?format=Mono16&packet=16000", 25.0).unwrap();
    camera.next_frame(5 * SECOND).unwrap();
    let before = camera.health().lost;
    let (frames, timeouts) = watch(&mut camera, time);
    let lost = camera.health().lost - before;
    println!("{} frames in {time:?}, {lost} lost, {timeouts} timeouts: {}", frames.len(), camera.health().message);
    let due = usize::try_from(25 * time.as_secs()).unwrap();
    // The fake camera's own rate is a little below the requested one.
    assert!(frames.len() * 10 > due * 9, "{} of {due} frames came", frames.len());
    assert!(usize::try_from(lost).unwrap() * 100 < due, "{lost} of {due} frames were lost");
}

/// Run with `cargo test --features aravis --test system network_camera:: -- --ignored --nocapture`.
#[test]
#[ignore = "takes a minute"]
fn mono16_at_25_fps_loses_hardly_a_frame_in_a_minute() {
    hardly_a_frame_is_lost_in(60 * SECOND);
}
