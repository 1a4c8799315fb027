//! Recordings by the server: started with the operator's button, or because a protocol requests them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_recording::{Ended, Recording, ViewRecording, ViewRow};
use reqwest::{Method, StatusCode};
use rustix::process::Signal;
use serde_json::{Value, json};

use super::live::{Heard, Page};
use crate::support::disk::SmallDisk;
use crate::support::{BRAIN, Server};

const PATH: &str = "/api/operator/recording";

pub fn start(data: Arc<tempfile::TempDir>) -> Server {
    let protocols = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/system/http");
    Server::on(data, &["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "10", "--protocols", protocols])
}

pub async fn post(server: &Server, path: &str, body: Value) -> (StatusCode, Value) {
    let (status, said) = server.ask("operator", Method::POST, path, &body).await;
    (status, serde_json::from_str(&said).unwrap_or_default())
}

pub async fn order(server: &Server, record: bool) -> (StatusCode, Value) {
    post(server, PATH, json!({ "record": record })).await
}

/// Polls the state of recording until it is `wanted`. Fails after a minute.
pub async fn until(server: &Server, wanted: impl Fn(&Value) -> bool) -> Value {
    let limit = SystemClock.now() + Duration::from_mins(1);
    loop {
        let status = server.read(PATH).await;
        if wanted(&status) {
            return status;
        }
        assert!(SystemClock.now() < limit, "{status}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Makes and starts a session by `protocol`. Returns its id.
pub async fn begin(server: &Server, protocol: &str) -> String {
    let session = server.prepare("S-05", protocol).await;
    server.post("/api/operator/actions", json!({"session": session, "action": "start"})).await;
    session
}

pub async fn abort(server: &Server, session: &str) {
    let action = json!({"session": session, "action": "abort", "reason": "the test is over"});
    server.post("/api/operator/actions", action).await;
}

pub fn recordings(server: &Server) -> PathBuf {
    server.data.path().join("recordings")
}

#[tokio::test]
async fn the_operator_records_and_reads_before_how_long_the_disk_lasts() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let before = until(&server, |status| status["seconds_left"].is_number()).await;
    let rate = before["bytes_per_second"].as_f64().unwrap();
    let room = before["free_bytes"].as_f64().unwrap() - before["reserve_bytes"].as_f64().unwrap();
    assert!((before["seconds_left"].as_f64().unwrap() / (room / rate) - 1.0).abs() < 0.01, "{before}");
    // Ten frames per second of 2048 x 1088 samples, at more than a twentieth and less than all of packed 10 bit.
    let packed = 10.0 * 2048.0 * 1088.0 * 1.25;
    assert!((0.05 * packed..packed).contains(&rate), "{rate}");

    let (status, said) = order(&server, true).await;
    assert_eq!((status, &said["recording"], &said["by_protocol"]), (StatusCode::OK, &"mosaic".into(), &false.into()));
    assert_eq!(order(&server, true).await.0, StatusCode::CONFLICT, "one at a time");
    let running = until(&server, |status| status["frames"].as_u64() >= Some(5)).await;

    let (status, said) = order(&server, false).await;
    assert_eq!((status, &said["recording"]), (StatusCode::OK, &Value::Null));
    assert!(said["notice"].as_str().unwrap().contains("frames are saved in"), "{said}");
    assert_eq!(order(&server, false).await.0, StatusCode::OK, "stopping again changes nothing");

    let recording = Recording::open(&recordings(&server).join(running["folder"].as_str().unwrap())).unwrap();
    assert!(recording.rows().len() >= 5 && recording.check().is_empty());
    assert_eq!((&recording.header().session, &recording.header().ended), (&None, &Some(Ended::Stopped)));
    assert!(recording.calibration().join("calibration.toml").exists());
}

#[tokio::test]
async fn only_the_operator_may_see_or_order_recordings() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    for role in ["surgeon", "researcher"] {
        let seen = server.get_as(role, PATH).send().await.unwrap().status();
        let ordered = server.post_as(role, PATH).json(&json!({"record": true})).send().await.unwrap().status();
        assert_eq!((seen, ordered), (StatusCode::FORBIDDEN, StatusCode::FORBIDDEN), "{role}");
    }
    assert!(!recordings(&server).exists());
}

#[tokio::test]
async fn a_protocol_records_mosaics_from_a_sessions_start_to_its_end() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "recorded").await;
    let running = until(&server, |status| status["frames"].as_u64() >= Some(5)).await;
    assert_eq!((&running["recording"], &running["by_protocol"]), (&"mosaic".into(), &true.into()));
    assert_eq!(running["folder"], session.as_str());

    // The surgeon's view does not mention it.
    let view = server.get_as("surgeon", "/api/surgeon/session").send().await.unwrap().text().await.unwrap();
    assert!(!view.contains("record\"") && !view.contains("mosaic"), "{view}");

    abort(&server, &session).await;
    until(&server, |status| status["recording"].is_null() && status["notice"].is_string()).await;
    let recording = Recording::open(&recordings(&server).join(&session)).unwrap();
    assert_eq!(recording.header().session.as_deref(), Some(session.as_str()));
    assert!(recording.rows().len() >= 5 && recording.check().is_empty());
    assert!(recording.rows().iter().all(|row| (0.0..=1.0).contains(&row.measured)));
}

/// Somebody who may play the session's recording must not see a later session in it, whose policies are still secret.
#[tokio::test]
async fn what_the_operator_records_during_a_session_ends_with_it() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "practice").await;
    assert_eq!(order(&server, true).await.0, StatusCode::OK);
    let running = until(&server, |status| status["frames"].as_u64() >= Some(5)).await;
    assert_eq!(running["by_protocol"], false);

    abort(&server, &session).await;
    until(&server, |status| status["recording"].is_null() && status["notice"].is_string()).await;
    let recording = Recording::open(&recordings(&server).join(running["folder"].as_str().unwrap())).unwrap();
    assert_eq!(recording.header().session.as_deref(), Some(session.as_str()));
    assert_eq!(recording.header().ended, Some(Ended::Stopped));
}

