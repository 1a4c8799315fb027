//! The picture on the page: fitted to the bright circle, at the size that the screen can show, and zoomed only by
//! people.

use std::cell::Cell;

use serde_json::json;

use super::driver::{Area, Browser, Driver};
use super::screenshots::{resize, set_screen, shoot};
use super::theatre::{Theatre, operator};
use super::wait::until;
use crate::support::{BRAIN, Server};

/// Selector of the canvas with the picture.
const PICTURE: &str = ".viewer-picture";

/// Page size of an upright tablet.
const UPRIGHT: (u32, u32) = (820, 1180);

/// A surgeon's page with a picture on it.
async fn surgeon(driver: &Driver, server: &Server) -> Browser {
    let browser = driver.browser().await;
    browser.open(&server.link("surgeon")).await;
    is_live(&browser).await;
    is_fitted(&browser).await;
    browser
}

/// Waits until the view is fitted to the bright circle. It follows a circle that is seen for a second, the first time
/// after the first pictures.
async fn is_fitted(browser: &Browser) {
    // Every look takes 40 ms and more.
    const LOOKS: u32 = 50;
    let still = Cell::new((browser.area(PICTURE).await, 0));
    until("the view to stay where it is", || async {
        let (before, looks) = still.get();
        let now = browser.area(PICTURE).await;
        still.set((now, if now == before { looks + 1 } else { 0 }));
        looks >= LOOKS
    })
    .await;
}

/// Waits for a picture.
async fn is_live(browser: &Browser) {
    until("a picture", || async { browser.is(".viewer-stale", "hidden").await }).await;
}

fn server() -> Server {
    Server::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "10"])
}

/// Waits until the page shows pictures of one pixel per cell, or larger ones. How large they get depends on how fast
/// the machine draws them.
async fn gets(browser: &Browser, larger: bool) {
    until(if larger { "larger pictures" } else { "small pictures" }, || async {
        let width = browser.run("return document.querySelector(arguments[0]).width", &[json!(PICTURE)]).await;
        (width.as_u64() > Some(512)) == larger
    })
    .await;
}

/// Waits until the picture is `factor` times as large as `before`, within 1 %.
async fn is_enlarged(browser: &Browser, before: Area, factor: f64) {
    until(&format!("a picture {factor} times as large"), || async {
        let ratio = browser.area(PICTURE).await.width / before.width;
        (ratio / factor - 1.0).abs() < 0.01
    })
    .await;
}

