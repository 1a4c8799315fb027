//! Each viewer gets pictures of the size that its screen and link can use. A size is made only while someone watches
//! it.

#[path = "../../../benches/stream/link.rs"]
mod link;

use std::fs;
use std::process::Command;
use std::time::Duration;

use serde_json::json;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;

use super::live::Page;
use crate::support::{BRAIN, DARK, Server};

/// Few frames, because the camera shares the machine with other tests.
fn server() -> Server {
    Server::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "10"])
}

/// The value of the counter or gauge `name` for pictures of size `size`.
async fn count(server: &Server, name: &str, size: &str) -> u64 {
    let text = server.get_as("operator", "/metrics").send().await.unwrap().text().await.unwrap();
    let start = format!("parfocal_{name}{{size=\"{size}\"}} ");
    let value = text.lines().find_map(|line| line.strip_prefix(&start)?.parse().ok());
    value.unwrap_or_else(|| panic!("{start} in {text}"))
}

#[tokio::test]
async fn a_size_is_made_only_while_someone_looks_at_it() {
    let server = server();
    let mut page = Page::open(&server, "surgeon").await;
    page.watch(10).await;
    for larger in ["half", "full"] {
        assert_eq!(count(&server, "frames_encoded_total", larger).await, 0);
    }

    page.say(json!({"type": "screen", "width": 2360})).await;
    page.watch_until(|header| header["per_cell"] == 4).await;

    page.say(json!({"type": "screen", "width": 500})).await;
    page.watch_until(|header| header["per_cell"] == 1).await;
    assert_eq!(count(&server, "viewers", "full").await, 0);

    // One picture is being made, however long the machine takes. Then no more are made.
    let mut made = u64::MAX;
    let mut looks = 0;
    while count(&server, "frames_encoded_total", "full").await != made {
        looks += 1;
        assert!(looks < 10, "pictures at full size are still made");
        made = count(&server, "frames_encoded_total", "full").await;
        page.watch(10).await;
    }
}

#[tokio::test]
async fn a_size_is_made_once_for_all_who_look_at_it() {
    let server = server();
    let mut pages = [Page::open(&server, "surgeon").await, Page::open(&server, "operator").await];
    for page in &mut pages {
        page.say(json!({"type": "screen", "width": 1200})).await;
        page.watch_until(|header| header["per_cell"] == 2).await;
    }

    let before = count(&server, "frames_encoded_total", "half").await;
    let [surgeon, operator] = &mut pages;
    let first = surgeon.frame().await;
    surgeon.drawn(&first).await;
    let (seen, _) = tokio::join!(
        surgeon.watch_until(|header| header["frame"].as_u64() >= Some(first.number() + 20)),
        operator.watch_until(|header| header["frame"].as_u64() >= Some(first.number() + 20))
    );
    let made = count(&server, "frames_encoded_total", "half").await - before;
    assert!(made <= seen.number() - first.number() + 6, "{made} pictures of {} frames", seen.number() - first.number());
}

#[tokio::test]
async fn a_larger_picture_tells_the_same_places_and_never_an_older_frame() {
    let server = server();
    let mut page = Page::open(&server, "surgeon").await;
    let small = page.watch_until(|header| !header["area"].is_null()).await;
    page.say(json!({"type": "screen", "width": 4000})).await;
    let mut last = small.number();
    let large = loop {
        let frame = page.frame().await;
        page.drawn(&frame).await;
        assert!(frame.number() > last, "{} after {last}", frame.number());
        last = frame.number();
        if frame.header["per_cell"] == 4 {
            break frame;
        }
    };

    let picture = image::load_from_memory_with_format(&large.jpeg, image::ImageFormat::Jpeg).unwrap();
    assert_eq!((picture.width(), picture.height()), (2048, 1088));
    assert_eq!((&large.header["width"], &large.header["height"]), (&json!(2048), &json!(1088)));
    assert_eq!(large.header["patch"], small.header["patch"]);
    let radius = |header: &serde_json::Value| header["area"]["radius"].as_f64().unwrap();
    assert!((radius(&large.header) - radius(&small.header)).abs() < 8.0, "both in cells");
}