#[tokio::test]
async fn a_recording_that_is_ending_as_the_server_ends_is_stored_to_its_end() {
    let mut server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "recorded").await;
    until(&server, |status| status["frames"].as_u64() >= Some(3)).await;
    abort(&server, &session).await;
    assert!(server.end(Signal::TERM));

    let recording = Recording::open(&recordings(&server).join(&session)).unwrap();
    assert_eq!(recording.header().ended, Some(Ended::Stopped));
    assert!(recording.rows().len() >= 3 && recording.check().is_empty());
}

#[tokio::test]
async fn a_protocol_keeps_the_view_as_it_was_sent() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "viewed").await;
    until(&server, |status| status["recording"] == "view" && status["frames"].as_u64() >= Some(3)).await;
    abort(&server, &session).await;
    until(&server, |status| status["recording"].is_null() && status["notice"].is_string()).await;

    let folder = recordings(&server).join(&session);
    let pictures = std::fs::read(folder.join("view.mjpeg")).unwrap();
    let mut lines = csv::Reader::from_path(folder.join("view.csv")).unwrap();
    let columns = vec!["frame_number", "time_ns", "offset", "length", "width", "height"];
    assert_eq!(lines.headers().unwrap(), columns, "no focal power");

    let mut end = 0;
    let mut last = (0, 0);
    for line in lines.deserialize() {
        let (number, time, offset, length, width, height): (u64, u64, usize, usize, u32, u32) = line.unwrap();
        assert!((number, time) > last && offset == end, "{number} {time} {offset}");
        let picture = image::load_from_memory(&pictures[offset..offset + length]).unwrap();
        // Nobody watches, so it has the size at which every frame is made.
        assert_eq!((picture.width(), picture.height()), (512, 272));
        assert_eq!((width, height), (512, 272));
        last = (number, time);
        end = offset + length;
    }
    assert!(end == pictures.len() && end > 0);

    let header: Value = serde_json::from_slice(&std::fs::read(folder.join("view.json")).unwrap()).unwrap();
    assert_eq!((&header["session"], &header["ended"]["why"]), (&session.into(), &"stopped".into()));
}