/// The lit part of the view, as fractions of its sides.
async fn lit(browser: &Browser) -> Area {
    let view = browser.area("#view").await;
    let screen = image::load_from_memory(&browser.screenshot().await).unwrap().to_luma8();

    // The overlays at corners and edges are not on the two lines through the middle.
    let at = |x: f64, y: f64| screen.get_pixel(x as u32, y as u32).0[0] > 24;
    let ends = |length: f64, is_lit: &dyn Fn(f64) -> bool| {
        let steps: Vec<f64> = (0..length as u32).map(f64::from).filter(|step| is_lit(*step)).collect();
        (steps[0] / length, (steps[steps.len() - 1] + 1.0) / length)
    };
    let (left, right) = ends(view.width, &|x| at(view.left + x, view.top + view.height / 2.0));
    let (top, bottom) = ends(view.height, &|y| at(view.left + view.width / 2.0, view.top + y));
    Area { left, top, width: right - left, height: bottom - top }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_bright_circle_fills_the_view() {
    let driver = Driver::start();
    let server = server();
    let surgeon = surgeon(&driver, &server).await;
    for (width, height) in [UPRIGHT, (1180, 820)] {
        resize(&surgeon, width, height).await;
        let view = surgeon.area("#view").await;
        let lit = lit(&surgeon).await;
        let (across, side) = if view.width < view.height { (lit.width, "width") } else { (lit.height, "height") };
        assert!(across > 0.9, "{across} of the view's {side} at {width}x{height}: {lit:?} of {view:?}");
        assert!((lit.left + lit.width / 2.0 - 0.5).abs() < 0.03, "in the middle: {lit:?}");
    }

    shoot(&surgeon, "view-1-fitted").await;
}

/// Notes the picture's width in pixels, its place and the light in its middle, several times per picture. Doing it at
/// each frame of the screen would keep a busy machine from drawing larger pictures.
const NOTE: &str = "const canvas = document.querySelector('.viewer-picture');
    const small = Object.assign(document.createElement('canvas'), { width: 8, height: 8 });
    const pen = small.getContext('2d', { willReadFrequently: true });
    window.notes = [];
    const note = () => {
        const { width, height } = canvas;
        pen.drawImage(canvas, width * .5, height * .5, 8, 8, 0, 0, 8, 8);
        const light = pen.getImageData(0, 0, 8, 8).data.reduce((sum, one, at) => sum + (at % 4 < 3 ? one : 0), 0) / 192;
        const { left, top, width: wide } = canvas.getBoundingClientRect();
        window.notes.push({ pixels: width, light, place: [left, top, wide].map(Math.round).join(' ') });
        setTimeout(note, 40);
    };
    note();";

#[tokio::test(flavor = "multi_thread")]
async fn a_finer_screen_gets_larger_pictures_at_the_same_place_without_a_flash() {
    let driver = Driver::start();
    let server = Server::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "5"]);
    let surgeon = surgeon(&driver, &server).await;
    set_screen(&surgeon, 640, 480, 1).await;
    gets(&surgeon, false).await;

    surgeon.run(NOTE, &[]).await;
    set_screen(&surgeon, 640, 480, 2).await;
    gets(&surgeon, true).await;
    set_screen(&surgeon, 640, 480, 1).await;
    gets(&surgeon, false).await;

    let notes = surgeon.run("return window.notes", &[]).await;
    let notes = notes.as_array().unwrap();
    let shown = |width: u32| notes.iter().any(|note| note["pixels"] == width);
    assert!(shown(512) && shown(1024));
    let lights: Vec<f64> = notes.iter().map(|note| note["light"].as_f64().unwrap()).collect();
    assert!(lights.iter().all(|light| *light > 24.0), "the picture is black for a moment: {lights:?}");
    let places: std::collections::BTreeSet<&str> = notes.iter().filter_map(|note| note["place"].as_str()).collect();
    assert_eq!(places.len(), 1, "{places:?}");
}

/// The view's place and height with the badge about smaller pictures and without it. A page shows it only where they
/// stay small for a while.
const WITH_AND_WITHOUT_BADGE: &str = "const badge = document.getElementById('reduced');
    return [false, true].map((hidden) => {
        badge.hidden = hidden;
        const { top, height } = document.getElementById('view').getBoundingClientRect();
        return [top, height];
    });";

#[tokio::test(flavor = "multi_thread")]
async fn a_badge_that_comes_or_goes_does_not_move_the_picture() {
    let driver = Driver::start();
    let server = server();
    let surgeon = surgeon(&driver, &server).await;
    for (width, height) in [UPRIGHT, (1180, 820), (640, 480)] {
        resize(&surgeon, width, height).await;
        let places = surgeon.run(WITH_AND_WITHOUT_BADGE, &[]).await;
        assert_eq!(places[0], places[1], "at {width}x{height}");
    }
}

