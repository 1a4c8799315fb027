//! Spectra at places of the picture: of a recording on the researcher's page, of the live picture on the operator's.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use fantoccini::key::Key;
use parfocal_devices::camera::calibration;
use parfocal_imaging::{BANDS, Calibration, Reference};
use parfocal_recording::Recording;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::accessible;
use super::blinding;
use super::driver::{Browser, Driver};
use super::playback::{drawn, press, unblind, until_drawn};
use super::pointing;
use super::screenshots::{resize, shoot};
use super::theatre::{Theatre, operator};
use super::wait::until;
use crate::support::{BRAIN, Server};

/// A row of the table that the page copies; empty cells are none.
type Row = BTreeMap<String, Option<f64>>;

/// Keeps what the page copies.
const KEEP_COPIED: &str = "navigator.clipboard.writeText = async (text) => { window.copied = text; };";

/// A tablet held upright and across.
const TABLET: [(u32, u32); 2] = [(820, 1180), (1180, 820)];

/// Five places in a picture, as fractions of its sides.
const PLACES: [(f64, f64); 5] = [(0.5, 0.5), (0.4, 0.45), (0.6, 0.42), (0.45, 0.66), (0.58, 0.7)];

/// Clicks or touches `css` at a place, given as fractions of its sides.
async fn point(page: &Browser, css: &str, (across, down): (f64, f64), by_touch: bool) {
    page.show(css).await;
    let look = "const box = document.querySelector(arguments[0]).getBoundingClientRect();
        return [box.left + arguments[1] * box.width, box.top + arguments[2] * box.height];";
    let at = page.run(look, &[json!(css), json!(across), json!(down)]).await;
    let (x, y) = (at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
    if by_touch {
        page.touch("touchStart", &[(x, y)]).await;
        page.touch("touchEnd", &[]).await;
        return;
    }
    for kind in ["mousePressed", "mouseReleased"] {
        let click = json!({"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1});
        page.tools("Input.dispatchMouseEvent", click).await;
    }
}

/// Waits until each of `count` places has its spectrum.
async fn measured(page: &Browser, count: usize) {
    until(&format!("{count} spectra"), || async {
        let said = page.properties("#spectra-places .measured", "textContent").await;
        said.len() == count && said.iter().all(|said| said.contains("cell"))
    })
    .await;
    assert_eq!(page.count("#spectra-plot path.mean").await, count);
    assert_eq!(page.count("#spectra-plot path.spread").await, count);
}

/// The table that *Copy as CSV* copies.
async fn copied(page: &Browser) -> Vec<Row> {
    page.run(&format!("{KEEP_COPIED} window.copied = null;"), &[]).await;
    page.click("#spectra-copy").await;
    until("the table", || async { page.run("return window.copied", &[]).await.is_string() }).await;
    let table = page.run("return window.copied", &[]).await;
    let rows = csv::Reader::from_reader(table.as_str().unwrap().as_bytes()).into_deserialize::<Row>();
    rows.map(Result::unwrap).collect()
}

/// Panics unless the page's numbers are those that `parfocal recording spectrum` gives for the same frame and places.
fn assert_of_command(rows: &[Row], recording: &Path, frame: usize) {
    let number = |row: &Row, name: &str| row[name].unwrap();
    for place in rows.chunks(16) {
        let at = format!("{},{}", number(&place[0], "x"), number(&place[0], "y"));
        let radius = number(&place[0], "radius").to_string();
        let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
        command.args(["recording", "spectrum", "--at", &at, "--radius", &radius, "--frames", &frame.to_string()]);
        let table = command.arg(recording).output().unwrap().stdout;
        let bands = csv::Reader::from_reader(table.as_slice()).into_deserialize::<Row>();
        let bands: Vec<Row> = bands.map(Result::unwrap).collect();
        assert_eq!(bands.len(), place.len());
        for (band, row) in bands.iter().zip(place) {
            assert!(band.iter().all(|(name, value)| row[name] == *value), "{band:?}\n{row:?}");
        }
    }
}

/// The circles, marks and corners over a picture: how many pixels of `canvas` have about this colour.
async fn pixels(page: &Browser, canvas: &str, colour: [u8; 3]) -> u64 {
    let count = "const canvas = document.querySelector(arguments[0]);
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        let found = 0;
        for (let at = 0; at < data.length; at += 4) {
            const near = arguments[1].every((part, index) => Math.abs(data[at + index] - part) < 12);
            if (near && data[at + 3] > 200) found += 1;
        }
        return found;";
    page.run(count, &[json!(canvas), json!(colour)]).await.as_u64().unwrap()
}

/// The colours of the five places.
const COLOURS: [[u8; 3]; 5] = [[0x56, 0xb4, 0xe9], [0xf0, 0xe4, 0x42], [0, 0x9e, 0x73], [0xd5, 0x5e, 0], [255; 3]];

/// The colour of the patch's corners.
const CORNERS: [u8; 3] = [0x5c, 0xf2, 0xff];

/// Presses a key with Shift, as Chromium's own protocol has it.
async fn press_shifted(page: &Browser, key: &str) {
    for kind in ["keyDown", "keyUp"] {
        page.tools("Input.dispatchKeyEvent", json!({"type": kind, "key": key, "code": key, "modifiers": 8})).await;
    }
}

/// Presses the Tab key until the element `css` has the focus.
async fn tab_to(page: &Browser, css: &str) {
    for _ in 0..80 {
        if page.run("return document.activeElement.matches(arguments[0])", &[json!(css)]).await == true {
            return;
        }
        page.press(Key::Tab.into()).await;
    }
    panic!("the Tab key does not lead to {css}");
}

/// The frames in `Recording mosaics, as the protocol asks: 12 s, 120 frames, 190 MB.`
async fn recorded_frames(operator: &Browser) -> usize {
    let words = operator.text("#recording-now").await;
    let frames = words.split(", ").find_map(|part| part.strip_suffix(" frames"));
    frames.map_or(0, |frames| frames.parse().unwrap())
}

/// A recorded session in which the surgeon points at a place, unblinded on the researcher's page.
async fn recorded(theatre: &Theatre) {
    theatre.begin("S-46", "filmed").await;
    theatre.tap_notice(1).await;
    pointing::point(&theatre.surgeon).await;
    until("the place", || async {
        let pool = theatre.server.database().await;
        let sql = "SELECT count(*) FROM events WHERE kind = 'patch-placed'";
        let placed: i64 = sqlx::query_scalar(sql).fetch_one(&pool).await.unwrap();
        pool.close().await;
        placed > 0
    })
    .await;
    // The disk may be slow, and frames of before the place are of no use here.
    let before = recorded_frames(&theatre.operator).await;
    until("frames after it", || async { recorded_frames(&theatre.operator).await >= before + 10 }).await;
    theatre.say("Sharp there", 1).await;
    theatre.abort("the test is over").await;
    theatre.operator.sees("#recording-notice", "frames are saved in").await;

    let page = &theatre.operator;
    page.open(&theatre.server.link("researcher")).await;
    page.click("td a.button").await;
    page.sees("#comment-list", "Sharp there").await;
    unblind(page).await;
    until_drawn(page, 0).await;
}

/// The only recording in the server's folder.
fn recording(theatre: &Theatre) -> Recording {
    let folder = theatre.server.data.path().join("recordings");
    let mut found = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    Recording::open(&found.next().unwrap()).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_researcher_sees_spectra_at_places_of_a_recording() {
    let driver = Driver::start();
    let theatre = Theatre::seeing(&driver).await;
    recorded(&theatre).await;
    let page = &theatre.operator;
    let recording = recording(&theatre);
    assert_eq!(pixels(page, "#player-marks", CORNERS).await, 0, "nobody has pointed yet");
    page.show("#player-stage").await;
    shoot(page, "spectra-1-player-empty").await;

    // The time from the click to the plot, in the page itself.
    let watch = "window.took = null;
        addEventListener('mouseup', () => {
            const began = performance.now();
            new MutationObserver((_, observer) => {
                if (!document.querySelector('#spectra-plot path.mean')) return;
                window.took = performance.now() - began;
                observer.disconnect();
            }).observe(document.getElementById('spectra-plot'), { childList: true });
        }, { once: true, capture: true });";
    page.run(watch, &[]).await;
    point(page, "#player-stage", PLACES[0], false).await;
    measured(page, 1).await;
    let took = page.run("return window.took", &[]).await.as_f64().unwrap();
    println!("a spectrum stood {took:.0} ms after the click, in a debug build");

    for (index, place) in PLACES.into_iter().enumerate().skip(1) {
        point(page, "#player-stage", place, index == 2).await;
        measured(page, index + 1).await;
    }
    for colour in COLOURS {
        assert!(pixels(page, "#player-marks", colour).await > 20, "{colour:?}");
    }
    page.sees("#spectra-unit", "Counts, not reflectance: the calibration has no white reference.").await;
    let rows = copied(page).await;
    assert_eq!(rows.len(), 5 * 16);
    let middle = (rows[0]["x"].unwrap(), rows[0]["y"].unwrap());
    assert!((middle.0 - 1024.0).abs() < 8.0 && (middle.1 - 544.0).abs() < 8.0, "{middle:?}");
    assert!(rows.iter().all(|row| row["frame"] == Some(0.0)));
    assert_of_command(&rows, recording.folder(), 0);

    point(page, "#player-stage", (0.5, 0.3), false).await;
    page.sees("#spectra-trouble", "5 places are the most. Remove one, then set another.").await;
    assert_eq!(page.count("#spectra-places li").await, 5);
    page.click("#spectra-numbers summary").await;
    page.sees("#spectra-table", "Place 5").await;
    for (width, height) in TABLET {
        resize(page, width, height).await;
        accessible::check_reach(page, &format!("spectra of a recording at {width}x{height}")).await;
    }
    // The line has the focus, so the space bar folds the numbers up again, and plays nothing.
    press(page, " ").await;
    until("the numbers folded up", || async { page.count("#spectra-numbers[open]").await == 0 }).await;
    assert_eq!(page.text("#player-play").await, "Play");
    page.show("#spectra-plot").await;
    shoot(page, "spectra-2-player").await;

    // The spectra follow the frame on screen, and a radius makes the circles larger.
    page.click("#player-forward").await;
    until_drawn(page, 1).await;
    page.sees("#spectra-frame", "frame 1").await;
    let cells = page.text("#spectra-places .measured").await;
    page.drag_slider("#spectra-radius", &[64.0]).await;
    until("larger circles", || async {
        let now = page.text("#spectra-places .measured").await;
        now.contains("cell") && now != cells
    })
    .await;
    assert_of_command(&copied(page).await, recording.folder(), 1);

    saved(page).await;
    page.click_labelled("#spectra-places li:nth-child(2)", "Remove").await;
    measured(page, 4).await;
    assert_eq!(pixels(page, "#player-marks", COLOURS[1]).await, 0);
    page.click("#spectra-clear").await;
    measured(page, 0).await;

    by_keyboard(page).await;
    corners(&theatre, page, &recording).await;
    assert_eq!(page.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
}

/// The plot as files.
async fn saved(page: &Browser) {
    let folder = TempDir::new().unwrap();
    let to = json!({"behavior": "allow", "downloadPath": folder.path()});
    page.tools("Page.setDownloadBehavior", to).await;
    page.click("#spectra-svg").await;
    page.click("#spectra-png").await;
    let (svg, png) = (folder.path().join("spectra-frame-1.svg"), folder.path().join("spectra-frame-1.png"));
    until("both files", || async { svg.is_file() && png.is_file() }).await;

    let svg = std::fs::read_to_string(svg).unwrap();
    assert_eq!(svg.matches("class=\"mean\"").count(), 5, "{svg}");
    assert!(svg.starts_with("<?xml") && svg.contains("Frame 1, radius 64 samples.") && svg.contains("wavelength (nm)"));
    let png = image::open(png).unwrap().into_rgb8();
    assert_eq!((png.width(), png.height()), (1440, 920));
    let blue = png.pixels().filter(|pixel| pixel.0 == [0x1f, 0x7f, 0xc4]).count();
    assert!(png.get_pixel(0, 0).0 == [255; 3] && blue > 200, "{blue}");
}

/// Sets a place, changes the radius and removes the place, with the keyboard alone.
async fn by_keyboard(page: &Browser) {
    let before = drawn(page).await;
    page.run("document.activeElement.blur()", &[]).await;
    tab_to(page, "#player-stage").await;
    for key in ["ArrowRight", "ArrowRight", "ArrowDown"] {
        press(page, key).await;
    }
    press_shifted(page, "ArrowLeft").await;
    assert!(pixels(page, "#player-marks", [255; 3]).await > 20, "the cross");
    page.press(Key::Enter.into()).await;
    measured(page, 1).await;
    assert_eq!(drawn(page).await, before, "on the picture the arrows leave the frame as it is");
    let row = copied(page).await.remove(0);
    assert!(row["x"].unwrap() > 1024.0 && row["y"].unwrap() > 544.0, "{row:?}");

    tab_to(page, "#player-stage").await;
    tab_to(page, "#spectra-radius").await;
    let radius = page.value("#spectra-radius").await;
    page.press(Key::Right.into()).await;
    assert_ne!(page.value("#spectra-radius").await, radius);
    assert_eq!(drawn(page).await, before);
    tab_to(page, "#spectra-places button").await;
    page.press(Key::Enter.into()).await;
    measured(page, 0).await;
    assert_eq!(page.run("return document.activeElement.id", &[]).await, "spectra-radius", "the focus is not lost");
}

/// The corners stand where the telemetry says that the patch was.
async fn corners(theatre: &Theatre, page: &Browser, recording: &Recording) {
    // A step back from the end, where nothing may have been recorded any more.
    page.drag_slider("#player-scrub", &[1e9]).await;
    page.click("#player-back").await;
    let frames = i64::try_from(recording.rows().len()).unwrap();
    until("a frame near the end", || async { drawn(page).await > frames / 2 }).await;
    // The last ones may be of after the abort. The picture of the step before may still be under way.
    while pixels(page, "#player-marks", CORNERS).await == 0 {
        let at = drawn(page).await;
        assert!(at > 0, "no frame has corners");
        page.click("#player-back").await;
        until("the frame before", || async { drawn(page).await < at }).await;
    }
    let frame = usize::try_from(drawn(page).await).unwrap();
    let number = recording.rows()[frame].number;
    let pool = theatre.server.database().await;
    let sql = format!("SELECT patch_x, patch_y FROM telemetry WHERE frame = {number}");
    let (x, y): (i64, i64) = sqlx::query_as(sqlx::AssertSqlSafe(sql)).fetch_one(&pool).await.unwrap();
    pool.close().await;

    let find = "const canvas = document.getElementById('player-marks');
        const { data, width } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        const xs = [], ys = [];
        for (let at = 0; at < data.length; at += 4) {
            if (data[at] < 120 && data[at + 1] > 200 && data[at + 2] > 200 && data[at + 3] > 200) {
                xs.push((at / 4) % width);
                ys.push(Math.floor(at / 4 / width));
            }
        }
        const cells = canvas.width / 512;
        const min = (list) => list.reduce((a, b) => Math.min(a, b), Infinity) / cells;
        const max = (list) => list.reduce((a, b) => Math.max(a, b), 0) / cells;
        return [min(xs), min(ys), max(xs), max(ys)];";
    let found = page.run(find, &[]).await;
    for (found, expected) in found.as_array().unwrap().iter().zip([x, y, x + 32, y + 32]) {
        assert!((found.as_f64().unwrap() - expected as f64).abs() < 1.5, "{found} is not {expected}");
    }
    point(page, "#player-stage", PLACES[2], false).await;
    measured(page, 1).await;
    page.show("#player-stage").await;
    shoot(page, "spectra-3-player-corners").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_operator_sees_live_spectra_outside_sessions_and_never_in_one() {
    let driver = Driver::start();
    let theatre = Theatre::seeing(&driver).await;
    let page = &theatre.operator;
    until("a live picture", || async { page.is(".viewer-stale", "hidden").await }).await;
    page.sees_no("#spectra").await;
    page.click("#point-spectrum").await;
    page.sees("#spectra-hint", "Tap up to five places").await;

    for (index, place) in PLACES.into_iter().enumerate() {
        point(page, "#view", place, true).await;
        // Two taps near each other and soon after each other would zoom.
        measured(page, index + 1).await;
    }
    for colour in COLOURS {
        assert!(pixels(page, ".viewer-overlay", colour).await > 20, "{colour:?}");
    }
    let ringed = pixels(&theatre.surgeon, ".viewer-overlay", CORNERS).await;
    assert_eq!(ringed, 0, "a tap for a spectrum leaves the focus where it is");
    for (width, height) in TABLET {
        resize(page, width, height).await;
        accessible::check_reach(page, &format!("live spectra at {width}x{height}")).await;
    }
    page.to_top().await;
    shoot(page, "spectra-4-operator").await;
    page.show("#spectra").await;
    shoot(page, "spectra-5-operator-panel").await;

    // They are of the live picture: the frame goes on, and its numbers are those of the recorded mosaic.
    page.click("#record").await;
    page.sees("#recording-now", "Recording mosaics").await;
    let seen = page.text("#spectra-frame").await;
    until("later frames", || async { page.text("#spectra-frame").await != seen }).await;
    let mut rows = copied(page).await;
    until("a frame that is in the recording", || async { page.text("#recording-now").await.contains("frames") }).await;
    let later = page.text("#spectra-frame").await;
    until("later frames", || async { page.text("#spectra-frame").await != later }).await;
    rows.extend(copied(page).await);
    page.click("#record").await;
    page.sees("#recording-notice", "frames are saved in").await;
    let recording = recording(&theatre);
    let mut compared = 0;
    for rows in rows.chunks(5 * 16) {
        let number = rows[0]["frame"].unwrap();
        let frame = recording.rows().iter().position(|row| (row.number as f64 - number).abs() < 0.5);
        if let Some(frame) = frame {
            assert_of_command(rows, recording.folder(), frame);
            compared += 1;
        }
    }
    assert!(compared > 0, "no frame of the page is in the recording");

    live_by_keyboard(page).await;

    // In a session there are neither, and the server refuses.
    theatre.begin("S-47", "short").await;
    page.sees_no("#spectra").await;
    page.sees_no("#point-modes").await;
    until("no circles", || async { pixels(page, ".viewer-overlay", COLOURS[0]).await == 0 }).await;
    let ask = "return fetch('/api/operator/spectra', {
            method: 'POST',
            headers: { 'content-type': 'application/json' },
            body: JSON.stringify({ places: [{ x: 1000, y: 500, radius: 20 }] }),
        }).then(async (answer) => [answer.status, await answer.json()])";
    let refused: Value = page.run(ask, &[]).await;
    assert_eq!(refused[0], 409);
    assert!(refused[1]["error"].as_str().unwrap().contains("a session is under way"), "{refused}");
    assert_eq!(page.complaints().await.iter().find(|text| text.contains("Uncaught")), None);

    // Nothing of it reaches the surgeon's browser.
    let seen = blinding::check(&theatre.proxy.recorded());
    assert!(seen.files.iter().all(|file| !file.starts_with("spectra/")), "{:?}", seen.files);
}

/// Removes all, sets a place and goes back to pointing the focus, with the keyboard alone.
async fn live_by_keyboard(page: &Browser) {
    page.run("document.activeElement.blur()", &[]).await;
    tab_to(page, "#spectra-clear").await;
    page.press(Key::Enter.into()).await;
    measured(page, 0).await;
    page.run("document.activeElement.blur()", &[]).await;
    tab_to(page, "#view").await;
    press(page, "ArrowLeft").await;
    press(page, "ArrowUp").await;
    until("the cross", || async { pixels(page, ".viewer-overlay", [255; 3]).await > 20 }).await;
    page.press(Key::Enter.into()).await;
    measured(page, 1).await;
    let row = copied(page).await.remove(0);
    assert!(row["x"].unwrap() < 1024.0 && row["y"].unwrap() < 544.0, "{row:?}");

    page.run("document.activeElement.blur()", &[]).await;
    tab_to(page, "#point-focus").await;
    page.press(Key::Enter.into()).await;
    assert_eq!(page.attribute("#point-focus", "aria-pressed").await.as_deref(), Some("true"));
    assert_eq!(page.count("#spectra-places li").await, 1, "the places stay");
}

#[tokio::test(flavor = "multi_thread")]
async fn with_a_white_reference_and_text_of_twice_the_size_reflectance_can_be_read() {
    let folder = TempDir::new().unwrap();
    let white = Calibration {
        dark: Reference::PerBand([20.0; BANDS]),
        white: Reference::PerBand([900.0; BANDS]),
        ..Calibration::default()
    };
    calibration::save(folder.path(), &white, &[]).unwrap();
    let file = folder.path().join("calibration.toml");
    let server = Server::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN, "--calibration", file.to_str().unwrap()]);

    let driver = Driver::start();
    let page = driver.browser_with_large_text().await;
    page.open(&server.link("operator")).await;
    page.click("#point-spectrum").await;
    for (index, place) in PLACES.into_iter().take(2).enumerate() {
        point(&page, "#view", place, true).await;
        measured(&page, index + 1).await;
    }
    page.sees("#spectra-unit", "Reflectance: 0 is as dark as the dark reference, 1 as bright as the white one.").await;
    for row in copied(&page).await {
        let expected = (row["counts"].unwrap() - 20.0) / 880.0;
        assert!((row["reflectance"].unwrap() - expected).abs() < 1e-5, "{row:?}");
    }
    for (width, height) in TABLET {
        resize(&page, width, height).await;
        accessible::check_reach(&page, &format!("live spectra in large text at {width}x{height}")).await;
    }
    page.show("#spectra-plot").await;
    shoot(&page, "spectra-6-large-text").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_camera_without_bands_offers_no_spectra() {
    let folder = TempDir::new().unwrap();
    let still = folder.path().join("still.png");
    image::GrayImage::from_pixel(640, 480, image::Luma([90])).save(&still).unwrap();
    let camera = format!("footage:{}", still.display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "5", "--camera", &camera]);
    let driver = Driver::start();
    let page = operator(&driver, &server).await;
    until("a live picture", || async { page.is(".viewer-stale", "hidden").await }).await;
    page.sees_no("#point-modes").await;
    page.sees_no("#spectra").await;
}