/// Acknowledges frames on `page` until the recording of the view in `folder` has a picture that is `wanted`.
async fn until_viewed(page: &mut Page, folder: &Path, wanted: impl Fn(&ViewRow) -> bool) -> ViewRow {
    let limit = SystemClock.now() + Duration::from_mins(1);
    loop {
        let rows = ViewRecording::open(folder).map(|view| view.rows().to_vec()).unwrap_or_default();
        if let Some(row) = rows.iter().rev().find(|row| wanted(row)) {
            return *row;
        }
        assert!(SystemClock.now() < limit, "{:?}", rows.last());
        page.watch(1).await;
    }
}

#[tokio::test]
async fn the_view_is_kept_at_the_size_that_the_surgeons_page_gets() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "viewed").await;
    let folder = recordings(&server).join(&session);
    let mut surgeon = Page::open(&server, "surgeon").await;

    surgeon.say(json!({"type": "screen", "width": 1200})).await;
    let kept = until_viewed(&mut surgeon, &folder, |row| row.width == 1024).await;
    assert_eq!(kept.height, 544);

    // Nobody else changes the recorded size, although the operator's screen is larger.
    let mut operator = Page::open(&server, "operator").await;
    operator.say(json!({"type": "screen", "width": 4000})).await;
    // Both look on all the while: who reads nothing is taken to be gone.
    let full = loop {
        surgeon.watch(1).await;
        let frame = operator.watch_until(|_| true).await;
        if frame.header["per_cell"] == 4 {
            break frame;
        }
    };
    until_viewed(&mut surgeon, &folder, |row| row.number >= full.number()).await;

    surgeon.say(json!({"type": "screen", "width": 400})).await;
    let small = surgeon.watch_until(|header| header["per_cell"] == 1).await;
    until_viewed(&mut surgeon, &folder, |row| row.number > small.number() && row.width == 512).await;

    abort(&server, &session).await;
    until(&server, |status| status["recording"].is_null() && status["notice"].is_string()).await;
    let view = ViewRecording::open(&folder).unwrap();
    assert!(view.check().is_empty());
    for (number, row) in view.rows().iter().enumerate() {
        let picture = image::load_from_memory(&view.picture(number).unwrap()).unwrap();
        assert_eq!((picture.width(), picture.height()), (row.width, row.height), "picture {number}");
    }
    assert!(view.rows().windows(2).all(|pair| pair[0].number < pair[1].number), "every frame once");
    assert!(view.rows().iter().all(|row| row.width < 2048), "never the operator's size");

    // The recording keeps what the surgeon's page got of a frame. While the size changes, which can also happen by
    // itself on a busy machine, two frames may be kept at the size before or after.
    let width = |value: &Value| value.as_u64().and_then(|width| u32::try_from(width).ok());
    let sent = surgeon.heard.iter().filter_map(|heard| match heard {
        Heard::Frame(header) => Some((header["frame"].as_u64()?, width(&header["width"]))),
        Heard::Text(_) => None,
    });
    let sent: Vec<_> = sent.collect();
    let changes = sent.windows(2).filter(|pair| pair[0].1 != pair[1].1).count();
    let kept: BTreeMap<u64, Option<u32>> = view.rows().iter().map(|row| (row.number, Some(row.width))).collect();
    let differ = sent.iter().filter(|(number, width)| kept.get(number).is_some_and(|kept| kept != width)).count();
    assert!(changes >= 2 && differ <= 2 * changes, "{differ} differ, {changes} changes: {sent:?} {kept:?}");
}