#[tokio::test]
async fn a_slow_link_keeps_the_small_pictures_that_it_carries() {
    let server = server();
    let address = link::slow(server.address, 400_000).await;
    let mut slow = Page::through(address, &server, "surgeon").await;
    slow.say(json!({"type": "screen", "width": 4000})).await;
    for _ in 0..20 {
        let frame = slow.frame().await;
        slow.drawn(&frame).await;
        assert_eq!(frame.header["per_cell"], 1);
    }
}

/// The camera plays a recording, whose frames are away for a while.
#[tokio::test]
async fn a_camera_that_was_away_is_not_taken_for_a_slow_link() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording");
    let mut record = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    record.args(["recording", "record", "--camera", DARK, "--fps", "10", "--seconds", "0.5", "--out"]);
    assert!(record.arg(&recording).output().unwrap().status.success());

    let camera = format!("recording:{}", recording.display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--camera", &camera, "--fps", "10"]);
    let mut page = Page::open(&server, "surgeon").await;
    page.say(json!({"type": "screen", "width": 1000})).await;
    page.watch_until(|header| header["per_cell"] == 2).await;

    let frames = recording.join("mosaic/c/0/0/0");
    let away = folder.path().join("frames");
    fs::rename(&frames, &away).unwrap();
    page.until(|told| told["notice"] == "camera-failed").await;
    // Beats are five seconds apart, more than twice as long as a page waits for a picture.
    page.until(|told| told["type"] == "beat").await;
    page.until(|told| told["type"] == "beat").await;

    fs::rename(&away, &frames).unwrap();
    let frame = page.frame().await;
    assert_eq!((&frame.header["per_cell"], &frame.header["reduced"]), (&json!(2), &json!(false)));
}

/// At 1 Mbit/s, 300 ms away there and back, one picture under way at a time gives two or three a second, and half of
/// the link is idle.
#[tokio::test]
async fn a_distant_page_gets_what_its_link_carries_and_is_told_how_long_the_way_takes() {
    const WAY: Duration = Duration::from_millis(150);
    const BITS: u64 = 1_000_000;
    let server = server();
    let address = link::distant(server.address, BITS, WAY).await;
    let mut page = Page::through(address, &server, "surgeon").await;
    page.watch(25).await;

    let begin = tokio::time::Instant::now();
    let mut bytes = 0;
    let mut travels = Vec::new();
    for _ in 0..25 {
        let frame = page.frame().await;
        page.drawn(&frame).await;
        bytes += frame.jpeg.len();
        travels.push(frame.header["travel"].as_f64().unwrap());
        assert_eq!(frame.header["reduced"], false, "the page has not said that it wants more");
    }
    let seconds = begin.elapsed().as_secs_f64();
    let picture = Duration::from_secs_f64(bytes as f64 / 25.0 * 8.0 / BITS as f64);
    let alone = 1.0 / (2 * WAY + picture).as_secs_f64();
    let rate = 25.0 / seconds;
    println!("{rate:.1} pictures a second of {picture:?} each; one at a time {alone:.1}; told {travels:?} ms");
    assert!(rate > 1.4 * alone, "{rate} pictures a second, {alone} with one under way");

    // Half of the round trip, the picture itself, and at most as much again where pictures queue.
    travels.sort_by(f64::total_cmp);
    let told = travels[12];
    let way = (WAY + picture).as_secs_f64() * 1e3;
    assert!((0.8 * way..1.2 * way + picture.as_secs_f64() * 1e3).contains(&told), "{told} ms told of {way} ms");
}

#[tokio::test]
async fn a_page_that_lies_about_its_screen_gets_the_largest_or_smallest_size_and_nonsense_a_reason() {
    let server = server();
    let mut page = Page::open(&server, "surgeon").await;
    page.say(json!({"type": "screen", "width": u32::MAX})).await;
    page.watch_until(|header| header["per_cell"] == 4).await;
    page.say(json!({"type": "screen", "width": 0})).await;
    page.watch_until(|header| header["per_cell"] == 1).await;

    page.say(json!({"type": "screen", "width": -1})).await;
    loop {
        match page.message().await {
            Message::Close(Some(close)) => break assert_eq!(close.code, CloseCode::Policy),
            Message::Close(None) => panic!("no reason"),
            _ => {}
        }
    }
}