async fn turn_wheel(browser: &Browser, x: f64, y: f64, by: f64) {
    let wheel = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": by });
    browser.tools("Input.dispatchMouseEvent", wheel).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_surgeon_zooms_by_taps_pinches_and_keys_and_gets_larger_pictures() {
    let driver = Driver::start();
    let server = server();
    let surgeon = surgeon(&driver, &server).await;
    resize(&surgeon, UPRIGHT.0, UPRIGHT.1).await;
    let fitted = surgeon.area(PICTURE).await;

    let view = surgeon.area("#view").await;
    let (x, y) = (view.left + view.width / 2.0, view.top + view.height / 2.0);
    surgeon.double_click("#view").await;
    is_enlarged(&surgeon, fitted, 2.5).await;
    gets(&surgeon, true).await;
    surgeon.sees(".viewer-unzoom", "2.5×").await;
    shoot(&surgeon, "view-2-zoomed").await;
    resize(&surgeon, UPRIGHT.0, UPRIGHT.1).await;

    // One finger drags.
    let before = surgeon.area(PICTURE).await;
    surgeon.touch("touchStart", &[(x, y)]).await;
    surgeon.touch("touchMove", &[(x + 60.0, y + 30.0)]).await;
    surgeon.touch("touchEnd", &[]).await;
    let after = surgeon.area(PICTURE).await;
    let moved = (after.left - before.left, after.top - before.top);
    assert!((moved.0 - 60.0).abs() < 1.0 && (moved.1 - 30.0).abs() < 1.0, "{moved:?}");

    surgeon.double_click("#view").await;
    is_enlarged(&surgeon, fitted, 1.0).await;
    assert_eq!(surgeon.area(PICTURE).await, fitted);

    surgeon.touch("touchStart", &[(x - 50.0, y), (x + 50.0, y)]).await;
    surgeon.touch("touchMove", &[(x - 100.0, y), (x + 100.0, y)]).await;
    surgeon.touch("touchEnd", &[]).await;
    is_enlarged(&surgeon, fitted, 2.0).await;
    surgeon.click(".viewer-unzoom").await;
    is_enlarged(&surgeon, fitted, 1.0).await;

    surgeon.focus("#view").await;
    surgeon.type_into("#view", "++").await;
    is_enlarged(&surgeon, fitted, 1.25 * 1.25).await;
    surgeon.type_into("#view", "-").await;
    is_enlarged(&surgeon, fitted, 1.25).await;
    surgeon.type_into("#view", "0").await;
    is_enlarged(&surgeon, fitted, 1.0).await;

    surgeon.type_into("#view", "++++++++++++").await;
    is_enlarged(&surgeon, fitted, 4.0).await;
    let overlay = surgeon.run("return document.querySelector('.viewer-overlay').width", &[]).await;
    assert_eq!(overlay.as_f64(), Some(view.width), "overlays are drawn at the screen's own pixels");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_operator_zooms_by_the_wheel_and_drags() {
    let driver = Driver::start();
    let server = server();
    let operator = operator(&driver, &server).await;
    is_live(&operator).await;
    let fitted = operator.area(PICTURE).await;
    let view = operator.area("#view").await;

    turn_wheel(&operator, view.left + 200.0, view.top + 150.0, -400.0).await;
    is_enlarged(&operator, fitted, 0.6_f64.exp()).await;
    operator.sees(".viewer-unzoom", "1.8×").await;
    shoot(&operator, "view-3-operator").await;

    turn_wheel(&operator, view.left + 200.0, view.top + 150.0, 900.0).await;
    is_enlarged(&operator, fitted, 1.0).await;
    assert_eq!(operator.run("return scrollY", &[]).await, 0, "what zooms does not scroll");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_zoom_stays_from_one_setting_to_the_next() {
    let driver = Driver::start();
    let theatre = Theatre::seeing(&driver).await;
    theatre.begin("Z-01", "short").await;
    theatre.tap_notice(1).await;
    is_live(&theatre.surgeon).await;
    let fitted = theatre.surgeon.area(PICTURE).await;
    theatre.surgeon.double_click("#view").await;
    is_enlarged(&theatre.surgeon, fitted, 2.5).await;
    let zoomed = theatre.surgeon.area(PICTURE).await;

    theatre.finish_setting(1).await;
    theatre.tap_notice(2).await;
    assert_eq!(theatre.surgeon.area(PICTURE).await, zoomed);
}
