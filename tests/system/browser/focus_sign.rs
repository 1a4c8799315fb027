//! What the operator's page says of the focus outside sessions: whether it is held, where else the picture is in focus,
//! and whether the patch follows the tissue.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::accessible;
use super::driver::{Browser, Driver};
use super::screenshots::{resize, shoot};
use super::theatre::{Theatre, operator};
use super::wait::until;
use crate::support::{BRAIN, Server};

/// The sign's words.
const WORDS: [&str; 3] = ["Nothing to tell the focus by", "Searching for the focus", "In focus"];

/// The name of the state whose shape is shown, and how many shapes are.
async fn shape(operator: &Browser) -> String {
    let script = "const shown = [...document.querySelectorAll('.lock-sign > *')]
        .filter((part) => getComputedStyle(part).display !== 'none');
        return [...new Set(shown.map((part) => part.getAttribute('class')))].join();";
    operator.run(script, &[]).await.as_str().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_operator_sees_whether_the_focus_is_held_by_shape_colour_and_words() {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let order = folder.path().join("order");
    fs::write(&order, "").unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/system/browser/believer.py");
    let policy = format!("exec:python3 -s {} {}", script.display(), order.display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "10", "--policy", &policy]);
    let operator = operator(&driver, &server).await;

    // By hand nothing drives the lens.
    operator.sees("#lock", WORDS[0]).await;
    operator.select("#policy", &policy).await;

    let mut colours = Vec::new();
    for (place, state, words) in [
        ("0.9", "searching", WORDS[1]),
        ("0.5", "held", WORDS[2]),
        ("", "nothing", WORDS[0]),
        ("0.5", "held", WORDS[2]),
    ] {
        fs::write(&order, place).unwrap();
        operator.sees("#lock", words).await;
        assert_eq!(shape(&operator).await, state);
        colours.push(operator.style(".lock-sign", "color").await);
        shoot(&operator, &format!("lock-{state}")).await;
    }
    colours.pop();
    colours.sort();
    colours.dedup();
    assert_eq!(colours.len(), 3, "a colour each: {colours:?}");
    assert_eq!(operator.attribute("#lock", "role").await.as_deref(), Some("status"), "which is read aloud, politely");

    // The policy that ships holds the phantom in focus.
    operator.select("#policy", "parfocal").await;
    operator.sees("#lock", WORDS[2]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_sees_it_in_a_session() {
    let driver = Driver::start();
    let theatre = Theatre::seeing(&driver).await;
    theatre.operator.sees("#lock", WORDS[0]).await;
    theatre.operator.sees("#follow-choice", "Follow the tissue").await;
    theatre.operator.click("#depths").await;
    theatre.operator.sees("#depths-key", "Disc: in focus.").await;
    theatre.begin("P-04", "pointing").await;
    theatre.tap_notice(1).await;
    theatre.operator.sees_no("#lock").await;
    theatre.operator.sees_no("#follow-choice").await;
    theatre.operator.sees_no("#depths-choice").await;
    theatre.operator.sees_no("#depths-key").await;
    assert_eq!(theatre.operator.text("#lock-words").await, "");
    assert_eq!(theatre.surgeon.count(".lock, #lock, #follow-tissue").await, 0);
    shoot(&theatre.operator, "lock-none-in-a-session").await;
}

/// The green of a place in focus.
const IN_FOCUS: [u8; 3] = [125, 255, 155];
/// The pink of a place that would be in focus at a lower focal power.
const LOWER: [u8; 3] = [255, 157, 225];

/// How many pixels over the picture have the colour `colour`.
async fn coloured(operator: &Browser, colour: [u8; 3]) -> u64 {
    let script = "const canvas = document.querySelector('.viewer-overlay');
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        let count = 0;
        for (let at = 0; at < data.length; at += 4) {
            if ([...arguments[0], 255].every((value, part) => data[at + part] === value)) count += 1;
        }
        return count;";
    operator.run(script, &[json!(colour)]).await.as_u64().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_depth_map_marks_the_places_that_are_in_focus() {
    let driver = Driver::start();
    let server = Server::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "20"]);
    let operator = operator(&driver, &server).await;
    assert_eq!(coloured(&operator, IN_FOCUS).await, 0);

    operator.click("#depths").await;
    operator.sees("#depths-key", "Disc: in focus.").await;
    // It learns while the lens moves.
    operator.select("#policy", "parfocal").await;
    until("places in focus", || async { coloured(&operator, IN_FOCUS).await > 100 }).await;
    operator.run("scrollTo(0, 0)", &[]).await;
    shoot(&operator, "depth-map").await;

    let far = server.post_as("operator", "/api/operator/focus").json(&json!({"focal_power": 0.9}));
    assert!(far.send().await.unwrap().status().is_success());
    until("places that are not", || async { coloured(&operator, LOWER).await > 100 }).await;
    operator.run("scrollTo(0, 0)", &[]).await;
    shoot(&operator, "depth-map-away").await;

    operator.click("#depths").await;
    until("no places", || async { coloured(&operator, LOWER).await == 0 }).await;
    operator.sees_no("#depths-key").await;
}

/// The middle of what is drawn over the picture, in pixels of the overlay; none if nothing is.
async fn marked(operator: &Browser) -> Option<(f64, f64)> {
    let script = "const canvas = document.querySelector('.viewer-overlay');
        const { data, width } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        let [count, x, y] = [0, 0, 0];
        for (let at = 0; at < data.length; at += 4) {
            if (data[at] < 120 && data[at + 1] > 200 && data[at + 2] > 200 && data[at + 3] > 200) {
                count += 1; x += (at / 4) % width; y += Math.floor(at / 4 / width);
            }
        }
        return count === 0 ? null : [x / count, y / count];";
    match operator.run(script, &[]).await {
        Value::Array(place) => Some((place[0].as_f64().unwrap(), place[1].as_f64().unwrap())),
        _ => None,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_place_follows_the_tissue_while_the_operator_wants_it() {
    let driver = Driver::start();
    let data = Arc::new(tempfile::tempdir().unwrap());
    let server = Server::on(data, &["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "20"]);
    let operator = operator(&driver, &server).await;
    // A policy keeps the phantom in focus, without which no tissue is recognised.
    operator.select("#policy", "mgm-hill-climber").await;
    until("a picture", || async { operator.is(".viewer-stale", "hidden").await }).await;
    let chosen = "return document.querySelector('#follow-tissue').checked";
    assert_eq!(operator.run(chosen, &[]).await, false);

    let before = marked(&operator).await.expect("the patch at the centre");
    operator.focus("#view").await;
    for _ in 0..2 {
        let right = json!({ "type": "keyDown", "key": "ArrowRight", "code": "ArrowRight", "modifiers": 8 });
        operator.tools("Input.dispatchKeyEvent", right).await;
    }
    until("the place", || async { marked(&operator).await.is_some_and(|at| at.0 > before.0 + 10.0) }).await;
    operator.click("#follow-tissue").await;
    until("the server's word", || async { operator.run(chosen, &[]).await == true }).await;

    let first = marked(&operator).await.unwrap();
    until("the patch to go with the tissue, or to lose it", || async {
        let far = |at: (f64, f64)| (at.0 - first.0).hypot(at.1 - first.1) > 8.0;
        marked(&operator).await.is_some_and(far)
    })
    .await;
    shoot(&operator, "follow-1-on").await;
    for (width, height) in [(1280, 900), (820, 1180)] {
        resize(&operator, width, height).await;
        accessible::check(&operator, &format!("the operator's page that follows the tissue at {width}x{height}")).await;
    }

    operator.click("#follow-tissue").await;
    until("the server's word", || async { operator.run(chosen, &[]).await == false }).await;
}