#[tokio::test]
async fn after_a_restart_in_mid_session_a_second_recording_continues() {
    let mut server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "recorded").await;
    until(&server, |status| status["frames"].as_u64() >= Some(30)).await;
    server.end(Signal::KILL);

    let server = start(Arc::clone(&server.data));
    let again = until(&server, |status| status["frames"].as_u64() >= Some(5)).await;
    assert_eq!((&again["folder"], &again["by_protocol"]), (&format!("{session}-2").into(), &true.into()));
    abort(&server, &session).await;
    until(&server, |status| status["recording"].is_null() && status["notice"].is_string()).await;

    let opened = |name: &str| Recording::open(&recordings(&server).join(name)).unwrap();
    let first = opened(&session);
    assert!(first.rows().len() >= 25 && first.check().is_empty());
    assert_eq!((&first.header().ended, first.header().run), (&None, Some(1)));

    let second = opened(&format!("{session}-2"));
    assert!(second.rows().len() >= 5 && second.check().is_empty());
    assert_eq!((&second.header().ended, second.header().run), (&Some(Ended::Stopped), Some(2)));
    assert_eq!(second.header().session.as_deref(), Some(session.as_str()));
}

#[tokio::test]
async fn the_operator_may_stop_a_protocols_recording_and_the_session_continues() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "recorded").await;
    until(&server, |status| status["frames"].as_u64() >= Some(5)).await;
    let (status, said) = order(&server, false).await;
    assert_eq!((status, &said["recording"]), (StatusCode::OK, &Value::Null));
    assert_eq!(said["notice_warns"], false, "it ended as it was meant to: {said}");

    // Recording is checked every second: by now a recording that starts again would have started.
    let view = server.read("/api/operator/session").await;
    assert_eq!((&view["phase"], &view["session"]), (&"notice".into(), &session.clone().into()));
    let acknowledge = json!({"session": session, "action": "acknowledge", "segment": view["segment"]});
    // The trial goes on.
    server.post("/api/surgeon/actions", acknowledge).await;
    abort(&server, &session).await;
    until(&server, |status| status["recording"].is_null() && status["seconds_left"].is_number()).await;

    let mut folders = std::fs::read_dir(recordings(&server)).unwrap();
    let recording = Recording::open(&folders.next().unwrap().unwrap().path()).unwrap();
    assert!(recording.rows().len() >= 5 && recording.check().is_empty());
    assert_eq!(recording.header().ended, Some(Ended::Stopped));
    assert!(folders.next().is_none(), "it did not begin anew");
}

#[tokio::test]
async fn on_a_nearly_full_disk_recording_stops_by_itself_and_the_trial_continues() {
    // Large enough that the twentieth that recording leaves free holds everything that the database writes until then.
    let Some(disk) = SmallDisk::of_megabytes(100) else { return };
    let server = start(Arc::clone(&disk.folder));
    let session = begin(&server, "recorded").await;
    let ended = until(&server, |status| status["recording"].is_null() && status["notice"].is_string()).await;
    let notice = ended["notice"].as_str().unwrap();
    assert!(notice.contains("nearly full; the trial goes on"), "{notice}");
    assert_eq!(ended["notice_warns"], true);

    let comment =
        json!({"key": "00000000-0000-4000-8000-000000000001", "session": session, "kind": "text", "text": "sharp"});
    server.post("/api/surgeon/comments", comment).await;
    let view = server.read("/api/operator/session").await;
    assert_eq!(view["phase"], "notice");
}

#[tokio::test]
async fn a_camera_of_colour_pictures_cannot_be_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let still = folder.path().join("still.png");
    image::GrayImage::from_pixel(640, 480, image::Luma([90])).save(&still).unwrap();
    let camera = format!("footage:{}", still.display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10", "--camera", &camera]);

    let status = server.read(PATH).await;
    assert!(status["unavailable"].as_str().unwrap().contains("colour pictures"));
    let (refused, said) = order(&server, true).await;
    assert_eq!(refused, StatusCode::CONFLICT, "{said}");
}
