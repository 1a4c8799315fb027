//! The researcher plays a session's recording: in step with its timeline, from a comment, frame by frame.

use serde_json::{Value, json};

use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use super::theatre::Theatre;
use super::wait::until;

const SCRUB: &str = "#player-scrub";

/// Presses a key on the page, wherever its focus is.
pub async fn press(page: &Browser, key: &str) {
    for kind in ["keyDown", "keyUp"] {
        let text = if key == " " && kind == "keyDown" { " " } else { "" };
        page.tools("Input.dispatchKeyEvent", json!({"type": kind, "key": key, "text": text})).await;
    }
}

/// Clicks at a point of the page, which must be visible.
async fn tap(page: &Browser, x: f64, y: f64) {
    for kind in ["mousePressed", "mouseReleased"] {
        let click = json!({"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1});
        page.tools("Input.dispatchMouseEvent", click).await;
    }
}

/// Position of the playhead, in seconds of the timeline.
async fn playhead(page: &Browser) -> f64 {
    page.value(SCRUB).await.parse().unwrap()
}

/// Number of the drawn frame, counted over all recordings; -1 before the first is drawn.
pub async fn drawn(page: &Browser) -> i64 {
    let frame = page.attribute("#player-picture", "data-frame").await;
    frame.and_then(|frame| frame.parse().ok()).unwrap_or(-1)
}

pub async fn until_drawn(page: &Browser, frame: i64) {
    until(&format!("frame {frame} to be drawn"), || async { drawn(page).await == frame }).await;
}

/// Width of the picture on the page, and its mean brightness from 0 to 255.
async fn picture(page: &Browser) -> (u64, f64) {
    let look = "const canvas = document.getElementById('player-picture');
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        return [canvas.width, data.reduce((sum, value, index) => sum + (index % 4 < 3 ? value : 0), 0)
            / (0.75 * data.length)];";
    let found = page.run(look, &[]).await;
    (found[0].as_u64().unwrap(), found[1].as_f64().unwrap())
}

/// Horizontal position of the playhead's line in the drawing `css`.
async fn line(page: &Browser, css: &str) -> f64 {
    page.attribute(&format!("{css} .playhead"), "x1").await.unwrap().parse().unwrap()
}

/// Runs and completes a recorded session of two settings with a comment in each.
async fn session(theatre: &Theatre) {
    theatre.begin("S-08", "filmed").await;
    for (setting, comment) in [(1, "Sharp where I look"), (2, "It wanders")] {
        theatre.tap_notice(setting).await;
        // Long enough that three seconds before the comment are in its own setting.
        let before = recorded_seconds(&theatre.operator.text("#recording-now").await);
        until("some seconds of recording", || async {
            recorded_seconds(&theatre.operator.text("#recording-now").await) >= before + 5.0
        })
        .await;
        theatre.say(comment, setting).await;
        theatre.finish().await;
    }
    theatre.operator.sees("#phase", "Completed").await;
    theatre.operator.sees("#recording-notice", "frames are saved in").await;
}

/// The seconds in `Recording mosaics, as the protocol asks: 12 s, 120 frames, 190 MB.`
fn recorded_seconds(said: &str) -> f64 {
    let length = said.split(": ").nth(1).and_then(|rest| rest.split(" s,").next());
    length.and_then(|seconds| seconds.parse().ok()).unwrap_or(0.0)
}

async fn open_session(theatre: &Theatre) {
    let page = &theatre.operator;
    page.open(&theatre.server.link("researcher")).await;
    page.click("td a.button").await;
    page.sees("#comment-list", "It wanders").await;
}

pub async fn unblind(page: &Browser) {
    page.click("#unblind").await;
    page.type_into("#reason", "Analysis begins").await;
    page.sees("#reason-confirm", "Unblind anyway").await;
    page.click("#reason-confirmed").await;
    page.click("#reason-go").await;
    page.sees(".unblinded", "mgm-hill-climber").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_researcher_plays_a_recording_with_its_timeline_and_comments() {
    let driver = Driver::start();
    let theatre = Theatre::seeing(&driver).await;
    session(&theatre).await;
    let page = &theatre.operator;

    open_session(&theatre).await;
    until("the timeline", || async { page.count("#timeline .segment").await == 2 }).await;
    assert_eq!(page.count("#player").await, 0, "a blinded session shows no more than before");
    assert!(page.is("#metric", "hidden").await && page.is("#comments-play", "hidden").await);
    assert_eq!(page.count("#timeline .recorded").await, 0);
    page.click("#show-path").await;
    until("the focal path", || async {
        page.attribute("#timeline .path", "d").await.is_some_and(|path| path.len() > 100)
    })
    .await;
    assert!(page.is("#metric", "hidden").await, "the path comes without the metric");

    unblind(page).await;
    until_drawn(page, 0).await;
    let (width, brightness) = picture(page).await;
    assert!(width == 512 && brightness > 10.0, "{width} {brightness}");
    page.sees("#player-values", "Focal power").await;
    assert!(page.attribute("#metric .metric", "d").await.unwrap().len() > 100);
    assert!(page.count("#timeline .recorded").await >= 1);

    // Frame by frame, by the buttons and by the keyboard.
    page.click("#player-forward").await;
    until_drawn(page, 1).await;
    press(page, "ArrowRight").await;
    until_drawn(page, 2).await;
    press(page, "ArrowLeft").await;
    until_drawn(page, 1).await;

    // It plays at most at the recording's pace, and the lines on the drawings move with it.
    let from = playhead(page).await;
    let before = line(page, "#timeline").await;
    page.click("#player-play").await;
    until("playback to come on", || async { drawn(page).await >= 10 }).await;
    press(page, " ").await;
    // The button still has the focus, so it takes the space key.
    page.sees("#player-play", "Play").await;
    assert!(playhead(page).await > from);
    assert!(line(page, "#timeline").await > before);
    assert!((line(page, "#timeline").await - line(page, "#metric").await).abs() < 0.2);

    // Playing starts three seconds before a comment.
    let comments = comment_seconds(page).await;
    // Both clicks in one script, because a recording that has ended starts again.
    let play_and_pause = "document.querySelector('#comment-list li:last-child button').click();
        const button = document.querySelector('#player-play');
        const offered = button.textContent;
        button.click();
        return offered;";
    assert_eq!(page.run(play_and_pause, &[]).await, "Pause", "it plays");
    page.sees("#timeline figcaption", "It wanders").await;
    let at = playhead(page).await;
    let expected = comments[1] - 3.0;
    assert!(at >= expected - 0.01 && at < comments[1] + 3.0, "{at} after {expected}");
    page.run("document.activeElement.blur()", &[]).await;
    page.sees("#player-values", "2, ").await;
    page.to_top().await;
    shoot(page, "researcher-6-playback").await;

    // Taps near the left end of the drawing, then asks for finer pictures.
    let there = page.area("#timeline").await;
    tap(page, there.left + 200.0, there.top + 230.0).await;
    until("the playhead to be there", || async { playhead(page).await < expected }).await;
    page.sees("#player-values", "1, ").await;
    page.select("#player-size", "half").await;
    until("a fine picture", || async { picture(page).await.0 == 1024 }).await;

    assert_eq!(page.complaints().await.iter().find(|text| text.contains("Uncaught")), None);

    // The recording is moved away.
    let recordings = theatre.server.data.path().join("recordings");
    std::fs::rename(&recordings, theatre.server.data.path().join("moved")).unwrap();
    page.reload().await;
    page.sees("#recording-problems", "It was moved or removed").await;
    until("the timeline all the same", || async {
        page.attribute("#timeline .path", "d").await.is_some_and(|path| path.len() > 100)
    })
    .await;
    page.sees_no("#player").await;
    page.to_top().await;
    shoot(page, "researcher-7-recording-gone").await;
}

/// When the comments were said according to the server, in seconds of the timeline.
async fn comment_seconds(page: &Browser) -> Vec<f64> {
    let session = page.attribute("#session", "data-session").await.unwrap();
    let ask = "return fetch(arguments[0]).then((answer) => answer.json())";
    let path = format!("/api/researcher/sessions/{session}/course");
    let course: Value = page.run(ask, &[json!(path)]).await;
    let comments = course["comments"].as_array().unwrap();
    comments.iter().map(|comment| comment["seconds"].as_f64().unwrap()).collect()
}
